//! Measures a view tile by tile, and passes on the values of each splat in the order of the tiles.

use std::sync::{Mutex, PoisonError};

use crate::parallel::*;

use super::blend::{Canvas, Tile};
use super::project::Projection;
use super::splat::Splat;
use super::tiles::{self, List, TileLists};
use super::trace::Trace;
use super::workspace::Workspace;

/// Largest number of splats in the lists of the tiles that are measured together, unless one tile has more. Their
/// measurements take up to 48 bytes each: 6 MB.
const ENTRIES: usize = 1 << 17;

/// Memory that measuring a tile overwrites.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pub(super) canvas: Canvas,
    pub(super) trace: Trace,
}

/// Memory that threads borrow in turn. There are as many pieces as threads have used at once, so that memory is not
/// allocated for each tile.
#[derive(Debug, Default)]
pub(super) struct Pool(Mutex<Vec<Box<Scratch>>>);

impl Pool {
    fn with<R>(&self, work: impl FnOnce(&mut Scratch) -> R) -> R {
        // A thread that panicked kept the piece that it had borrowed, so the other pieces are whole.
        let taken = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scratch = taken().pop().unwrap_or_default();
        let result = work(&mut scratch);
        taken().push(scratch);
        result
    }
}

/// Measures every tile of a view with `measure`. `workspace` has the projected Gaussians of the view. `measure` returns
/// values with the indices of Gaussians. `add` receives them in the order of the tiles, so that sums do not depend on the
/// number of threads.
pub(super) fn measure_tiles<T: Send>(
    workspace: &mut Workspace,
    pool: &Pool,
    projection: &Projection,
    measure: impl Fn(&[Splat], List<'_>, Tile, &mut Scratch) -> Vec<(u32, T)> + Sync,
    mut add: impl FnMut(usize, T),
) {
    let grid = projection.grid;
    let Workspace { visible, order, lists, .. } = workspace;
    order.sort(visible);
    for band in tiles::bands(order, grid, tiles::MAX_ENTRIES) {
        lists.fill(order, grid, projection.chosen.as_ref(), &band);
        measure_band(&visible.slots, lists, &projection.tiles(&band), pool, &measure, &mut add);
    }
}

/// Measures the `tiles` of a band, whose lists have slots of `splats`.
fn measure_band<T: Send>(
    splats: &[Splat],
    lists: &TileLists,
    tiles: &[(usize, Tile)],
    pool: &Pool,
    measure: &(impl Fn(&[Splat], List<'_>, Tile, &mut Scratch) -> Vec<(u32, T)> + Sync),
    add: &mut impl FnMut(usize, T),
) {
    let mut first = 0;
    while first < tiles.len() {
        let mut entries = lists.len(tiles[first].0);
        let mut end = first + 1;
        while end < tiles.len() && entries + lists.len(tiles[end].0) <= ENTRIES {
            entries += lists.len(tiles[end].0);
            end += 1;
        }
        let measured: Vec<Vec<(u32, T)>> = (first..end)
            .into_par_iter()
            .map(|k| {
                let (tile, place) = tiles[k];
                pool.with(|scratch| measure(splats, lists.of(tile), place, scratch))
            })
            .collect();
        for (gaussian, value) in measured.into_iter().flatten() {
            add(gaussian as usize, value);
        }
        first = end;
    }
}

/// The splats and lists of a view that is measured several times.
#[derive(Debug)]
pub(super) struct KeptView {
    /// The splats that the lists have, in the order of depth.
    splats: Vec<Splat>,
    lists: TileLists,
}

impl KeptView {
    /// Returns the view whose projected Gaussians `workspace` has; `None` if its lists are too long to be kept.
    pub(super) fn of(workspace: &mut Workspace, projection: &Projection) -> Option<Self> {
        let Workspace { visible, order, .. } = workspace;
        order.sort(visible);
        let [band] = tiles::bands(order, projection.grid, tiles::MAX_ENTRIES).try_into().ok()?;
        let splats = order.keys.iter().map(|&(_, slot)| visible.slots[slot as usize]).collect();
        // Splats are numbered by their indices in `splats` from here on.
        for (number, (_, slot)) in (0..).zip(&mut order.keys) {
            *slot = number;
        }
        let mut lists = TileLists::default();
        lists.fill(order, projection.grid, projection.chosen.as_ref(), &band);
        Some(Self { splats, lists })
    }

    /// Returns the number of bytes in memory.
    pub(super) fn bytes(&self) -> u64 {
        size_of_val(self.splats.as_slice()) as u64 + self.lists.bytes()
    }

    /// Measures every tile, as [`measure_tiles`].
    pub(super) fn measure<T: Send>(
        &self,
        pool: &Pool,
        projection: &Projection,
        measure: impl Fn(&[Splat], List<'_>, Tile, &mut Scratch) -> Vec<(u32, T)> + Sync,
        mut add: impl FnMut(usize, T),
    ) {
        let tiles = projection.tiles(&(0..projection.grid.rows));
        measure_band(&self.splats, &self.lists, &tiles, pool, &measure, &mut add);
    }
}
