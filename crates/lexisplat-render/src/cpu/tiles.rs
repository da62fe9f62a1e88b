//! Lists for every tile the splats that may touch it.

use std::ops::Range;

use crate::parallel::*;

use super::grid::{Grid, Rect};
use super::project::Visible;

/// Pieces that the sorted splats are cut into. One task lists each piece, and a tile's list is those of the pieces
/// in order.
const PIECES: usize = 8;
/// Most list entries in memory at once, unless one row of tiles has more: 16 MB.
pub(super) const MAX_ENTRIES: u64 = 1 << 22;

/// Cuts the rows of tiles into bands. The lists of a band have at most `max_entries` entries, unless it is one
/// row.
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

/// For each tile of a band, the splats that may touch it, in order.
#[derive(Debug)]
pub(super) struct TileLists {
    pieces: Vec<Piece>,
}

/// The lists of one piece of the splats. That of tile `t` is `entries[starts[t]..starts[t + 1]]`.
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

    /// Returns the list of tile `tile` of the band. Tiles are counted row by row.
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
        // Tile t is counted at `t + 2`. After the sums its list begins at `starts[t + 1]`, and filling the list
        // moves that to its end.
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
