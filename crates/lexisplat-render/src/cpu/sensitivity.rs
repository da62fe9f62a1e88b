//! Measures how much pictures change with every value of every Gaussian.

use lexisplat::simd::Simd;
use lexisplat::{Geometry, Progress, Sensitivity, Stage};

use crate::camera::Camera;
use crate::error::Result;
use crate::parallel::*;
use crate::radiance::Radiance;
use crate::scene::Scene;

use super::math::exp;
use super::moments::{self, Moments, SUMS};
use super::project::{self, Derivatives, Projection, Root, Visible};
use super::{blend, order, tiles};

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
    progress.begin(Stage::Draw, cameras.len() as u64);
    for camera in cameras {
        progress.check()?;
        add_view(&mut total, scene, camera, cameras.len());
        progress.advance(1);
    }
    progress.end();
    Ok(total)
}

fn add_view(total: &mut Sensitivity, scene: &Scene<'_>, camera: &Camera, views: usize) {
    let simd = Simd::current();
    let projection = Projection::new(camera, scene.meta().antialiased);
    let splats = order::by_depth(project::project(scene.geometry(), &Radiance::new(scene), &projection));
    let grid = projection.grid;
    let size = [camera.width as usize, camera.height as usize];
    let root =
        |splat: &Visible| projection.root(scene.geometry(), splat.gaussian as usize).unwrap_or_default();
    let roots: Vec<Root> = splats.par_iter().map(root).collect();
    let mut sums = vec![Moments::default(); splats.len()];
    for band in tiles::bands(&splats, grid, tiles::MAX_ENTRIES) {
        let lists = tiles::TileLists::new(&splats, grid, band.clone());
        // Tiles are summed in order, so that results do not depend on the number of threads. A few are measured
        // at a time, since their moments take much memory.
        let tiles = band.len() * grid.columns;
        for first in (0..tiles).step_by(TILES) {
            let parts: Vec<Vec<(u32, Moments)>> = (first..(first + TILES).min(tiles))
                .into_par_iter()
                .map(|tile| {
                    let at = [tile % grid.columns, band.start + tile / grid.columns];
                    let picture = blend::tile(simd, &splats, lists.of(tile), at, [0.0; 3]);
                    moments::tile(simd, &splats, &roots, lists.of(tile), at, size, &picture)
                })
                .collect();
            for (splat, part) in parts.into_iter().flatten() {
                sums[splat as usize].add(&part);
            }
        }
    }
    carry(total, &projection, scene.geometry(), views, &sums, |k| splats[k].gaussian as usize);
}

/// Carries one view's moments over to the world, and adds its share to the `total` over `views`. Moments `k` are
/// those of Gaussian `gaussian(k)`.
pub(crate) fn carry(
    total: &mut Sensitivity,
    projection: &Projection,
    geometry: &Geometry,
    views: usize,
    moments: &[Moments],
    gaussian: impl Fn(usize) -> usize + Sync,
) {
    let camera = &projection.camera;
    #[expect(clippy::cast_precision_loss, reason = "a count of pixels, to single precision")]
    let share = 1.0 / (camera.width as f32 * camera.height as f32 * CHANNELS * views as f32);
    for (first, moments) in (0..).step_by(SPLATS).zip(moments.chunks(SPLATS)) {
        let changes: Vec<Option<Change>> = moments
            .par_iter()
            .enumerate()
            .map(|(k, m)| {
                let seen = m.sums[0] > 0.0;
                seen.then(|| Change::of(projection, geometry, gaussian(first + k), &m.sums)).flatten()
            })
            .collect();
        for ((k, m), change) in (first..).zip(moments).zip(changes) {
            let i = gaussian(k);
            total.removal[i] = total.removal[i].max(m.removal);
            let Some(change) = change.filter(Change::is_finite) else { continue };
            total.colour[i] += m.sums[0] * share;
            total.opacity[i] += m.sums[1] * share;
            let to = |sums: &mut [f32], values: &[f32]| {
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += value * share;
                }
            };
            to(&mut total.position[i], &change.position);
            to(&mut total.scale[i], &change.scale);
            to(&mut total.rotation[i], &change.rotation);
        }
    }
}

/// Tiles measured at a time.
const TILES: usize = 16;
/// Splats carried over to the world at a time.
const SPLATS: usize = 1 << 16;
/// Colour channels of a picture.
const CHANNELS: f32 = 3.0;

/// Squared derivatives of one picture by one Gaussian's position and shape.
struct Change {
    position: [f32; 6],
    scale: [f32; 3],
    rotation: [f32; 3],
}

impl Change {
    /// Carries the moments on screen over to the world.
    fn of(projection: &Projection, geometry: &Geometry, i: usize, m: &[f32; SUMS]) -> Option<Self> {
        let Derivatives { by_position, axes } = projection.derivatives(geometry, i)?;
        let [xx, xy, yy] = [m[2], m[3], m[4]];
        let mut position = [0.0; 6];
        for (entry, (p, q)) in position.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
            let (u, w) = (by_position[p], by_position[q]);
            *entry = xx * u[0] * w[0] + xy * (u[0] * w[1] + u[1] * w[0]) + yy * u[1] * w[1];
        }
        // With the covariance the sum of a a^T over the axes on screen, d ln alpha / d ln s_k is (u . R a_k)^2
        // and a rotation in the plane of j and k by one radian makes
        // (u . R a_j) (u . R a_k) (s_j^2 - s_k^2) / (s_j s_k).
        let fourth = |p: [f32; 2], q: [f32; 2]| {
            // This is (u . p)^2 (u . q)^2 as a polynomial in u.
            let square = |a: [f32; 2]| [a[0] * a[0], 2.0 * a[0] * a[1], a[1] * a[1]];
            let (p, q) = (square(p), square(q));
            p[0] * q[0] * m[5]
                + (p[0] * q[1] + p[1] * q[0]) * m[6]
                + (p[0] * q[2] + p[1] * q[1] + p[2] * q[0]) * m[7]
                + (p[1] * q[2] + p[2] * q[1]) * m[8]
                + p[2] * q[2] * m[9]
        };
        let scales = geometry.scales[i];
        let rotation = std::array::from_fn(|k| {
            let (j, l) = ((k + 1) % 3, (k + 2) % 3);
            let ratio = exp(scales[j] - scales[l]);
            let lever = ratio - 1.0 / ratio;
            fourth(axes[j], axes[l]).max(0.0) * lever * lever
        });
        Some(Self { position, scale: axes.map(|a| fourth(a, a).max(0.0)), rotation })
    }

    fn is_finite(&self) -> bool {
        self.position.iter().chain(&self.scale).chain(&self.rotation).all(|v| v.is_finite())
    }
}
