//! The tiles of a picture, and rectangles of them.

use crate::conventions::TILE;

/// The tiles of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub(super) columns: usize,
    pub(super) rows: usize,
    size: [usize; 2],
}

/// Tiles from `min` to before `max`, as (column, row).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Rect {
    pub(super) min: [u16; 2],
    pub(super) max: [u16; 2],
}

impl Rect {
    /// The first tile, and the first after the last, as (column, row).
    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn corners(self) -> [[u16; 2]; 2] {
        [self.min, self.max]
    }

    /// Returns the tiles that both cover; `None` if there are none.
    pub(super) fn intersect(self, other: Self) -> Option<Self> {
        let min: [u16; 2] = std::array::from_fn(|k| self.min[k].max(other.min[k]));
        let max: [u16; 2] = std::array::from_fn(|k| self.max[k].min(other.max[k]));
        (min[0] < max[0] && min[1] < max[1]).then_some(Self { min, max })
    }
}

/// Returns `value` as an integer within `0..=most`, truncated toward zero as C does. `most` is at most
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
    /// The tiles of a picture whose sides are at most [`crate::MAX_SIDE`].
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { columns: width.div_ceil(TILE), rows: height.div_ceil(TILE), size: [width, height] }
    }

    /// Returns the tiles that the square of `radius` around `centre` overlaps, as INRIA's `getRect` does. `radius`
    /// is a whole number.
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

    /// Pixel columns and rows within `rect` and `extent` of `centre`, or one more on either side.
    pub(super) fn pixels(self, rect: Rect, centre: [f32; 2], extent: [f64; 2]) -> Option<[[u16; 2]; 2]> {
        let tile = u16::try_from(TILE).unwrap_or(u16::MAX);
        let pixels = [0, 1].map(|k| {
            let centre = f64::from(centre[k]);
            let first = truncated((centre - extent[k]).floor(), self.size[k]);
            let end = truncated((centre + extent[k]).ceil() + 1.0, self.size[k]);
            [first.max(rect.min[k].saturating_mul(tile)), end.min(rect.max[k].saturating_mul(tile))]
        });
        pixels.iter().all(|[first, end]| first < end).then_some(pixels)
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
}
