//! Fills arrays from rows, in parallel, and finds values that are not finite.

use std::ops::Range;

use super::columns::{Packed, any_not_finite, read_column};
use super::layout::{Layout, rest_name};
use super::names::{DC, NORMAL, OPACITY, POSITION, ROTATION, SCALE};
use super::rows::{ROWS_PER_TASK, Rows};
use super::scalar::{Scalar, with_scalar};
use crate::scene::splats::{Extra, Geometry, SceneMeta, Splats, for_extra};
use crate::support::error::{Error, Result};
use crate::support::parallel::map_vec;

/// Replaces an infinite opacity, which keeps its sign. Opacities are stored before the sigmoid; in f32 the sigmoid of
/// this value is 1 and that of its negative is 0, to the last bit. Decoders of 8-bit opacities (SPZ, compressed.ply)
/// write infinities for 255 and 0.
pub(super) const SURE_OPACITY: f32 = 100.0;

/// A scene of this layout without Gaussians.
pub(super) fn empty(layout: &Layout) -> Splats {
    let extras = layout.extras.iter().map(|(name, field)| Extra {
        name: name.clone(),
        values: with_scalar!(field.ty, T => T::no_values()),
    });
    let geometry = Geometry { extras: extras.collect(), ..Geometry::default() };
    Splats { geometry, degree: layout.degree, sh_rest: Vec::new(), meta: SceneMeta::default() }
}

/// Resizes all arrays but the normals to `count` Gaussians. Their contents have no meaning afterwards.
///
/// The caller has checked that the file holds `count` rows, and every property takes at least a byte of a row. The
/// arrays therefore take at most four times the bytes of the file.
fn resize(file: &str, layout: &Layout, count: usize, splats: &mut Splats) -> Result<()> {
    /// New memory comes zeroed from the system. The threads that fill it are the first to touch it.
    fn sized<T: Copy>(values: &mut Vec<T>, len: usize, zero: T) {
        if values.is_empty() {
            *values = vec![zero; len];
        } else {
            values.resize(len, zero);
        }
    }
    let rest = layout.degree.rest();
    // 14 floats, 3 for normals, and at most 8 bytes for an extra. Only 32-bit systems can fail here.
    let row = (17 + rest) * size_of::<f32>() + layout.extras.len() * size_of::<f64>();
    if count.checked_mul(row).is_none_or(|bytes| isize::try_from(bytes).is_err()) {
        return Err(Error::malformed(file, format!("{count} vertices do not fit in memory")));
    }
    let g = &mut splats.geometry;
    sized(&mut g.positions, count, [0.0; 3]);
    g.normals.clear();
    sized(&mut g.dc, count, [0.0; 3]);
    sized(&mut g.opacities, count, 0.0);
    sized(&mut g.scales, count, [0.0; 3]);
    sized(&mut g.rotations, count, [0.0; 4]);
    for extra in &mut g.extras {
        for_extra!(&mut extra.values, values => sized(values, count, Default::default()));
    }
    sized(&mut splats.sh_rest, rest * count, 0.0);
    Ok(())
}

/// Gaussians of one chunk that hold NaN or infinite values.
#[derive(Debug)]
pub(super) struct Bad {
    /// Their rows in the file, ascending; at least one.
    pub(super) rows: Vec<usize>,
    /// The first such property of the first one, in INRIA's order.
    pub(super) property: String,
}

/// Fills one extra for one chunk of rows.
type ExtraFill<'a> = Box<dyn FnMut(Packed<'_>) + Send + 'a>;

/// One chunk of rows and the parts of the arrays that it fills.
struct Piece<'a> {
    rows: Range<usize>,
    positions: &'a mut [f32],
    dc: &'a mut [f32],
    rest: &'a mut [f32],
    opacities: &'a mut [f32],
    scales: &'a mut [f32],
    rotations: &'a mut [f32],
    extras: Vec<ExtraFill<'a>>,
}

/// What [`fill_piece`] found.
struct Found {
    bad: Option<Bad>,
    normals: bool,
    /// Number of infinite opacities.
    sure: usize,
}

/// What [`fill`] found.
#[derive(Debug, Default)]
pub(super) struct Filled {
    /// Chunks with values that are not finite, in order.
    pub(super) bad: Vec<Bad>,
    /// Whether any Gaussian whose values are all finite has a normal.
    pub(super) normals: bool,
    /// Number of infinite opacities.
    pub(super) sure: usize,
}

/// Fills all arrays of `splats` but the normals with rows `range`. `splats` came from [`empty`] and may have been
/// filled before.
pub(super) fn fill(
    rows: &Rows<'_>,
    layout: &Layout,
    file: &str,
    range: Range<usize>,
    splats: &mut Splats,
) -> Result<Filled> {
    resize(file, layout, range.len(), splats)?;
    let mut filled = Filled::default();
    for found in map_vec(pieces(splats, layout, range.start), |piece| fill_piece(rows, layout, piece)) {
        let found = found?;
        filled.bad.extend(found.bad);
        filled.normals |= found.normals;
        filled.sure += found.sure;
    }
    Ok(filled)
}

