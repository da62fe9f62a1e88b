//! Which splats may touch which tile.

use std::ops::Range;

use crate::conventions::TILE;
use crate::parallel::*;

use super::project::Visible;

/// Pieces the sorted splats are cut into, each listed by one task; a tile's list is theirs in order.
const PIECES: usize = 8;
/// Most list entries in memory at once, unless one row of tiles needs more: 16 MB.
pub(super) const MAX_ENTRIES: u64 = 1 << 22;

/// The tiles of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    height: usize,
}

/// Tiles from `min` to before `max`, as (column, row).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Rect {
    min: [u16; 2],
    max: [u16; 2],
}

impl Rect {
    /// First and end, as (column, row).
    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn corners(self) -> [[u16; 2]; 2] {
        [self.min, self.max]
    }

    /// What both cover, if anything.
    pub(super) fn intersect(self, other: Self) -> Option<Self> {
        let min: [u16; 2] = std::array::from_fn(|k| self.min[k].max(other.min[k]));
        let max: [u16; 2] = std::array::from_fn(|k| self.max[k].min(other.max[k]));
        (min[0] < max[0] && min[1] < max[1]).then_some(Self { min, max })
    }
}

/// `value` as an integer within `0..=most`, truncated toward zero as C does. `most` is at most
/// [`crate::MAX_SIDE`].
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "saturates, then clamped"
)]
fn truncated(value: impl Into<f64>, most: usize) -> u16 {
    (value.into() as i32).clamp(0, most as i32) as u16
}

#[expect(clippy::cast_precision_loss, reason = "16")]
const TILE_F32: f32 = TILE as f32;
#[expect(clippy::cast_precision_loss, reason = "16")]
const TILE_F64: f64 = TILE as f64;

impl Grid {
    /// Sides are at most [`crate::MAX_SIDE`].
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { columns: width.div_ceil(TILE), rows: height.div_ceil(TILE), height }
    }

    /// INRIA's `getRect`: tiles the square of `radius`, a whole number, around `centre` overlaps.
    pub(super) fn rect(self, centre: [f32; 2], radius: f32) -> Option<Rect> {
        let most = [self.columns, self.rows];
        let min = std::array::from_fn(|k| truncated((centre[k] - radius) / TILE_F32, most[k]));
        let max =
            std::array::from_fn(|k| truncated((centre[k] + radius + (TILE_F32 - 1.0)) / TILE_F32, most[k]));
        Rect { min, max }.intersect(Rect { min, max })
    }

    /// Tiles with a pixel centre within `extent` of `centre`, or a few more; may be empty.
    pub(super) fn touched(self, centre: [f32; 2], extent: [f64; 2]) -> Rect {
        let most = [self.columns, self.rows];
        let min = std::array::from_fn(|k| {
            truncated((f64::from(centre[k]) - extent[k]).floor() / TILE_F64, most[k])
        });
        let max = std::array::from_fn(|k| {
            let end = (f64::from(centre[k]) + extent[k]).ceil();
            if end < 0.0 { 0 } else { truncated(end / TILE_F64 + 1.0, most[k]) }
        });
        Rect { min, max }
    }

    /// Pixel rows within `rect` and `extent` of `centre`, or one more on either side.
    pub(super) fn rows(self, rect: Rect, centre: f32, extent: f64) -> Option<[u16; 2]> {
        let tile = u16::try_from(TILE).unwrap_or(u16::MAX);
        let centre = f64::from(centre);
        let first = truncated((centre - extent).floor(), self.height).max(rect.min[1].saturating_mul(tile));
        let end =
            truncated((centre + extent).ceil() + 1.0, self.height).min(rect.max[1].saturating_mul(tile));
        (first < end).then_some([first, end])
    }
}

/// Rows of tiles cut into bands whose lists have at most `max_entries`, or of one row.
pub(super) fn bands(splats: &[Visible], grid: Grid, max_entries: u64) -> Vec<Range<usize>> {
    // Differences of the number of entries from one row of tiles to the next.
    let mut steps = vec![0_i64; grid.rows + 1];
    for Visible { rect, .. } in splats {
        let columns = i64::from(rect.max[0] - rect.min[0]);
        steps[usize::from(rect.min[1])] += columns;
        steps[usize::from(rect.max[1])] -= columns;
    }
    let mut bands = Vec::new();
    let (mut start, mut in_row, mut in_band) = (0, 0_i64, 0_u64);
    for (row, step) in steps.iter().take(grid.rows).enumerate() {
        in_row += step;
        let entries = in_row.unsigned_abs();
        if row > start && in_band + entries > max_entries {
            bands.push(start..row);
            (start, in_band) = (row, 0);
        }
        in_band += entries;
    }
    if start < grid.rows {
        bands.push(start..grid.rows);
    }
    bands
}

/// For each tile of a band the splats that may touch it, in order.
#[derive(Debug)]
pub(super) struct TileLists {
    pieces: Vec<Piece>,
}

/// The lists as far as one piece of the splats goes: tile `t`'s is `entries[starts[t]..starts[t + 1]]`.
#[derive(Debug)]
struct Piece {
    starts: Vec<usize>,
    entries: Vec<u32>,
}

