//! Carries moments of splats on screen over to sensitivities of the values of Gaussians in the world.

use lexisplat::simd::Simd;
use lexisplat::{Geometry, Sensitivity};

use crate::parallel::*;

use super::lanes::{LANES, Lanes, each};
use super::math::exp;
use super::moments::{Moments, SUMS};
use super::project::{Body, Derivatives, Projection};
use super::visible::GAUSSIANS_PER_TASK;

/// Number of colour channels of a picture.
const CHANNELS: f32 = 3.0;

/// Carries one view's moments over to the world, and adds the share of the view to the `total` of `views` views. There is
/// one set of moments for each Gaussian. Sets the moments to zero.
pub(crate) fn carry(
    total: &mut Sensitivity,
    projection: &Projection,
    geometry: &Geometry,
    views: usize,
    moments: &mut [Moments],
) {
    let simd = Simd::current();
    let [whole, drawn] = projection.pixel_counts();
    #[expect(clippy::cast_precision_loss, reason = "a count of views, to single precision")]
    let [own, mean] = [(whole, 1), (drawn, views)].map(|(n, views)| 1.0 / (n * CHANNELS * views as f32));
    let weights = PixelWeights { own, mean };
    let Sensitivity { position, scale, rotation, opacity, colour, removal, removal_view, .. } = total;
    let tasks: Vec<Task<'_>> = moments
        .chunks_mut(GAUSSIANS_PER_TASK)
        .zip(position.chunks_mut(GAUSSIANS_PER_TASK))
        .zip(scale.chunks_mut(GAUSSIANS_PER_TASK))
        .zip(rotation.chunks_mut(GAUSSIANS_PER_TASK))
        .zip(opacity.chunks_mut(GAUSSIANS_PER_TASK))
        .zip(colour.chunks_mut(GAUSSIANS_PER_TASK))
        .zip(removal.chunks_mut(GAUSSIANS_PER_TASK))
        .zip(removal_view.chunks_mut(GAUSSIANS_PER_TASK))
        .map(|(((((((moments, position), scale), rotation), opacity), colour), removal), removal_view)| {
            Task { moments, position, scale, rotation, opacity, colour, removal, removal_view }
        })
        .collect();
    tasks.into_par_iter().enumerate().for_each(|(task, mut gaussians)| {
        simd.dispatch(
            #[inline(always)]
            || gaussians.carry(projection, geometry, task * GAUSSIANS_PER_TASK, weights),
        );
    });
}

/// The weights of a pixel of a picture.
#[derive(Clone, Copy)]
struct PixelWeights {
    /// In the mean of the pixels of the picture.
    own: f32,
    /// In the mean of the pixels of all pictures.
    mean: f32,
}

/// The moments and sensitivities of consecutive Gaussians.
struct Task<'a> {
    moments: &'a mut [Moments],
    position: &'a mut [[f32; 6]],
    scale: &'a mut [[f32; 3]],
    rotation: &'a mut [[f32; 3]],
    opacity: &'a mut [f32],
    colour: &'a mut [f32],
    removal: &'a mut [f32],
    removal_view: &'a mut [f32],
}

impl Task<'_> {
    /// Carries the moments of the Gaussians from `first` on over to the world.
    #[inline(always)]
    fn carry(&mut self, projection: &Projection, geometry: &Geometry, first: usize, weights: PixelWeights) {
        let count = self.moments.len();
        for start in (0..count).step_by(LANES) {
            let group = start..count.min(start + LANES);
            let moments = &mut self.moments[group.clone()];
            if moments.iter().all(|m| m.sums[0] == 0.0 && m.removal == 0.0) {
                continue;
            }
            let mut sums = [[0.0; LANES]; SUMS];
            for (lane, m) in moments.iter().enumerate() {
                sums.iter_mut().zip(m.sums).for_each(|(lanes, sum)| lanes[lane] = sum);
            }
            let bodies = Body::load(geometry, first + group.start..first + group.end);
            let changes = Change::of(projection, &bodies, &sums);
            for (lane, i) in group.enumerate() {
                let m = std::mem::take(&mut moments[lane]);
                self.removal[i] = self.removal[i].max(m.removal);
                if m.sums[0] <= 0.0 || !changes.is_finite(lane) {
                    continue;
                }
                self.colour[i] += m.sums[0] * weights.mean;
                self.opacity[i] += m.sums[1] * weights.mean;
                self.removal_view[i] = self.removal_view[i].max(m.sums[1] * weights.own);
                let to = |sums: &mut [f32], values: &[Lanes]| {
                    for (sum, values) in sums.iter_mut().zip(values) {
                        *sum += values[lane] * weights.mean;
                    }
                };
                to(&mut self.position[i], &changes.position);
                to(&mut self.scale[i], &changes.scale);
                to(&mut self.rotation[i], &changes.rotation);
            }
        }
    }
}

