//! Filling of arrays from rows, in parallel. It finds values that are not finite.

use std::ops::Range;

use super::columns::{Packed, ROWS_PER_TASK, any_not_finite, read_column};
use super::file::PlyFile;
use super::found::Found;
use super::layout::{GROUPS, Layout, NORMALS, OPACITIES, POSITIONS, REST, SCALES, rest_name};
use super::names::{DC, NORMAL, OPACITY, POSITION, ROTATION, SCALE};
use super::position_facts::PositionFacts;
use crate::scene::extra::{Extra, for_extra, with_scalar};
use crate::scene::offset::single;
use crate::scene::rounding;
use crate::scene::splats::{FLAT_SCALE, Geometry, SURE_OPACITY, SceneMeta, Splats, flatten_scales};
use crate::support::error::{Error, Result};
use crate::support::parallel::map_vec;
use crate::support::progress::Progress;

/// Returns a scene of this layout without Gaussians.
pub(super) fn empty(layout: &Layout) -> Splats {
    let extras = layout.extras.iter().map(|(name, field)| Extra {
        name: name.clone(),
        values: with_scalar!(field.ty, T => Vec::<T>::new().into()),
    });
    let geometry = Geometry { extras: extras.collect(), ..Geometry::default() };
    Splats { geometry, degree: layout.degree, sh_rest: Vec::new(), meta: SceneMeta::default() }
}

/// Resizes all arrays but the normals to `count` Gaussians. Their contents have no meaning afterwards.
///
/// The caller has checked that the file holds `count` rows. Every property takes at least a byte of a row, so the arrays
/// take at most four times the bytes of the file.
fn resize(file: &str, layout: &Layout, count: usize, splats: &mut Splats) -> Result<()> {
    /// New memory is zeroed by the system. The threads that fill it are the first to touch it.
    fn sized<T: Copy>(values: &mut Vec<T>, len: usize, zero: T) {
        if values.is_empty() {
            *values = vec![zero; len];
        } else {
            values.resize(len, zero);
        }
    }
    let rest = layout.degree.rest();
    // A Gaussian has 14 floats, 3 more for normals, and at most 8 bytes for an extra. Only 32-bit systems can fail here.
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

/// A function that fills one extra for one chunk of rows.
type ExtraFill<'a> = Box<dyn FnMut(Packed<'_>) + Send + 'a>;

/// One chunk of rows, and the slices of the arrays that it fills.
struct Piece<'a> {
    rows: Range<usize>,
    /// Slices of the arrays of floats, in the order of [`Layout::groups`]. The slice of the normals is empty.
    floats: [&'a mut [f32]; GROUPS],
    extras: Vec<ExtraFill<'a>>,
}

impl PlyFile<'_> {
    /// Fills all arrays of `splats` but the normals with rows `range`. `splats` must come from [`empty`] and may have
    /// been filled before. Advances `progress` by the bytes of the rows.
    pub(super) fn fill(
        &self,
        range: Range<usize>,
        splats: &mut Splats,
        progress: &dyn Progress,
    ) -> Result<Found> {
        resize(self.name, &self.layout, range.len(), splats)?;
        let mut found = Found::default();
        let tasks = map_vec(pieces(splats, &self.layout, range.start), |piece| {
            progress.check()?;
            progress.advance(piece.rows.len() as u64 * self.layout.row_bytes as u64);
            self.fill_piece(piece)
        });
        for task in tasks {
            found.add(task?);
        }
        Ok(found)
    }

    /// Fills the normals. Few files have any, so they are read in a second pass, and most scenes need no array for them.
    pub(super) fn fill_normals(&self, range: Range<usize>, splats: &mut Splats) -> Result<()> {
        let width = self.layout.groups[NORMALS].width;
        if width == 0 {
            return Ok(());
        }
        splats.geometry.normals = vec![[0.0; 3]; range.len()];
        let slices = splats.geometry.normals.chunks_mut(ROWS_PER_TASK).enumerate().collect();
        let done = map_vec(slices, |(c, slice): (usize, &mut [[f32; 3]])| {
            let start = range.start + c * ROWS_PER_TASK;
            let (bytes, big) = self.rows.packed(start..start + slice.len())?;
            let packed = Packed { bytes: &bytes, row_bytes: self.layout.row_bytes, big };
            self.layout.groups[NORMALS].read(packed, slice.as_flattened_mut());
            Ok(())
        });
        done.into_iter().collect()
    }

    /// Fills the positions again, after the offset was decided.
    pub(super) fn fill_positions(&self, range: Range<usize>, splats: &mut Splats) -> Result<()> {
        let slices = splats.geometry.positions.chunks_mut(ROWS_PER_TASK).enumerate().collect();
        let done = map_vec(slices, |(c, slice): (usize, &mut [[f32; 3]])| {
            let start = range.start + c * ROWS_PER_TASK;
            let (bytes, big) = self.rows.packed(start..start + slice.len())?;
            let packed = Packed { bytes: &bytes, row_bytes: self.layout.row_bytes, big };
            self.positions(packed, slice.as_flattened_mut());
            Ok(())
        });
        done.into_iter().collect()
    }

    /// Fills `out` with positions minus the offset.
    fn positions(&self, rows: Packed<'_>, out: &mut [f32]) {
        let group = &self.layout.groups[POSITIONS];
        let Some(offset) = self.meta.offset else { return group.read(rows, out) };
        let mut exact = vec![0.0; out.len()];
        group.read_exact(rows, &mut exact);
        let offset = offset.get().into_iter().cycle();
        out.iter_mut().zip(exact).zip(offset).for_each(|((out, v), offset)| *out = single(v - offset));
    }

    fn fill_piece(&self, piece: Piece<'_>) -> Result<Found> {
        let Piece { rows, mut floats, mut extras } = piece;
        let (bytes, big) = self.rows.packed(rows.clone())?;
        let packed = Packed { bytes: &bytes, row_bytes: self.layout.row_bytes, big };
        let mut normals = vec![0.0; self.layout.groups[NORMALS].width * rows.len()];
        floats[NORMALS] = &mut normals;
        self.positions(packed, floats[POSITIONS]);
        for (group, values) in self.layout.groups.iter().zip(&mut floats).skip(POSITIONS + 1) {
            group.read(packed, values);
        }
        extras.iter_mut().for_each(|fill| fill(packed));
        let mut found = Found::default();
        for opacity in floats[OPACITIES].iter_mut().filter(|v| v.is_infinite()) {
            *opacity = SURE_OPACITY.copysign(*opacity);
            found.sure += 1;
        }
        let scales = floats[SCALES].as_chunks_mut().0;
        if self.layout.is_flat {
            scales.iter_mut().for_each(|row: &mut [f32; SCALE.len()]| row[SCALE.len() - 1] = FLAT_SCALE);
        }
        found.flat = flatten_scales(scales);
        let floats = floats.each_ref().map(|values| &**values);
        if floats.iter().any(|values| any_not_finite(values)) {
            (found.bad, found.bad_property) = bad_rows(&rows, floats);
        }
        if self.looks_at_positions {
            let mut exact = vec![0.0; floats[POSITIONS].len()];
            self.layout.groups[POSITIONS].read_exact(packed, &mut exact);
            let stride = rounding::sample(self.count);
            found.position_facts =
                PositionFacts::of(rows.clone(), stride, &found.bad, &exact, floats[SCALES]);
        }
        // A negative zero counts as a normal, because a value must keep all its bits.
        let any_bits = |values: &[f32]| values.iter().fold(0, |any, v| any | v.to_bits()) != 0;
        found.normals = if found.bad.is_empty() {
            any_bits(floats[NORMALS])
        } else {
            let mut normals = floats[NORMALS].chunks_exact(NORMAL.len()).zip(rows);
            normals.any(|(normal, row)| any_bits(normal) && found.bad.binary_search(&row).is_err())
        };
        Ok(found)
    }
}