/// Fills the normals. Few files have any, so they get a second pass, and scenes without normals need no array.
pub(super) fn fill_normals(
    rows: &Rows<'_>,
    layout: &Layout,
    range: Range<usize>,
    splats: &mut Splats,
) -> Result<()> {
    let Some(group) = &layout.normal else { return Ok(()) };
    splats.geometry.normals = vec![[0.0; 3]; range.len()];
    let parts = splats.geometry.normals.chunks_mut(ROWS_PER_TASK).enumerate().collect();
    let done = map_vec(parts, |(c, part): (usize, &mut [[f32; 3]])| {
        let start = range.start + c * ROWS_PER_TASK;
        let (bytes, big) = rows.packed(start..start + part.len())?;
        group.read(Packed { bytes: &bytes, row_bytes: layout.row_bytes, big }, part.as_flattened_mut());
        Ok(())
    });
    done.into_iter().collect()
}

/// Cuts the arrays of `splats`, whose first Gaussian is row `first`, into chunks of rows.
fn pieces<'a>(splats: &'a mut Splats, layout: &'a Layout, first: usize) -> Vec<Piece<'a>> {
    fn take<'a, T>(left: &mut &'a mut [T], len: usize) -> &'a mut [T] {
        let (head, tail) = std::mem::take(left).split_at_mut(len);
        *left = tail;
        head
    }
    let count = splats.len();
    let dim = splats.degree.rest();
    let geometry = &mut splats.geometry;
    let mut positions = geometry.positions.as_flattened_mut();
    let mut dc = geometry.dc.as_flattened_mut();
    let mut rest = splats.sh_rest.as_mut_slice();
    let mut opacities = geometry.opacities.as_mut_slice();
    let mut scales = geometry.scales.as_flattened_mut();
    let mut rotations = geometry.rotations.as_flattened_mut();
    let mut pieces: Vec<Piece<'a>> = Vec::with_capacity(count.div_ceil(ROWS_PER_TASK));
    for start in (0..count).step_by(ROWS_PER_TASK) {
        let n = ROWS_PER_TASK.min(count - start);
        pieces.push(Piece {
            rows: first + start..first + start + n,
            positions: take(&mut positions, 3 * n),
            dc: take(&mut dc, 3 * n),
            rest: take(&mut rest, dim * n),
            opacities: take(&mut opacities, n),
            scales: take(&mut scales, 3 * n),
            rotations: take(&mut rotations, 4 * n),
            extras: Vec::with_capacity(layout.extras.len()),
        });
    }
    for (extra, (_, field)) in geometry.extras.iter_mut().zip(&layout.extras) {
        let offset = field.offset;
        for_extra!(&mut extra.values, values => {
            for (piece, part) in pieces.iter_mut().zip(values.chunks_mut(ROWS_PER_TASK)) {
                piece.extras.push(Box::new(move |rows| read_column(rows, offset, part)));
            }
        });
    }
    pieces
}

fn fill_piece(rows: &Rows<'_>, layout: &Layout, mut piece: Piece<'_>) -> Result<Found> {
    let (bytes, big) = rows.packed(piece.rows.clone())?;
    let packed = Packed { bytes: &bytes, row_bytes: layout.row_bytes, big };
    layout.position.read(packed, piece.positions);
    layout.dc.read(packed, piece.dc);
    layout.rest.read(packed, piece.rest);
    layout.opacity.read(packed, piece.opacities);
    let mut sure = 0;
    for opacity in piece.opacities.iter_mut().filter(|v| v.is_infinite()) {
        *opacity = SURE_OPACITY.copysign(*opacity);
        sure += 1;
    }
    layout.scale.read(packed, piece.scales);
    layout.rotation.read(packed, piece.rotations);
    piece.extras.iter_mut().for_each(|fill| fill(packed));
    let mut normals = Vec::new();
    if let Some(group) = &layout.normal {
        normals.resize(group.width() * piece.rows.len(), 0.0);
        group.read(packed, &mut normals);
    }
    let bad = bad_rows(&piece, &normals);
    // A negative zero counts as a normal, because a value must keep all its bits.
    let any_bits = |values: &[f32]| values.iter().fold(0, |any, v| any | v.to_bits()) != 0;
    let any_normal = match &bad {
        None => any_bits(&normals),
        Some(bad) => normals
            .chunks_exact(NORMAL.len())
            .zip(piece.rows.clone())
            .any(|(normal, row)| any_bits(normal) && bad.rows.binary_search(&row).is_err()),
    };
    Ok(Found { bad, normals: any_normal, sure })
}

/// Finds the Gaussians of `piece` with NaN or infinite values.
fn bad_rows(piece: &Piece<'_>, normals: &[f32]) -> Option<Bad> {
    let count = piece.rows.len();
    let groups: [&[f32]; 7] =
        [piece.positions, normals, piece.dc, piece.rest, piece.opacities, piece.scales, piece.rotations];
    if !groups.iter().any(|values| any_not_finite(values)) {
        return None;
    }
    let rest_names: Vec<String> = (0..piece.rest.len() / count).map(rest_name).collect();
    let rest_names: Vec<&str> = rest_names.iter().map(String::as_str).collect();
    let names: [&[&str]; 7] = [&POSITION, &NORMAL, &DC, &rest_names, &OPACITY, &SCALE, &ROTATION];
    let first_bad = |row: usize| {
        groups.iter().zip(names).find_map(|(values, names)| {
            let width = values.len() / count;
            let values = &values[row * width..(row + 1) * width];
            values.iter().zip(names).find(|(v, _)| !v.is_finite()).map(|(_, &name)| name)
        })
    };
    let rows: Vec<usize> = (0..count).filter(|&row| first_bad(row).is_some()).collect();
    let property = rows.first().and_then(|&row| first_bad(row)).unwrap_or_default().to_owned();
    Some(Bad { rows: rows.into_iter().map(|row| piece.rows.start + row).collect(), property })
}
