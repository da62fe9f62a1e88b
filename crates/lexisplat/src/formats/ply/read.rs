//! Reads a PLY into a [`Splats`].

use std::path::Path;

use super::fill::{empty, fill, fill_normals};
use super::source::Source;
use super::summary::PlySummary;
use crate::scene::splats::Splats;
use crate::support::error::Result;
use crate::support::input::Input;
use crate::support::limits::Limits;

/// How to read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Leave out Gaussians with NaN or infinite values instead of refusing the file.
    pub drop_invalid: bool,
    /// What a file may ask for.
    pub limits: Limits,
}

/// A scene and what there is to say about its file.
#[derive(Debug, Clone, PartialEq)]
pub struct PlyRead {
    /// The scene.
    pub splats: Splats,
    /// Oddities that did not prevent reading, one plain sentence each.
    pub warnings: Vec<String>,
    /// What the file was like.
    pub source: PlySummary,
}

/// Reads the PLY at `path`, mapped with the feature `mmap`.
///
/// # Errors
/// [`crate::Error::Io`] if it cannot be read, else as [`read_bytes`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<PlyRead> {
    let input = Input::open_within(path, &options.limits)?;
    read_bytes(&path.display().to_string(), &input, options)
}

/// Reads the PLY in `bytes`; messages call it `name`.
///
/// Floats keep their bits; other types become the nearest f32 (with a warning). Infinite opacities become 100
/// and -100, which look the same (with a warning). Memory: the arrays of
/// the result, at most a few times `bytes`, and next to nothing else.
///
/// # Errors
/// [`crate::Error::Format`] naming what is wrong: no PLY, a relative of 3DGS that is not supported, a missing
/// or repeated property, a count that does not match, NaN or (but for opacities) infinite values unless
/// [`ReadOptions::drop_invalid`]. [`crate::Error::Limit`] if the file asks for more than [`ReadOptions::limits`]
/// allow.
pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<PlyRead> {
    let mut source = Source::open(name, bytes, options)?;
    source.check_room(source.count, false)?;
    let mut splats = empty(&source.layout);
    let found = fill(&source.rows, &source.layout, name, 0..source.count, &mut splats)?;
    source.judge(&found.bad, found.sure, options)?;
    if found.normals {
        source.check_room(source.count, true)?;
        fill_normals(&source.rows, &source.layout, 0..source.count, &mut splats)?;
    }
    if !found.bad.is_empty() {
        let mut keep = vec![true; source.count];
        found.bad.iter().flat_map(|b| &b.rows).for_each(|&row| keep[row] = false);
        splats.retain(&keep);
    }
    splats.meta = source.meta;
    Ok(PlyRead { splats, warnings: source.warnings, source: source.summary })
}