/// Cuts the arrays of `splats`, whose first Gaussian is row `first`, into chunks of rows.
fn pieces<'a>(splats: &'a mut Splats, layout: &'a Layout, first: usize) -> Vec<Piece<'a>> {
    let count = splats.len();
    let geometry = &mut splats.geometry;
    let mut left = [
        geometry.positions.as_flattened_mut(),
        &mut [],
        geometry.dc.as_flattened_mut(),
        &mut splats.sh_rest,
        &mut geometry.opacities,
        geometry.scales.as_flattened_mut(),
        geometry.rotations.as_flattened_mut(),
    ];
    let mut pieces: Vec<Piece<'a>> = Vec::with_capacity(count.div_ceil(ROWS_PER_TASK));
    for start in (0..count).step_by(ROWS_PER_TASK) {
        let n = ROWS_PER_TASK.min(count - start);
        let floats =
            std::array::from_fn(|k| left[k].split_off_mut(..layout.groups[k].width * n).unwrap_or_default());
        let extras = Vec::with_capacity(layout.extras.len());
        pieces.push(Piece { rows: first + start..first + start + n, floats, extras });
    }
    for (extra, (_, field)) in geometry.extras.iter_mut().zip(&layout.extras) {
        let offset = field.offset;
        for_extra!(&mut extra.values, values => {
            for (piece, slice) in pieces.iter_mut().zip(values.chunks_mut(ROWS_PER_TASK)) {
                piece.extras.push(Box::new(move |rows| read_column(rows, offset, slice)));
            }
        });
    }
    pieces
}

/// Returns the rows among `rows` with NaN or infinite values, and the first such property. `floats` has the values of all
/// rows.
fn bad_rows(rows: &Range<usize>, floats: [&[f32]; GROUPS]) -> (Vec<usize>, Option<String>) {
    let count = rows.len();
    let rest_names: Vec<String> = (0..floats[REST].len() / count).map(rest_name).collect();
    let rest_names: Vec<&str> = rest_names.iter().map(String::as_str).collect();
    let names: [&[&str]; GROUPS] = [&POSITION, &NORMAL, &DC, &rest_names, &OPACITY, &SCALE, &ROTATION];
    let first_bad = |row: usize| {
        floats.iter().zip(names).find_map(|(values, names)| {
            let width = values.len() / count;
            let values = &values[row * width..(row + 1) * width];
            values.iter().zip(names).find(|(v, _)| !v.is_finite()).map(|(_, &name)| name)
        })
    };
    let bad: Vec<usize> = (0..count).filter(|&row| first_bad(row).is_some()).collect();
    let property = bad.first().and_then(|&row| first_bad(row)).map(str::to_owned);
    (bad.into_iter().map(|row| rows.start + row).collect(), property)
}
