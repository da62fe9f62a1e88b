//! Limits on sizes that come from a file, checked before anything is allocated.

use crate::error::{Error, Result};

/// Most atoms a dictionary may have: indices fit in 10 bits, and the Gram matrix in 4 MiB.
pub const MAX_ATOMS: usize = 1024;

/// How much a file may ask for.
///
/// A reader allocates at most a constant times the file's own size, whatever the header says: counts are
/// compared with the bytes present first. The constant is small but for packed files, where a byte may
/// stand for 3 Gaussians of some hundred bytes. These limits come on top of that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Most Gaussians in a scene. Default `u32::MAX - 1`, since indices are stored as u32.
    pub gaussians: u64,
    /// Most bytes of a text header (PLY) or JSON header (.lexi). Default 4 MiB.
    pub header_bytes: u64,
    /// Most properties of one PLY element. Default 4096.
    pub properties: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { gaussians: u64::from(u32::MAX) - 1, header_bytes: 4 << 20, properties: 4096 }
    }
}

impl Limits {
    /// `Ok` if `found <= limit`, else an [`Error::Limit`] that names `what`.
    pub(crate) fn check(what: &str, found: u64, limit: u64) -> Result<()> {
        if found <= limit { Ok(()) } else { Err(Error::Limit { what: what.to_owned(), found, limit }) }
    }
}
