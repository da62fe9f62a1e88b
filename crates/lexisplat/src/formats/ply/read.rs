//! Reads a PLY into a [`Splats`](crate::Splats).

use std::path::Path;

use super::chunks::{PlyRead, PlySource};
use super::options::ReadOptions;
use crate::support::error::Result;
use crate::support::input::Input;
use crate::support::progress::Silent;

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
