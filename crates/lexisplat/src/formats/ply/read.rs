//! Reads a PLY into a [`Splats`].

use std::path::Path;

use super::chunks::PlySource;
use super::summary::PlySummary;
use crate::scene::splats::Splats;
use crate::support::builder::builder_methods;
use crate::support::error::Result;
use crate::support::input::Input;
use crate::support::limits::Limits;
use crate::support::progress::Silent;

/// How to read a PLY.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// Whether to leave out Gaussians with NaN or infinite values instead of refusing the file. Default `false`.
    pub drop_invalid: bool,
    /// Whether to leave out the properties that 3DGS does not define. Default `false`.
    pub drop_extras: bool,
    /// How much a file may ask for.
    pub limits: Limits,
}

impl ReadOptions {
    builder_methods!(
        with_drop_invalid(drop_invalid: bool),
        with_drop_extras(drop_extras: bool),
        with_limits(limits: Limits),
    );
}

/// A scene and a description of its file.
#[derive(Debug, Clone, PartialEq)]
pub struct PlyRead {
    /// The scene.
    pub splats: Splats,
    /// Oddities that did not prevent reading, one plain sentence each.
    pub warnings: Vec<String>,
    /// Description of the file.
    pub summary: PlySummary,
}

/// Reads the PLY at `path`. With the feature `mmap` the file is mapped.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be read, and those of [`read_bytes`].
pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<PlyRead> {
    let path = path.as_ref();
    let input = Input::open_within(path, &options.limits)?;
    read_bytes(&path.display().to_string(), &input, options)
}

/// Reads the PLY in `bytes`. Errors call it `name`.
///
/// Floats keep their bits. Other types become the nearest f32, with a warning; positions that this would move coarsely get
/// an offset ([`SceneMeta::offset`](crate::SceneMeta::offset)). Infinite opacities become 100 and
/// -100, and scales of minus infinity [`FLAT_SCALE`](crate::FLAT_SCALE), which look the same, with a warning. A file of
/// 2D Gaussians, which has no third scale, is read as one of flat ones. Memory: the arrays of the result, at most a few
/// times `bytes`.
///
/// # Errors
/// [`crate::Error::Format`] that says what is wrong: the bytes are no PLY, or an unsupported relative of 3DGS; a
/// property is missing or repeated; a count does not match; or other values are NaN or infinite and
/// [`ReadOptions::drop_invalid`] is not set. [`crate::Error::Limit`] if the file asks for more than
/// [`ReadOptions::limits`] allow.
pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<PlyRead> {
    PlySource::open_whole(name, bytes, options, &Silent)?.into_read()
}
