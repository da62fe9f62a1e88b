//! Writes a [`Splats`] in INRIA's layout, which every viewer reads.

use super::layout::rest_name;
use super::marks::{ANTIALIASED, mark, marks};
use super::names::{DC, NORMAL, OPACITY, POSITION, ROTATION, SCALE, shown};
use super::rows::ROWS_PER_TASK;
use super::scalar::ScalarType;
use crate::scene::splats::{SceneMeta, Splats, for_extra};
use crate::support::error::{Error, Result};
use crate::support::output::{Output, write_whole};
use crate::support::parallel::for_each_chunk_mut;
use std::collections::HashSet;
use std::io::{self, Write};

/// Rows formatted in memory before they are written: 8 MiB at 248 bytes a row.
const BLOCK_ROWS: usize = 32 * ROWS_PER_TASK;

/// Floats of a row besides SH-rest.
const FIXED_FLOATS: usize =
    POSITION.len() + NORMAL.len() + DC.len() + OPACITY.len() + SCALE.len() + ROTATION.len();

/// Writes `splats` to `output`, whole or not at all. Returns the number of bytes written.
///
/// Values are little-endian and in the order x y z nx ny nz `f_dc` `f_rest` opacity scale rot, then extras in their
/// own types. Normals are zeros if the scene has none. The scene's comments are written too. If the scene is
/// anti-aliased and no comment says so, a comment is added.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written, [`Error::Parameter`] if the arrays differ in length or
/// an extra's name cannot stand in a header.
pub fn write<'a>(output: impl Into<Output<'a>>, splats: &Splats) -> Result<u64> {
    check(splats)?;
    let output = output.into();
    let mut bytes = 0;
    write_whole(output, |file| {
        bytes = write_checked(file, splats).map_err(|e| Error::io(output.path(), e))?;
        Ok(())
    })?;
    Ok(bytes)
}

/// Writes `splats` as [`write()`] does. Returns the number of bytes written.
///
/// # Errors
/// Any error of `writer`, and [`io::ErrorKind::InvalidInput`] for a scene that [`write()`] refuses.
pub fn write_to(writer: &mut impl Write, splats: &Splats) -> io::Result<u64> {
    check(splats).map_err(|e| io::Error::new(io::ErrorKind::InvalidInput, e))?;
    write_checked(writer, splats)
}

fn write_checked(writer: &mut impl Write, splats: &Splats) -> io::Result<u64> {
    let mut writer = PlyWriter::begin(writer, splats, splats.len())?;
    writer.write(splats)?;
    Ok(writer.bytes)
}

/// Writes a scene part by part.
pub(crate) struct PlyWriter<W> {
    writer: W,
    layout: RowLayout,
    block: Vec<u8>,
    /// Bytes written so far.
    pub(crate) bytes: u64,
}

/// Bytes of the file of a scene of `count` Gaussians that is like `splats`.
pub(crate) fn file_bytes(splats: &Splats, count: usize) -> u64 {
    header(splats, count).len() as u64 + RowLayout::new(splats).row_bytes as u64 * count as u64
}

impl<W: Write> PlyWriter<W> {
    /// Writes the header of a scene of `count` Gaussians. `splats`, which was [`check`]ed, gives its properties and
    /// comments and may hold any number of Gaussians.
    pub(crate) fn begin(mut writer: W, splats: &Splats, count: usize) -> io::Result<Self> {
        let header = header(splats, count);
        writer.write_all(header.as_bytes())?;
        let layout = RowLayout::new(splats);
        let block = vec![0; layout.row_bytes * BLOCK_ROWS.min(count)];
        Ok(Self { writer, layout, block, bytes: header.len() as u64 })
    }

    /// Writes the next Gaussians.
    pub(crate) fn write(&mut self, splats: &Splats) -> io::Result<()> {
        let (count, row_bytes) = (splats.len(), self.layout.row_bytes);
        for start in (0..count).step_by(BLOCK_ROWS) {
            let rows = &mut self.block[..row_bytes * BLOCK_ROWS.min(count - start)];
            let layout = &self.layout;
            for_each_chunk_mut(rows, row_bytes * ROWS_PER_TASK, |chunk, rows| {
                layout.pack(splats, start + chunk * ROWS_PER_TASK, rows);
            });
            self.writer.write_all(rows)?;
        }
        self.bytes += row_bytes as u64 * count as u64;
        Ok(())
    }
}

