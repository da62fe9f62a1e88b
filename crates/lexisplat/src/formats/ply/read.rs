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
/// Floats keep their bits. Values of other types become the nearest f32, with a warning. Positions that rounding would move
/// coarsely get an offset ([`SceneMeta::offset`](crate::SceneMeta::offset)). Infinite opacities become 100 and -100, and
/// scales of minus infinity become [`FLAT_SCALE`](crate::FLAT_SCALE). Both look the same, and there is a warning. 2D
/// Gaussians, which have no third scale, become flat ones. The result takes at most a few times the memory of `bytes`.
///
/// # Errors
/// [`crate::Error::Format`] if the bytes are no PLY, or a PLY of an unsupported method; if a property is missing or
/// repeated; if a count does not match; or if other values are NaN or infinite and [`ReadOptions::drop_invalid`] is not set.
/// [`crate::Error::Limit`] if the file is over [`ReadOptions::limits`].
pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<PlyRead> {
    PlySource::open_whole(name, bytes, options, &Silent)?.into_read()
}
