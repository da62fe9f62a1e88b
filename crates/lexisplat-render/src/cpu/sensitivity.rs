//! Measures the sensitivity of pictures to every value of every Gaussian.

use lexisplat::simd::Simd;
use lexisplat::{Progress, Sensitivity, Stage};

use crate::camera::Camera;
use crate::error::Result;
use crate::radiance::Radiance;
use crate::scene::Scene;

use super::change::carry;
use super::measured_tiles::{Pool, measure_tiles};
use super::moments::{self, Moments};
use super::project::Projection;
use super::workspace::Workspace;

/// Returns the sensitivity of the pictures of `scene` from `cameras` to each value of each Gaussian, averaged over
/// the views. Every view has the same weight, whatever its size.
///
/// If every value has an independent small error, the expected mean squared error of the pictures is the sum of the
/// sensitivities times the squared errors.
///
/// Reports the stage [`Stage::Draw`] to `progress`, in views, and asks it before each view whether to stop.
///
/// # Errors
/// [`Error::Codec`](crate::Error::Codec) if `progress` cancelled the work; otherwise as [`crate::render`].
pub fn sensitivity(scene: &Scene<'_>, cameras: &[Camera], progress: &dyn Progress) -> Result<Sensitivity> {
    scene.validate()?;
    cameras.iter().try_for_each(Camera::validate)?;
    let mut total = Sensitivity::zeros(scene.len());
    let (mut workspace, pool) = (Workspace::of_scene(scene.geometry()), Pool::default());
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

/// Adds the moments of one view to `sums`, which has one entry for each Gaussian.
fn measure(
    sums: &mut [Moments],
    workspace: &mut Workspace,
    pool: &Pool,
    scene: &Scene<'_>,
    radiance: &Radiance<'_>,
    projection: &Projection,
) {
    let simd = Simd::current();
    workspace.project(scene, radiance, projection);
    measure_tiles(
        workspace,
        pool,
        projection,
        |splats, list, tile, scratch| {
            moments::tile(simd, splats, list, tile, projection.background(), scratch)
        },
        |gaussian, moments| sums[gaussian].add(&moments),
    );
}
