//! Measures how much pictures change with every value of every Gaussian.

use std::sync::{Mutex, PoisonError};

use lexisplat::simd::Simd;
use lexisplat::{Progress, Sensitivity, Stage};

use crate::camera::Camera;
use crate::error::Result;
use crate::parallel::*;
use crate::radiance::Radiance;
use crate::scene::Scene;

use super::blend::{Canvas, Tile};
use super::change::carry;
use super::moments::{self, Moments};
use super::project::Projection;
use super::tiles;
use super::trace::Trace;
use super::workspace::Workspace;

/// Returns how much the pictures of `scene` from `cameras`, over black, change with each value of each
/// Gaussian, averaged over the views. Every view has the same weight, whatever its size.
///
/// If every value has an independent small error, the expected mean squared error of the pictures is the
/// sum of the sensitivities times the squared errors.
///
/// Reports the stage [`Stage::Draw`], in views, to `progress`, and asks it before each view whether to stop.
///
/// # Errors
/// [`Error::Codec`](crate::Error::Codec) if `progress` cancelled the work; otherwise as [`crate::render`].
pub fn sensitivity(scene: &Scene<'_>, cameras: &[Camera], progress: &dyn Progress) -> Result<Sensitivity> {
    scene.validate()?;
    cameras.iter().try_for_each(Camera::validate)?;
    let mut total = Sensitivity::zeros(scene.len());
    let (mut workspace, pool) = (Workspace::default(), Pool::default());
    let mut sums = vec![Moments::default(); scene.len()];
    let radiance = Radiance::new(scene);
    progress.begin(Stage::Draw, cameras.len() as u64);
    for camera in cameras {
        progress.check()?;
        let projection = Projection::new(camera, scene.meta().antialiased);
        measure(&mut sums, &mut workspace, &pool, scene, &radiance, &projection);
        carry(&mut total, &projection, scene.geometry(), cameras.len(), &mut sums);
        progress.advance(1);
    }
    progress.end();
    Ok(total)
}

/// Splats in the lists of the tiles that are measured at a time, unless one tile has more. Their moments take 48 bytes
/// each: 6 MB.
const ENTRIES: usize = 1 << 17;

/// What measuring a tile overwrites.
#[derive(Default)]
struct Scratch {
    canvas: Canvas,
    trace: Trace,
}

/// Memory that threads take turns with. There is as much of it as threads have used at once, and none of it grows anew
/// for each tile.
#[derive(Default)]
struct Pool(Mutex<Vec<Box<Scratch>>>);

impl Pool {
    fn with<R>(&self, work: impl FnOnce(&mut Scratch) -> R) -> R {
        // A thread that panicked kept what it had taken, so the rest is whole.
        let taken = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scratch = taken().pop().unwrap_or_default();
        let result = work(&mut scratch);
        taken().push(scratch);
        result
    }
}

/// Adds the moments of one view to `sums`, one for each Gaussian.
fn measure(
    sums: &mut [Moments],
    workspace: &mut Workspace,
    pool: &Pool,
    scene: &Scene<'_>,
    radiance: &Radiance<'_>,
    projection: &Projection,
) {
    let simd = Simd::current();
    let grid = projection.grid;
    let size = projection.size();
    let Workspace { visible, order, lists } = workspace;
    visible.project(&mut order.keys, simd, scene.geometry(), radiance, projection);
    order.sort(visible);
    for band in tiles::bands(order, grid, tiles::MAX_ENTRIES) {
        lists.fill(order, grid, &band);
        // Tiles are summed in order, so that results do not depend on the number of threads.
        let tiles = band.len() * grid.columns;
        let mut first = 0;
        while first < tiles {
            let mut entries = lists.len(first);
            let mut end = first + 1;
            while end < tiles && entries + lists.len(end) <= ENTRIES {
                entries += lists.len(end);
                end += 1;
            }
            let parts: Vec<Vec<(u32, Moments)>> = (first..end)
                .into_par_iter()
                .map(|tile| {
                    let place = Tile::new([tile % grid.columns, band.start + tile / grid.columns], size);
                    let list = lists.of(tile);
                    pool.with(|Scratch { canvas, trace }| {
                        moments::tile(simd, &visible.slots, list, place, canvas, trace)
                    })
                })
                .collect();
            for (gaussian, part) in parts.into_iter().flatten() {
                sums[gaussian as usize].add(&part);
            }
            first = end;
        }
    }
}
