//! Measures how much pictures change with every value of every Gaussian.

use lexisplat::simd::Simd;
use lexisplat::{Progress, Sensitivity, Stage};

use crate::camera::Camera;
use crate::error::Result;
use crate::parallel::*;
use crate::radiance::Radiance;
use crate::scene::Scene;

use super::blend::{Queue, Tile};
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
    let mut workspace = Workspace::default();
    let mut sums = vec![Moments::default(); scene.len()];
    let radiance = Radiance::new(scene);
    progress.begin(Stage::Draw, cameras.len() as u64);
    for camera in cameras {
        progress.check()?;
        let projection = Projection::new(camera, scene.meta().antialiased);
        measure(&mut sums, &mut workspace, scene, &radiance, &projection);
        carry(&mut total, &projection, scene.geometry(), cameras.len(), &mut sums);
        progress.advance(1);
    }
    progress.end();
    Ok(total)
}

/// Tiles measured at a time. Their moments take 48 bytes for each splat of each tile.
const TILES: usize = 64;
/// Tiles that one task measures.
const TILES_PER_TASK: usize = 4;

/// Adds the moments of one view to `sums`, one for each Gaussian.
fn measure(
    sums: &mut [Moments],
    workspace: &mut Workspace,
    scene: &Scene<'_>,
    radiance: &Radiance<'_>,
    projection: &Projection,
) {
    let simd = Simd::current();
    let grid = projection.grid;
    let size = projection.size();
    let Workspace { visible, order, lists } = workspace;
    visible.project(simd, scene.geometry(), radiance, projection);
    order.sort(visible);
    for band in tiles::bands(&order.rects, grid, tiles::MAX_ENTRIES) {
        lists.fill(order, grid, &band);
        // Tiles are summed in order, so that results do not depend on the number of threads.
        let tiles = band.len() * grid.columns;
        let starts: Vec<usize> = (0..tiles).step_by(TILES_PER_TASK).collect();
        for starts in starts.chunks(TILES / TILES_PER_TASK) {
            let parts: Vec<Vec<(u32, Moments)>> = starts
                .par_iter()
                .map(|&start| {
                    let (mut queue, mut trace, mut out) = (Queue::default(), Trace::default(), Vec::new());
                    for tile in start..(start + TILES_PER_TASK).min(tiles) {
                        let place = [tile % grid.columns, band.start + tile / grid.columns];
                        let place = Tile::new(place, size);
                        let list = lists.of(tile);
                        moments::tile(simd, &visible.slots, list, place, (&mut queue, &mut trace), &mut out);
                    }
                    out
                })
                .collect();
            for (gaussian, part) in parts.into_iter().flatten() {
                sums[gaussian as usize].add(&part);
            }
        }
    }
}
