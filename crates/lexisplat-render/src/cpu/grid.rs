//! The tiles of a picture.

use std::ops::Range;

use crate::conventions::TILE;
use crate::tile_set::TileSet;

use super::splat::PixelRect;

#[expect(clippy::cast_precision_loss, reason = "16")]
pub(super) const TILE_F32: f32 = TILE as f32;

/// The tiles of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Number of columns and of rows.
    counts: [f32; 2],
}

impl Grid {
    /// Returns the tiles of a picture whose sides are at most [`crate::MAX_SIDE`].
    pub(super) fn new(width: usize, height: usize) -> Self {
        let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
        #[expect(clippy::cast_precision_loss, reason = "at most 1024")]
        let counts = [columns as f32, rows as f32];
        Self { columns, rows, counts }
    }

    /// Returns the column (`axis` 0) or row (`axis` 1) of tiles at `place`, in tiles. The value is truncated toward zero,
    /// as in C, and then clamped to the grid or one beyond.
    #[inline(always)]
    pub(super) fn tile(&self, axis: usize, place: f32) -> f32 {
        let place = if place > 0.0 { place } else { 0.0 };
        (if place < self.counts[axis] { place } else { self.counts[axis] }).floor()
    }
}

/// The tiles of a picture that are drawn.
#[derive(Debug, Clone)]
pub(super) struct ChosenTiles {
    /// Whether each tile is drawn, row by row.
    wanted: Vec<bool>,
    /// Columns and rows of tiles that contain all drawn tiles.
    bounds: [Range<usize>; 2],
    columns: usize,
}

impl ChosenTiles {
    pub(super) fn new(grid: Grid, set: &TileSet) -> Self {
        let mut wanted = vec![false; grid.columns * grid.rows];
        let (mut first, mut end) = ([usize::MAX; 2], [0; 2]);
        for tile in set.tiles().iter().map(|&tile| tile as usize) {
            wanted[tile] = true;
            for (k, at) in [tile % grid.columns, tile / grid.columns].into_iter().enumerate() {
                first[k] = first[k].min(at);
                end[k] = end[k].max(at + 1);
            }
        }
        let bounds = [0, 1].map(|k| first[k]..end[k]);
        Self { wanted, bounds, columns: grid.columns }
    }

    /// Returns whether tile number `tile` of the picture is drawn.
    #[inline(always)]
    pub(super) fn wants(&self, tile: usize) -> bool {
        self.wanted[tile]
    }

    /// Returns the part of `rect` in the columns and rows that contain all drawn tiles; `None` if no drawn tile is in
    /// `rect`.
    #[inline(always)]
    pub(super) fn within(&self, rect: PixelRect) -> Option<PixelRect> {
        let [columns, rows] = [rect.columns(), rect.rows()];
        let [left, top] = [columns.start.max(self.bounds[0].start), rows.start.max(self.bounds[1].start)];
        let [right, bottom] = [columns.end.min(self.bounds[0].end), rows.end.min(self.bounds[1].end)];
        let row = |row: usize| &self.wanted[row * self.columns + left..row * self.columns + right];
        let any = left < right && (top..bottom).any(|r| row(r).contains(&true));
        // The number of pixels of a side fits in 16 bits.
        let pixel = |tile: usize| u16::try_from(tile * TILE).unwrap_or(u16::MAX);
        any.then(|| PixelRect {
            min: [rect.min[0].max(pixel(left)), rect.min[1].max(pixel(top))],
            max: [rect.max[0].min(pixel(right)), rect.max[1].min(pixel(bottom))],
        })
    }
}

impl PixelRect {
    /// Returns the columns of tiles that the rectangle overlaps.
    #[inline(always)]
    pub(super) fn columns(self) -> Range<usize> {
        usize::from(self.min[0]) / TILE..usize::from(self.max[0]).div_ceil(TILE)
    }

    /// Returns the rows of tiles that the rectangle overlaps.
    #[inline(always)]
    pub(super) fn rows(self) -> Range<usize> {
        usize::from(self.min[1]) / TILE..usize::from(self.max[1]).div_ceil(TILE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_are_truncated_and_clamped_as_in_c() {
        let grid = Grid::new(400, 266);
        assert_eq!((grid.columns, grid.rows), (25, 17));
        let places =
            [(-1e30, 0.0), (-0.8, 0.0), (0.0, 0.0), (0.99, 0.0), (1.0, 1.0), (16.5, 16.0), (f32::NAN, 0.0)];
        for (place, tile) in places {
            assert_eq!([grid.tile(0, place), grid.tile(1, place)], [tile; 2], "{place}");
        }
        assert_eq!([grid.tile(0, 1e30), grid.tile(1, f32::INFINITY)], [25.0, 17.0]);
    }

    #[test]
    fn pixels_lie_in_tiles() {
        let rect = PixelRect { min: [15, 16], max: [17, 32] };
        assert_eq!((rect.columns(), rect.rows()), (0..2, 1..2));
    }
}
