//! Options of reading a packed file from bytes as they come.

use crate::support::builder::builder_methods;

/// The requests of a [`LexiFeed`](super::LexiFeed).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FeedOptions {
    /// Most bytes of the file that are held at once. Default no limit.
    pub most_bytes: u64,
    /// Parts of the nonzeros of SH-rest that are asked for, those of the largest values first. Default all; with 0 there is no
    /// SH-rest.
    pub sh_parts: usize,
    /// Only chunks with centres of Gaussians in the box from the first of these points to the second are asked for. Default
    /// all.
    pub within: Option<[[f32; 3]; 2]>,
    /// Of ranges of the same kind in the same layer, those of chunks near this point are asked for first. Default the order of
    /// the file.
    pub nearest: Option<[f32; 3]>,
    /// Verify the checksums of the integers that ranges decode to, as those who write another decoder do. Default no.
    pub verify_integers: bool,
}

impl Default for FeedOptions {
    fn default() -> Self {
        Self {
            most_bytes: u64::MAX,
            sh_parts: usize::MAX,
            within: None,
            nearest: None,
            verify_integers: false,
        }
    }
}

impl FeedOptions {
    builder_methods!(
        with_most_bytes(most_bytes: u64),
        with_sh_parts(sh_parts: usize),
        with_within(within: impl Into<Option<[[f32; 3]; 2]>>),
        with_nearest(nearest: impl Into<Option<[f32; 3]>>),
        with_verify_integers(verify_integers: bool),
    );
}
