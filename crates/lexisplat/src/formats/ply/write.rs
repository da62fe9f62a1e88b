//! Writes a [`Splats`] in INRIA's layout, which every viewer reads.

use super::columns::ROWS_PER_TASK;
use super::layout::rest_name;
use super::marks::{ANTIALIASED, mark, marks};
use super::names::{DC, NORMAL, OPACITY, POSITION, ROTATION, SCALE, shown};
use crate::scene::extra::{ScalarType, for_extra};
use crate::scene::offset::Offset;
use crate::scene::source::SplatSource;
use crate::scene::splats::{SceneMeta, Splats};
use crate::support::error::{Error, Result};
use crate::support::parallel::for_each_chunk_mut;
use crate::support::progress::{Progress, Silent};
use crate::support::sink::Sink;
use std::collections::HashSet;
use std::io::{self, Write};

/// Number of rows that are made in memory before they are written: 8 MiB at 248 bytes a row.
const BLOCK_ROWS: usize = 32 * ROWS_PER_TASK;

/// Number of floats of a row besides normals and SH-rest.
const FIXED_FLOATS: usize = POSITION.len() + DC.len() + OPACITY.len() + SCALE.len() + ROTATION.len();

/// Writes `splats`. Returns the number of bytes written.
///
/// Values are little-endian and in the order x y z nx ny nz `f_dc` `f_rest` opacity scale rot, then extras in their
/// own types. Positions of a scene with an offset are doubles to which the offset is added. Normals are zeros if the scene
/// has none. They are left out if an extra has one of their names. The comments of the scene follow. If the scene is
/// anti-aliased and has no mark in a comment, a comment is added.
///
/// # Errors
/// [`Error::Io`] and [`Error::Writer`] for the sink, [`Error::Parameter`] if the arrays differ in length or an extra's
/// name cannot stand in a header.
pub fn write<'a>(sink: impl Into<Sink<'a>>, splats: &Splats) -> Result<u64> {
    write_parts(sink.into(), splats, splats.has_normals(), splats.len(), &Silent, |write| write(splats))
}

/// Writes a scene of `count` Gaussians that `each` passes on part by part, with normals if `has_normals`. `like` has the
/// other properties and the comments of the scene, and any number of Gaussians. Returns the number of bytes written.
pub(crate) fn write_parts(
    sink: Sink<'_>,
    like: &Splats,
    has_normals: bool,
    count: usize,
    progress: &dyn Progress,
    each: impl FnOnce(&mut dyn FnMut(&Splats) -> Result<()>) -> Result<()>,
) -> Result<u64> {
    let normal = normal_names(like, has_normals);
    check(like, normal)?;
    let header = header(like, normal, count);
    let layout = RowLayout::new(like, normal);
    let bytes = header.len() as u64 + layout.row_bytes as u64 * count as u64;
    sink.write(bytes, progress, |writer, named| {
        writer.write_all(header.as_bytes()).map_err(named)?;
        let mut block = vec![0; layout.row_bytes * BLOCK_ROWS.min(count)];
        each(&mut |splats| layout.write(splats, &mut block, writer).map_err(named))
    })
}

/// Returns the names of the normals. The list is empty if an extra has one of the names.
fn normal_names(splats: &Splats, has_normals: bool) -> &'static [&'static str] {
    let stands_for = |name: &String| NORMAL.contains(&name.as_str());
    match has_normals || !splats.geometry.extras.iter().any(|extra| stands_for(&extra.name)) {
        true => &NORMAL,
        false => &[],
    }
}

/// Returns the names of the properties that 3DGS defines, in order. `normal` has the names of the normals.
fn names(rest: usize, normal: &'static [&'static str]) -> impl Iterator<Item = String> {
    let fixed = |names: &'static [&'static str]| names.iter().map(|&n| n.to_owned());
    fixed(&POSITION)
        .chain(fixed(normal))
        .chain(fixed(&DC))
        .chain((0..rest).map(rest_name))
        .chain(fixed(&OPACITY))
        .chain(fixed(&SCALE))
        .chain(fixed(&ROTATION))
}

/// Refuses a scene that no PLY can hold.
fn check(splats: &Splats, normal: &'static [&'static str]) -> Result<()> {
    splats.validate()?;
    let mut taken: HashSet<String> = names(splats.degree.rest(), normal).collect();
    for extra in &splats.geometry.extras {
        let name = &extra.name;
        if !taken.insert(name.clone()) {
            return Err(Error::parameter("extra", shown(name), "a name no other property has"));
        }
    }
    Ok(())
}