/// Squared derivatives of one picture by the positions and shapes of a group of Gaussians.
struct Change {
    position: [Lanes; 6],
    scale: [Lanes; 3],
    rotation: [Lanes; 3],
}

impl Change {
    /// Carries the moments of a group of Gaussians over to the world.
    #[inline(always)]
    fn of(projection: &Projection, body: &Body, m: &[Lanes; SUMS]) -> Self {
        let Derivatives { by_position: [x, y, z], axes: [a, b, c] } = &projection.derivatives(body);
        let position = [
            product(x, x, m),
            product(x, y, m),
            product(x, z, m),
            product(y, y, m),
            product(y, z, m),
            product(z, z, m),
        ];
        // With the covariance the sum of a a^T over the axes on screen, d ln alpha / d ln s_k is (u . R a_k)^2
        // and a rotation in the plane of j and k by one radian makes
        // (u . R a_j) (u . R a_k) (s_j^2 - s_k^2) / (s_j s_k).
        let [sa, sb, sc] = &body.scales;
        let rotation = [
            levered(&fourth(b, c, m), sb, sc),
            levered(&fourth(c, a, m), sc, sa),
            levered(&fourth(a, b, m), sa, sb),
        ];
        Self { position, scale: [fourth(a, a, m), fourth(b, b, m), fourth(c, c, m)], rotation }
    }

    /// Returns whether all values of a lane are finite.
    fn is_finite(&self, lane: usize) -> bool {
        self.position.iter().chain(&self.scale).chain(&self.rotation).all(|values| values[lane].is_finite())
    }
}

/// Returns the sums of `(u . p) (u . q)`, from the second moments.
#[inline(always)]
fn product(p: &[Lanes; 2], q: &[Lanes; 2], m: &[Lanes; SUMS]) -> Lanes {
    let inputs = [&p[0], &p[1], &q[0], &q[1], &m[2], &m[3], &m[4]];
    let [product] =
        each(inputs, |[px, py, qx, qy, xx, xy, yy]| [xx * px * qx + xy * (px * qy + py * qx) + yy * py * qy]);
    product
}

/// Returns the sums of `(u . p)^2 (u . q)^2`, from the fourth moments. They are at least 0.
#[inline(always)]
fn fourth(p: &[Lanes; 2], q: &[Lanes; 2], m: &[Lanes; SUMS]) -> Lanes {
    let inputs = [&p[0], &p[1], &q[0], &q[1], &m[5], &m[6], &m[7], &m[8], &m[9]];
    let [fourth] = each(inputs, |[px, py, qx, qy, m5, m6, m7, m8, m9]| {
        // This is `(u . p)^2 (u . q)^2` as a polynomial in u.
        let square = |x: f32, y: f32| [x * x, 2.0 * x * y, y * y];
        let (p, q) = (square(px, py), square(qx, qy));
        let value = p[0] * q[0] * m5
            + (p[0] * q[1] + p[1] * q[0]) * m6
            + (p[0] * q[2] + p[1] * q[1] + p[2] * q[0]) * m7
            + (p[1] * q[2] + p[2] * q[1]) * m8
            + p[2] * q[2] * m9;
        [if value > 0.0 { value } else { 0.0 }]
    });
    fourth
}

/// Returns `value` times the squared lever of a rotation in the plane of two axes. `scale` and `other` are the logarithms
/// of their lengths.
#[inline(always)]
fn levered(value: &Lanes, scale: &Lanes, other: &Lanes) -> Lanes {
    let [levered] = each([value, scale, other], |[value, scale, other]| {
        let ratio = exp(scale - other);
        let lever = ratio - 1.0 / ratio;
        [value * lever * lever]
    });
    levered
}