impl TileLists {
    /// Lists the splats over the rows of tiles in `band`.
    pub(super) fn new(splats: &[Visible], grid: Grid, band: Range<usize>) -> Self {
        let size = splats.len().div_ceil(PIECES).max(1);
        let pieces = splats
            .par_chunks(size)
            .enumerate()
            .map(|(piece, splats)| Piece::new(splats, piece * size, grid, &band))
            .collect();
        Self { pieces }
    }

    /// The list of tile `tile` of the band, counted row by row.
    pub(super) fn of(&self, tile: usize) -> impl Iterator<Item = u32> {
        self.pieces.iter().flat_map(move |p| &p.entries[p.starts[tile]..p.starts[tile + 1]]).copied()
    }
}

impl Piece {
    fn new(splats: &[Visible], first: usize, grid: Grid, band: &Range<usize>) -> Self {
        let tiles = |rect: &Rect| {
            let [left, right] = [usize::from(rect.min[0]), usize::from(rect.max[0])];
            let top = usize::from(rect.min[1]).max(band.start) - band.start;
            let bottom = usize::from(rect.max[1]).min(band.end).saturating_sub(band.start);
            let columns = grid.columns;
            (top..bottom).flat_map(move |row| row * columns + left..row * columns + right)
        };
        // Counts are gathered two places up, so that after the sums `starts[t + 1]` is where tile t's
        // list begins, and after filling where it ends.
        let mut starts = vec![0_usize; band.len() * grid.columns + 2];
        for Visible { rect, .. } in splats {
            tiles(rect).for_each(|tile| starts[tile + 2] += 1);
        }
        for tile in 2..starts.len() {
            starts[tile] += starts[tile - 1];
        }
        let total = starts.last().copied().unwrap_or(0);
        let mut entries = vec![0; total];
        for (Visible { rect, .. }, splat) in splats.iter().zip(first..) {
            // Splats are counted in u32 since `order`.
            let splat = u32::try_from(splat).unwrap_or(u32::MAX);
            for tile in tiles(rect) {
                let at = &mut starts[tile + 1];
                entries[*at] = splat;
                *at += 1;
            }
        }
        Self { starts, entries }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rects_are_truncated_and_clamped_as_in_c() {
        let grid = Grid::new(400, 266);
        assert_eq!((grid.columns, grid.rows), (25, 17));
        let rect = |x: f32, y: f32, r: f32| grid.rect([x, y], r).map(|r| (r.min, r.max));
        assert_eq!(rect(20.0, 20.0, 3.0), Some(([1, 1], [2, 2])));
        // (15.5 - 3) / 16 truncates to 0 and (15.5 + 3 + 15) / 16 to 2.
        assert_eq!(rect(15.5, 20.0, 3.0), Some(([0, 1], [2, 2])));
        // Toward zero: int(-0.8) is 0, and (-10 + 3 + 15) / 16 is 0 as well.
        assert_eq!(rect(-10.0, 20.0, 3.0), None);
        assert_eq!(rect(-3.0, 20.0, 5.0), Some(([0, 0], [1, 2])));
        assert_eq!(rect(200.0, 100.0, 1e30), Some(([0, 0], [25, 17])));
        assert_eq!(rect(1e30, 100.0, 3.0), None);
    }

    #[test]
    fn lists_hold_every_splat_of_every_tile_in_order() {
        let grid = Grid::new(100, 70);
        let splats: Vec<Visible> = (0_u8..60)
            .filter_map(|i| {
                let i = f32::from(i);
                let rect = grid.rect([i * 37.0 % 120.0 - 10.0, i * 23.0 % 90.0 - 10.0], 1.0 + i % 30.0)?;
                Some(Visible { rect, ..Visible::default() })
            })
            .collect();
        for band in [0..grid.rows, 1..3] {
            let lists = TileLists::new(&splats, grid, band.clone());
            for row in band.clone() {
                for column in 0..grid.columns {
                    let inside = |r: &Rect| {
                        (usize::from(r.min[0])..usize::from(r.max[0])).contains(&column)
                            && (usize::from(r.min[1])..usize::from(r.max[1])).contains(&row)
                    };
                    let expected: Vec<u32> =
                        (0..).zip(&splats).filter(|(_, v)| inside(&v.rect)).map(|(i, _)| i).collect();
                    let found: Vec<u32> = lists.of((row - band.start) * grid.columns + column).collect();
                    assert_eq!(found, expected, "tile {column}, {row}");
                }
            }
        }
    }

    #[test]
    fn bands_cover_all_rows_and_stay_small() {
        let grid = Grid::new(16_384, 16_384);
        let everywhere = Rect { min: [0, 0], max: [1024, 1024] };
        let bands = bands(&[Visible { rect: everywhere, ..Visible::default() }; 1000], grid, 1 << 26);
        assert_eq!(bands.first().map(|b| b.start), Some(0));
        assert_eq!(bands.last().map(|b| b.end), Some(1024));
        assert!(bands.windows(2).all(|w| w[0].end == w[1].start));
        assert!(bands.iter().all(|b| b.len() * 1024 * 1000 <= 1 << 26));
    }
}
