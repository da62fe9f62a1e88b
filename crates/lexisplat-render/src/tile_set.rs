//! Some of the tiles of a picture.

use crate::conventions::TILE;
use crate::error::{Error, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::image::Image;

/// A selection of the tiles of a picture, in the order of rows and then of columns.
///
/// A camera with a tile set draws only these tiles, with the same bits as in the whole picture. The drawn picture is one
/// tile wide: the tiles lie below one another. Pixels beyond the border of the whole picture show the background.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TileSet {
    /// Sides of the whole picture, in pixels.
    size: [u32; 2],
    /// Numbers of the tiles in the whole picture, in ascending order.
    tiles: Vec<u32>,
    /// Number of pixels of the tiles within the picture.
    pixels: u64,
}

impl TileSet {
    /// Returns the tiles for which `wanted` is true at their (column, row), of a picture of `width` by `height` pixels.
    #[must_use]
    pub fn new(width: u32, height: u32, wanted: impl Fn(u32, u32) -> bool) -> Self {
        let side = |pixels: u32| pixels.div_ceil(TILE_U32);
        let (columns, rows) = (side(width), side(height));
        let inside = |k: u32, pixels: u32| u64::from((pixels - k * TILE_U32).min(TILE_U32));
        let (mut tiles, mut pixels) = (Vec::new(), 0);
        for row in 0..rows {
            for column in (0..columns).filter(|&column| wanted(column, row)) {
                tiles.push(row * columns + column);
                pixels += inside(column, width) * inside(row, height);
            }
        }
        Self { size: [width, height], tiles, pixels }
    }

    /// Returns the numbers of the tiles in the whole picture, counted row by row, in ascending order.
    #[must_use]
    pub fn tiles(&self) -> &[u32] {
        &self.tiles
    }

    /// Returns the number of pixels of the tiles within the picture.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        self.pixels
    }

    /// Returns the tiles that are in this set or in `other`, which must be of a picture of the same size.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        let [width, height] = self.size;
        Self::new(width, height, |column, row| {
            let corner = [column, row].map(|k| k as usize * TILE);
            [self, other].iter().any(|set| set.drawn_at(corner).is_some())
        })
    }

    /// Returns the tiles of a picture of half the width and height that contain one of these tiles.
    #[must_use]
    pub fn halved(&self) -> Self {
        let columns = self.size[0].div_ceil(TILE_U32).max(1);
        let [width, height] = self.size.map(|side| (side / 2).max(1));
        let mut places: Vec<[u32; 2]> =
            self.tiles.iter().map(|tile| [tile / columns / 2, tile % columns / 2]).collect();
        places.sort_unstable();
        places.dedup();
        Self::new(width, height, |column, row| places.binary_search(&[row, column]).is_ok())
    }

    /// Returns the place in the whole picture, as (column, row), of pixel number `drawn` of the picture of these tiles.
    /// The place may be beyond the border. Returns `None` if there is no such pixel.
    pub(crate) fn place_of_drawn(&self, drawn: usize) -> Option<[usize; 2]> {
        let columns = self.size[0].div_ceil(TILE_U32).max(1);
        let tile = *self.tiles.get(drawn / (TILE * TILE))?;
        let corner = [tile % columns, tile / columns].map(|k| k as usize * TILE);
        Some([corner[0] + drawn % TILE, corner[1] + drawn / TILE % TILE])
    }

    /// Returns the number in the picture of these tiles of the pixel at `place` of the whole picture; `None` if the pixel
    /// is in no tile of the set.
    pub(crate) fn drawn_at(&self, [column, row]: [usize; 2]) -> Option<usize> {
        let columns = self.size[0].div_ceil(TILE_U32).max(1) as usize;
        let tile = u32::try_from(row / TILE * columns + column / TILE).ok()?;
        let number = self.tiles.binary_search(&tile).ok()?;
        Some(number * TILE * TILE + row % TILE * TILE + column % TILE)
    }

    /// Checks that the set is of pictures of `width` by `height` pixels, and not empty.
    pub(crate) fn check(&self, width: u32, height: u32) -> Result<()> {
        if self.size == [width, height] && !self.tiles.is_empty() {
            return Ok(());
        }
        let [w, h] = self.size;
        let given = format!("{} tiles of {w} x {h} pixels", self.tiles.len());
        Err(Error::parameter("tiles", given, format!("at least one tile of {width} x {height} pixels")))
    }

    /// Returns the width and height of the picture of these tiles.
    pub(crate) fn picture_size(&self) -> [u32; 2] {
        [TILE_U32, u32::try_from(self.tiles.len()).unwrap_or(u32::MAX).saturating_mul(TILE_U32)]
    }

    /// Returns the picture of these tiles, cut out of the picture `whole`. Pixels beyond its border are `background`.
    #[cfg(any(test, feature = "gpu"))]
    pub(crate) fn cut(&self, whole: &Image, background: [f32; 3]) -> Image {
        let [width, height] = self.picture_size();
        let places = (0..self.tiles.len() * TILE * TILE).filter_map(|drawn| self.place_of_drawn(drawn));
        let pixel = |[x, y]: [usize; 2]| {
            let inside = x < whole.width as usize && y < whole.height as usize;
            if inside { whole.pixels[y * whole.width as usize + x] } else { background }
        };
        let pixels = places.map(pixel).collect();
        Image { width, height, pixels }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "16")]
const TILE_U32: u32 = TILE as u32;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_within_the_picture_count() {
        let all = TileSet::new(40, 20, |_, _| true);
        assert_eq!((all.tiles(), all.pixels()), (&[0, 1, 2, 3, 4, 5][..], 800));
        let last = TileSet::new(40, 20, |column, row| column == 2 && row == 1);
        assert_eq!((last.tiles(), last.pixels(), last.picture_size()), (&[5][..], 32, [16, 16]));
        assert!(last.check(40, 20).is_ok() && last.check(40, 21).is_err());
        assert!(TileSet::new(40, 20, |_, _| false).check(40, 20).is_err());
        assert_eq!((last.place_of_drawn(17), last.place_of_drawn(256)), (Some([33, 17]), None));
        assert_eq!((last.drawn_at([33, 17]), last.drawn_at([31, 17])), (Some(17), None));
    }

    #[test]
    fn joined_sets_have_the_tiles_of_both() {
        let sets = [(2, 0), (0, 1), (2, 0)].map(|wanted| TileSet::new(40, 20, |x, y| (x, y) == wanted));
        assert_eq!(sets[0].with(&sets[1]), TileSet::new(40, 20, |x, y| x + 2 * y == 2));
        assert_eq!(sets[0].with(&sets[2]), sets[0]);
    }

    #[test]
    fn halves_hold_what_wholes_do() {
        let set = TileSet::new(100, 67, |column, row| (column, row) == (3, 1) || column == 6);
        // 50 by 33 pixels have 4 by 3 tiles.
        assert_eq!(set.halved().tiles(), [1, 3, 7, 11]);
    }
}