/// Returns the header of a scene of `count` Gaussians with the properties and comments of `splats`.
fn header(splats: &Splats, normal: &'static [&'static str], count: usize) -> String {
    let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
    for comment in comments(&splats.meta) {
        text.push_str(format!("comment {comment}").trim_end());
        text.push('\n');
    }
    text.push_str(&format!("element vertex {count}\n"));
    for name in names(splats.degree.rest(), normal) {
        let is_double = splats.meta.offset.is_some() && POSITION.contains(&name.as_str());
        let ty = if is_double { ScalarType::F64 } else { ScalarType::F32 };
        text.push_str(&format!("property {} {name}\n", ty.name()));
    }
    for extra in &splats.geometry.extras {
        text.push_str(&format!("property {} {}\n", extra.values.scalar_type().name(), extra.name));
    }
    text.push_str("end_header\n");
    text
}

/// Returns the scene's comments, each on one line, changed to agree with the scene's anti-aliasing mark. It is for writers
/// of further formats.
#[must_use]
pub fn comments(meta: &SceneMeta) -> Vec<String> {
    let mut out: Vec<String> =
        meta.comments.iter().map(|c| c.replace(char::is_control, " ").trim().to_owned()).collect();
    if meta.antialiased && !marks(&out).antialiased {
        out.push(ANTIALIASED.to_owned());
    } else if !meta.antialiased {
        out.retain(|comment| mark(comment) != Some(true));
    }
    out
}

/// The layout of the rows of scenes with the same properties.
struct RowLayout {
    row_bytes: usize,
    /// Number of floats of a normal; 0 if normals are left out.
    normal: usize,
    /// The offset that is added to positions, which are then doubles.
    offset: Option<Offset>,
}

impl RowLayout {
    fn new(splats: &Splats, normal: &[&str]) -> Self {
        let extras: usize = splats.geometry.extras.iter().map(|e| e.values.width()).sum();
        let floats = FIXED_FLOATS + normal.len() + splats.degree.rest();
        let offset = splats.meta.offset;
        let more = if offset.is_some() { POSITION.len() * (size_of::<f64>() - size_of::<f32>()) } else { 0 };
        Self { row_bytes: floats * size_of::<f32>() + more + extras, normal: normal.len(), offset }
    }

    /// Writes `splats` to `writer`. `block` is working memory.
    fn write(&self, splats: &Splats, block: &mut [u8], writer: &mut dyn Write) -> io::Result<()> {
        for start in (0..splats.len()).step_by(BLOCK_ROWS) {
            let rows = &mut block[..self.row_bytes * BLOCK_ROWS.min(splats.len() - start)];
            for_each_chunk_mut(rows, self.row_bytes * ROWS_PER_TASK, |chunk, rows| {
                self.pack(splats, start + chunk * ROWS_PER_TASK, rows);
            });
            writer.write_all(rows)?;
        }
        Ok(())
    }

    /// Writes the Gaussians from `start` on into `rows`.
    fn pack(&self, splats: &Splats, start: usize, rows: &mut [u8]) {
        let count = rows.len() / self.row_bytes;
        let range = start..start + count;
        let geometry = &splats.geometry;
        let no_normals = vec![0.0; if geometry.normals.is_empty() { self.normal * count } else { 0 }];
        let [positions, dc, opacities, scales, rotations, normals] = geometry.floats();
        let mut groups = [
            (positions, POSITION.len()),
            (normals, self.normal),
            (dc, DC.len()),
            (&splats.sh_rest, splats.degree.rest()),
            (opacities, OPACITY.len()),
            (scales, SCALE.len()),
            (rotations, ROTATION.len()),
        ];
        let mut offset = 0;
        if let Some(by) = self.offset {
            for (row, position) in
                rows.chunks_exact_mut(self.row_bytes).zip(&geometry.positions[range.clone()])
            {
                let coordinates = row.chunks_exact_mut(size_of::<f64>()).zip(position.iter().zip(by.get()));
                coordinates.for_each(|(to, (v, by))| to.copy_from_slice(&(f64::from(*v) + by).to_le_bytes()));
            }
            (groups[0].1, offset) = (0, POSITION.len() * size_of::<f64>());
        }
        for (values, width) in groups.into_iter().filter(|group| group.1 > 0) {
            let field = offset..offset + width * size_of::<f32>();
            let values = values.get(range.start * width..range.end * width).unwrap_or(&no_normals);
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
