//! Lists the splats that may touch each tile.

use std::ops::Range;

use crate::parallel::*;

use super::grid::{ChosenTiles, Grid};
use super::order::Order;
use super::splat::PixelRect;

/// Number of pieces of the sorted splats. Each piece is listed by one task, and the list of a tile consists of the lists
/// of the pieces in order.
const PIECES: usize = 8;
/// Largest number of list entries in memory at once, unless one row of tiles has more: 16 MB.
pub(super) const MAX_ENTRIES: u64 = 1 << 22;

/// Cuts the rows of tiles into bands. The lists of a band have at most `max_entries` entries, unless the band is a single
/// row.
pub(super) fn bands(order: &Order, grid: Grid, max_entries: u64) -> Vec<Range<usize>> {
    // Differences between the numbers of entries of consecutive rows of tiles.
    let mut steps = vec![0_i64; grid.rows + 1];
    for (_, rect) in order.splats(0..order.keys.len()) {
        // The number of columns is at most 1024.
        let columns = i64::try_from(rect.columns().len()).unwrap_or(i64::MAX);
        let rows = rect.rows();
        steps[rows.start] += columns;
        steps[rows.end] -= columns;
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

/// The splats that may touch each tile of a band, in order.
#[derive(Debug, Default)]
pub(super) struct TileLists {
    pieces: Vec<Piece>,
}

/// The lists of one piece of the splats. The list of tile `t` is `entries[starts[t]..starts[t + 1]]`.
#[derive(Debug, Default)]
struct Piece {
    starts: Vec<usize>,
    entries: Vec<u32>,
}

impl TileLists {
    /// Lists the splats for the rows of tiles in `band`, and overwrites the old lists. Lists of tiles that are not
    /// `chosen` are empty.
    pub(super) fn fill(
        &mut self,
        order: &Order,
        grid: Grid,
        chosen: Option<&ChosenTiles>,
        band: &Range<usize>,
    ) {
        let len = order.keys.len();
        let size = len.div_ceil(PIECES).max(1);
        self.pieces.resize_with(PIECES, Piece::default);
        self.pieces.par_chunks_mut(1).enumerate().for_each(|(k, piece)| {
            let range = (k * size).min(len)..((k + 1) * size).min(len);
            let first = band.start * grid.columns;
            for piece in piece {
                match chosen {
                    None => piece.fill(order, range.clone(), grid, band, |_| true),
                    Some(chosen) => {
                        piece.fill(order, range.clone(), grid, band, |tile| chosen.wants(first + tile));
                    }
                }
            }
        });
    }

    /// Returns the number of bytes in memory.
    pub(super) fn bytes(&self) -> u64 {
        let bytes = |p: &Piece| size_of_val(p.starts.as_slice()) + size_of_val(p.entries.as_slice());
        self.pieces.iter().map(bytes).sum::<usize>() as u64
    }

    /// Returns the number of splats in the list of tile `tile` of the band.
    pub(super) fn len(&self, tile: usize) -> usize {
        self.pieces.iter().map(|p| p.starts[tile + 1] - p.starts[tile]).sum()
    }

    /// Returns the list of tile `tile` of the band. Tiles are counted row by row.
    pub(super) fn of(&self, tile: usize) -> List<'_> {
        List { pieces: self.pieces.iter(), tile }
    }
}

/// The list of one tile: slots of splats, in pieces.
pub(super) struct List<'a> {
    pieces: std::slice::Iter<'a, Piece>,
    tile: usize,
}

impl<'a> Iterator for List<'a> {
    type Item = &'a [u32];

    fn next(&mut self) -> Option<&'a [u32]> {
        let piece = self.pieces.next()?;
        Some(&piece.entries[piece.starts[self.tile]..piece.starts[self.tile + 1]])
    }
}

impl Piece {
    /// Lists the splats in `range` for the tiles of the band that are `wanted`.
    fn fill(
        &mut self,
        order: &Order,
        range: Range<usize>,
        grid: Grid,
        band: &Range<usize>,
        wanted: impl Fn(usize) -> bool,
    ) {
        let wanted = &wanted;
        let tiles = |rect: PixelRect| {
            let (columns, rows) = (rect.columns(), rect.rows());
            let top = rows.start.max(band.start) - band.start;
            let bottom = rows.end.min(band.end).saturating_sub(band.start);
            (top..bottom)
                .flat_map(move |row| row * grid.columns + columns.start..row * grid.columns + columns.end)
                .filter(move |tile| wanted(*tile))
        };
        let Self { starts, entries } = self;
        // Tile t is counted at `t + 2`. After the prefix sums its list begins at `starts[t + 1]`. Filling the list moves
        // that number to the end of the list.
        starts.clear();
        starts.resize(band.len() * grid.columns + 2, 0);
        for (_, rect) in order.splats(range.clone()) {
            tiles(rect).for_each(|tile| starts[tile + 2] += 1);
        }
        for tile in 2..starts.len() {
            starts[tile] += starts[tile - 1];
        }
        let len = starts.last().copied().unwrap_or(0);
        // Views differ in the number of entries, and doubling would take too much memory.
        entries.reserve_exact(len.saturating_sub(entries.len()));
        entries.resize(len, 0);
        for (slot, rect) in order.splats(range) {
            for tile in tiles(rect) {
                let at = &mut starts[tile + 1];
                entries[*at] = slot;
                *at += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conventions::TILE;

    #[test]
    fn lists_hold_every_splat_of_every_tile_in_order() {
        let grid = Grid::new(100, 70);
        let rects: Vec<PixelRect> = (0_u16..60)
            .map(|i| {
                let (x, y, side) = (i * 37 % 90, i * 23 % 60, 1 + i % 30);
                PixelRect { min: [x, y], max: [(x + side).min(100), (y + side).min(70)] }
            })
            .collect();
        let order = Order::of((0..60).map(|slot| 100 - slot).collect(), &rects);
        let mut lists = TileLists::default();
        for band in [0..grid.rows, 1..3] {
            lists.fill(&order, grid, None, &band);
            for row in band.clone() {
                for column in 0..grid.columns {
                    let inside = |r: &PixelRect| {
                        let overlaps = |k: usize, tile: usize| {
                            usize::from(r.min[k]) < (tile + 1) * TILE && usize::from(r.max[k]) > tile * TILE
                        };
                        overlaps(0, column) && overlaps(1, row)
                    };
                    let expected: Vec<u32> =
                        (0..).zip(&rects).filter(|(_, r)| inside(r)).map(|(i, _)| 100 - i).collect();
                    let tile = (row - band.start) * grid.columns + column;
                    let found: Vec<u32> = lists.of(tile).flatten().copied().collect();
                    assert_eq!(found, expected, "tile {column}, {row}");
                }
            }
        }
    }

    #[test]
    fn bands_cover_all_rows_and_stay_small() {
        let grid = Grid::new(16_384, 16_384);
        let everywhere = PixelRect { min: [0, 0], max: [16_384; 2] };
        let bands = bands(&Order::of(vec![0; 1000], &[everywhere; 1000]), grid, 1 << 26);
        assert_eq!(bands.first().map(|b| b.start), Some(0));
        assert_eq!(bands.last().map(|b| b.end), Some(1024));
        assert!(bands.windows(2).all(|w| w[0].end == w[1].start));
        assert!(bands.iter().all(|b| b.len() * 1024 * 1000 <= 1 << 26));
    }
}