/// Returns the names of the properties that every file has, in order.
fn names(rest: usize) -> impl Iterator<Item = String> {
    let fixed = |names: &'static [&'static str]| names.iter().map(|&n| n.to_owned());
    fixed(&POSITION)
        .chain(fixed(&NORMAL))
        .chain(fixed(&DC))
        .chain((0..rest).map(rest_name))
        .chain(fixed(&OPACITY))
        .chain(fixed(&SCALE))
        .chain(fixed(&ROTATION))
}

/// Refuses a scene that no PLY can hold.
pub(crate) fn check(splats: &Splats) -> Result<()> {
    splats.validate()?;
    let mut taken: HashSet<String> = names(splats.degree.rest()).collect();
    for extra in &splats.geometry.extras {
        let name = &extra.name;
        // A name with a line break could add lines to the header.
        if name.is_empty() || name.chars().any(|c| c.is_whitespace() || c.is_control()) {
            return Err(Error::parameter(
                "extra",
                shown(name),
                "a name without spaces or control characters",
            ));
        }
        if !taken.insert(name.clone()) {
            return Err(Error::parameter("extra", shown(name), "a name no other property has"));
        }
    }
    Ok(())
}

/// Returns the header of a scene of `count` Gaussians with the properties and comments of `splats`.
pub(super) fn header(splats: &Splats, count: usize) -> String {
    let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
    for comment in comments(&splats.meta) {
        text.push_str(format!("comment {comment}").trim_end());
        text.push('\n');
    }
    text.push_str(&format!("element vertex {count}\n"));
    for name in names(splats.degree.rest()) {
        text.push_str(&format!("property float {name}\n"));
    }
    for extra in &splats.geometry.extras {
        text.push_str(&format!("property {} {}\n", ScalarType::of(&extra.values).name(), extra.name));
    }
    text.push_str("end_header\n");
    text
}

/// Returns the scene's comments, each on one line, changed to agree with the scene's anti-aliasing mark.
fn comments(meta: &SceneMeta) -> Vec<String> {
    let mut out: Vec<String> =
        meta.comments.iter().map(|c| c.replace(char::is_control, " ").trim().to_owned()).collect();
    if meta.antialiased && !marks(&out).antialiased {
        out.push(ANTIALIASED.to_owned());
    } else if !meta.antialiased {
        out.retain(|comment| mark(comment) != Some(true));
    }
    out
}

/// How scenes with the same properties become rows.
pub(super) struct RowLayout {
    pub(super) row_bytes: usize,
}

impl RowLayout {
    pub(super) fn new(splats: &Splats) -> Self {
        let extras: usize = splats.geometry.extras.iter().map(|e| e.values.width()).sum();
        Self { row_bytes: (FIXED_FLOATS + splats.degree.rest()) * size_of::<f32>() + extras }
    }

    /// Writes the Gaussians from `start` on into `rows`.
    pub(super) fn pack(&self, splats: &Splats, start: usize, rows: &mut [u8]) {
        let count = rows.len() / self.row_bytes;
        let range = start..start + count;
        let geometry = &splats.geometry;
        let dim = splats.degree.rest();
        let no_normals = if geometry.normals.is_empty() { vec![[0.0; 3]; count] } else { Vec::new() };
        let normals = geometry.normals.get(range.clone()).unwrap_or(&no_normals);
        let groups = [
            (geometry.positions[range.clone()].as_flattened(), POSITION.len()),
            (normals.as_flattened(), NORMAL.len()),
            (geometry.dc[range.clone()].as_flattened(), DC.len()),
            (&splats.sh_rest[range.start * dim..range.end * dim], dim),
            (&geometry.opacities[range.clone()], OPACITY.len()),
            (geometry.scales[range.clone()].as_flattened(), SCALE.len()),
            (geometry.rotations[range.clone()].as_flattened(), ROTATION.len()),
        ];
        let mut offset = 0;
        for (values, width) in groups.into_iter().filter(|group| group.1 > 0) {
            let field = offset..offset + width * size_of::<f32>();
            for (row, values) in rows.chunks_exact_mut(self.row_bytes).zip(values.chunks_exact(width)) {
                for (target, value) in row[field.clone()].chunks_exact_mut(size_of::<f32>()).zip(values) {
                    target.copy_from_slice(&value.to_le_bytes());
                }
            }
            offset = field.end;
        }
        for extra in &geometry.extras {
            let field = offset..offset + extra.values.width();
            for_extra!(&extra.values, values => {
                for (row, value) in rows.chunks_exact_mut(self.row_bytes).zip(&values[range.clone()]) {
                    row[field.clone()].copy_from_slice(&value.to_le_bytes());
                }
            });
            offset = field.end;
        }
    }
}
