//! Several sources as one scene.

use std::ops::Range;

use crate::scene::offset::{Offset, shift};
use crate::scene::rounding::Rounding;
use crate::scene::source::{SplatSource, check_range};
use crate::scene::splats::Splats;
use crate::scene::tile_kind::TileKind;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_GAUSSIANS};

/// Subject of the warning that rounding is coarse.
const UNITED: &str = "32-bit floats, relative to one offset for all tiles,";
/// Number of Gaussians of a tile, from its first on, that tell how far rounding moves positions. This distance depends on
/// the offsets.
const ROUNDED: usize = 4096;

/// A scene of several tiles, one after the other.
pub struct Joined<'a> {
    tiles: Vec<&'a dyn SplatSource>,
    /// For each tile, the number of Gaussians before it; then the number of all Gaussians.
    firsts: Vec<usize>,
    empty: Splats,
    warnings: Vec<String>,
}

impl std::fmt::Debug for Joined<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Joined").field("firsts", &self.firsts).finish_non_exhaustive()
    }
}

impl<'a> Joined<'a> {
    /// Joins `tiles`, each with its name. The scene has the comments of all tiles, without repetitions. Its positions are
    /// relative to one offset ([`Offset::shared`]). A warning names each tile whose positions this offset rounds coarsely.
    ///
    /// # Errors
    /// [`Error::Format`] that names a tile without Gaussians, or a tile with another degree, other extras or another
    /// antialiasing mark than the first tile. [`Error::Parameter`] for no tiles, [`Error::Limit`] for too many Gaussians,
    /// and errors of reading a tile.
    pub fn new(tiles: &[(String, &'a dyn SplatSource)]) -> Result<Self> {
        let mut firsts = vec![0_usize];
        let mut empty: Option<Splats> = None;
        let (mut warnings, mut offsets) = (Vec::new(), Vec::new());
        for (name, tile) in tiles {
            let own = tile.empty();
            TileKind::of(&own).check(name, empty.as_ref().map(TileKind::of).as_ref(), tile.len() as u64)?;
            offsets.push((own.meta.offset, tile.len() as u64));
            empty.get_or_insert_with(|| own.clone()).meta.join(&own.meta);
            warnings.extend(tile.warnings().iter().map(|warning| format!("{name}: {warning}")));
            firsts.push(firsts.last().copied().unwrap_or(0).saturating_add(tile.len()));
        }
        let mut empty = empty.ok_or_else(|| Error::parameter("tiles", 0, "at least one"))?;
        empty.meta.offset = Offset::shared(&offsets);
        Limits::check("Gaussians", firsts.last().copied().unwrap_or(0) as u64, MAX_GAUSSIANS)?;
        for (name, tile) in tiles {
            let coarse = rounding(*tile, empty.meta.offset)?.and_then(|found| found.warning(UNITED));
            warnings.extend(coarse.map(|told| format!("{name}: {told}")));
        }
        Ok(Self { tiles: tiles.iter().map(|tile| tile.1).collect(), firsts, empty, warnings })
    }
}

/// Returns how far positions of `tile` move when they become relative to `offset`; `None` if they are relative to it
/// already.
fn rounding(tile: &dyn SplatSource, offset: Option<Offset>) -> Result<Option<Rounding>> {
    let mut some = tile.empty();
    if some.meta.offset == offset {
        return Ok(None);
    }
    tile.read(0..tile.len().min(ROUNDED), &mut some)?;
    let sizes = some.geometry.scales.iter().map(|scales| Rounding::size_of(*scales)).collect();
    let error = shift(&mut some.geometry.positions, some.meta.offset, offset);
    Ok(Some(Rounding { error, size: Rounding::median(sizes) }))
}

impl SplatSource for Joined<'_> {
    fn len(&self) -> usize {
        self.firsts.last().copied().unwrap_or(0)
    }

    fn empty(&self) -> Splats {
        self.empty.clone()
    }

    fn has_normals(&self) -> bool {
        self.tiles.iter().all(|tile| tile.has_normals())
    }

    fn row_bytes(&self) -> u64 {
        self.tiles.iter().map(|tile| tile.row_bytes()).max().unwrap_or(0)
    }

    fn source_bytes(&self) -> u64 {
        self.tiles.iter().map(|tile| tile.source_bytes()).sum()
    }

    fn tiles(&self) -> &[&dyn SplatSource] {
        &self.tiles
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn read(&self, range: Range<usize>, part: &mut Splats) -> Result<()> {
        check_range(&range, self.len())?;
        *part = self.empty();
        for (tile, bounds) in self.tiles.iter().zip(self.firsts.windows(2)) {
            let own = range.start.max(bounds[0])..range.end.min(bounds[1]);
            if own.is_empty() {
                continue;
            }
            let mut next = tile.empty();
            tile.read(own.start - bounds[0]..own.end - bounds[0], &mut next)?;
            shift(&mut next.geometry.positions, next.meta.offset, self.empty.meta.offset);
            if !self.has_normals() {
                next.geometry.normals = Vec::new();
            }
            part.append(next);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_that_one_offset_rounds_coarsely_are_named() {
        let mut tiles = [1, 2].map(|seed| crate::support::testing::scene(40, seed));
        let mut warnings = |far: f64| {
            tiles[0].meta.offset = Offset::new([5e5, 0.0, 4e6]).unwrap();
            tiles[1].meta.offset = Offset::new([5e5 + far, 0.0, 4e6]).unwrap();
            let named: Vec<(String, &dyn SplatSource)> = ["a.ply", "b.ply"]
                .iter()
                .zip(&tiles)
                .map(|(name, tile)| (name.to_string(), tile as _))
                .collect();
            Joined::new(&named).unwrap().warnings().to_vec()
        };
        assert!(warnings(64.0).is_empty());
        let told = warnings(3e5);
        assert!(told.len() == 1 && told[0].starts_with("a.ply: 32-bit floats"), "{told:?}");
        assert!(told[0].contains("move positions by up to"), "{told:?}");
    }

    /// The tiles have these positions in the whole scene and in any part of it.
    #[test]
    fn tiles_with_other_offsets_lie_beside_each_other() {
        let offset = |x| Offset::new([x, 0.0, 4e6]).unwrap();
        let mut tiles = [1, 2, 3].map(|seed| crate::support::testing::scene(40, seed));
        for (tile, x) in tiles.iter_mut().zip([5e5, 5e5 + 64.0, 5e5 + 128.0]) {
            tile.meta.offset = offset(x);
        }
        let named: Vec<(String, &dyn SplatSource)> =
            tiles.iter().map(|tile| (String::new(), tile as &dyn SplatSource)).collect();
        let joined = Joined::new(&named).unwrap();
        assert_eq!(joined.empty().meta.offset, offset(5e5 + 64.0));
        let whole = joined.whole().unwrap();
        let mut part = joined.empty();
        for (t, tile) in tiles.iter().enumerate() {
            joined.read(40 * t + 3..40 * t + 9, &mut part).unwrap();
            assert_eq!(part.geometry.positions, whole.geometry.positions[40 * t + 3..40 * t + 9]);
            let expected = tile.geometry.positions[3][0] - 64.0 + 64.0 * [0.0, 1.0, 2.0][t];
            assert!((part.geometry.positions[0][0] - expected).abs() < 1e-5);
        }
    }

    #[test]
    fn ranges_reach_over_tiles() {
        let whole = crate::support::testing::scene(100, 1);
        let part = |range: Range<usize>| {
            let mut part = whole.empty();
            whole.read(range, &mut part).unwrap();
            part
        };
        let tiles = [part(0..30), part(30..31), part(31..100)];
        let named: Vec<(String, &dyn SplatSource)> =
            tiles.iter().map(|tile| (String::new(), tile as &dyn SplatSource)).collect();
        let joined = Joined::new(&named).unwrap();
        assert_eq!((joined.len(), joined.tiles().len()), (100, 3));
        let mut found = joined.empty();
        for range in [0..100, 29..32, 30..31, 5..5, 90..100] {
            joined.read(range.clone(), &mut found).unwrap();
            assert_eq!(found, part(range));
        }
        assert!(joined.read(99..101, &mut found).is_err());
        assert!(Joined::new(&[]).is_err());
    }
}
