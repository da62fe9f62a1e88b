//! Computes how much light passes through a scene along a line.

use glam::{DMat3, DQuat, DVec3};
use lexisplat::Geometry;

use crate::conventions::{ALPHA_MAX, ALPHA_MIN};
use crate::parallel::*;

/// Number of Gaussians that one task sums. The sums of tasks are added in order, so that the result does not depend on
/// the number of threads.
const GAUSSIANS_PER_TASK: usize = 8192;
/// Largest number of Gaussians that are looked at. Of a larger scene every second, every third and so on is looked at,
/// and counts two, three and so on times. This is enough to find opaque Gaussians in the way, and takes seconds for the
/// largest scenes.
const MAX_ASKED: usize = 1 << 20;
/// Number of standard deviations beyond which every Gaussian is below [`ALPHA_MIN`]: `sqrt(2 ln 255)`.
const REACH_SIGMAS: f64 = 3.33;
/// Largest absolute natural logarithm of a scale. Logarithms are clamped to it, so that squares of scales and of their
/// reciprocals are finite.
const MAX_LOG_SCALE: f64 = 60.0;

/// A segment of a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ray {
    pub(crate) origin: DVec3,
    /// Direction, of length 1.
    pub(crate) direction: DVec3,
    /// Distances from the origin at which the segment begins and ends, in world units.
    pub(crate) from: f64,
    pub(crate) to: f64,
}

/// Returns the share of light left along every ray, 0 to 1. It is the product of `1 - alpha` over the Gaussians whose
/// densest point on the line lies on the segment, with their alpha at that point.
pub(crate) fn transmittances(geometry: &Geometry, rays: &[Ray]) -> Vec<f64> {
    thinned(geometry, rays, geometry.len().div_ceil(MAX_ASKED).max(1))
}

/// Returns the result of [`transmittances`] from every `step`-th Gaussian.
fn thinned(geometry: &Geometry, rays: &[Ray], step: usize) -> Vec<f64> {
    let asked = geometry.len().div_ceil(step);
    let sums: Vec<Vec<f64>> = (0..asked.div_ceil(GAUSSIANS_PER_TASK))
        .into_par_iter()
        .map(|task| {
            let end = asked.min((task + 1) * GAUSSIANS_PER_TASK);
            logs(geometry, (task * GAUSSIANS_PER_TASK..end).map(|i| i * step), rays)
        })
        .collect();
    let mut totals = vec![0.0; rays.len()];
    for sum in sums {
        totals.iter_mut().zip(sum).for_each(|(total, log)| *total += log);
    }
    totals.into_iter().map(|log| libm::exp(log * step as f64)).collect()
}

/// Returns the logarithms of the shares of light that the Gaussians `some` leave along every ray.
fn logs(geometry: &Geometry, some: impl Iterator<Item = usize>, rays: &[Ray]) -> Vec<f64> {
    let mut logs = vec![0.0; rays.len()];
    for i in some {
        let Some(gaussian) = Gaussian::new(geometry, i) else { continue };
        for (ray, log) in rays.iter().zip(&mut logs) {
            if let Some(alpha) = gaussian.alpha(ray) {
                *log += libm::log1p(-alpha);
            }
        }
    }
    logs
}

/// Returns the rotation of a Gaussian's quaternion (w, x, y, z) of any length; no rotation if the length is 0.
pub(crate) fn unit_rotation(quaternion: [f32; 4]) -> DQuat {
    let [w, x, y, z] = quaternion.map(f64::from);
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let squares = rotation.length_squared();
    if squares.is_normal() { rotation / squares.sqrt() } else { DQuat::IDENTITY }
}

struct Gaussian {
    centre: DVec3,
    alpha: f64,
    /// Largest distance from its centre at which the Gaussian shows, in world units.
    reach: f64,
    rotation: DQuat,
    scales: DVec3,
}

impl Gaussian {
    /// Returns Gaussian `i`; `None` if it does not show or is not finite.
    fn new(geometry: &Geometry, i: usize) -> Option<Self> {
        let alpha = 1.0 / (1.0 + libm::exp(-f64::from(*geometry.opacities.get(i)?)));
        let centre = DVec3::from_array(geometry.positions.get(i)?.map(f64::from));
        let logs = geometry.scales.get(i)?.map(|s| f64::from(s).clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE));
        let rotation = *geometry.rotations.get(i)?;
        let finite = centre.is_finite()
            && logs.iter().all(|s| s.is_finite())
            && rotation.iter().all(|r| r.is_finite());
        if !(finite && alpha >= f64::from(ALPHA_MIN)) {
            return None;
        }
        let scales = DVec3::from_array(logs.map(libm::exp));
        let (reach, rotation) = (REACH_SIGMAS * scales.max_element(), unit_rotation(rotation));
        Some(Self { centre, alpha, reach, rotation, scales })
    }

    /// Returns the Gaussian's alpha at its densest point on the line of `ray`; `None` if this point is not on the segment
    /// or the Gaussian does not show there.
    #[inline]
    fn alpha(&self, ray: &Ray) -> Option<f64> {
        let offset = self.centre - ray.origin;
        let along = offset.dot(ray.direction);
        let aside = offset.length_squared() - along * along;
        if aside > self.reach * self.reach || along + self.reach < ray.from || along - self.reach > ray.to {
            return None;
        }
        // From here on lengths are in standard deviations along the axes of the Gaussian.
        let to_axes = DMat3::from_quat(self.rotation).transpose();
        let (offset, direction) = (to_axes * offset / self.scales, to_axes * ray.direction / self.scales);
        let squares = direction.length_squared();
        let along = offset.dot(direction) / squares;
        if !(along >= ray.from && along <= ray.to) {
            return None;
        }
        let power = -0.5 * (offset - direction * along).length_squared();
        let alpha = (self.alpha * libm::exp(power)).min(f64::from(ALPHA_MAX));
        (alpha >= f64::from(ALPHA_MIN)).then_some(alpha)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat disc facing z, half opaque, at (1, 2, 5) and a ball at the origin; and broken ones.
    fn scene() -> Geometry {
        let nan = f32::NAN;
        Geometry {
            positions: vec![[1.0, 2.0, 5.0], [0.0; 3], [nan, 0.0, 0.0], [0.0; 3], [0.0; 3], [0.0; 3]],
            opacities: vec![0.0, 9.0, 9.0, nan, 9.0, 9.0],
            scales: vec![
                [0.0, (0.5_f32).ln(), -7.0],
                [-2.0; 3],
                [0.0; 3],
                [0.0; 3],
                [0.0, nan, 0.0],
                [f32::NEG_INFINITY; 3],
            ],
            // A quarter turn about z swaps the axes; of any length.
            rotations: vec![
                [2.0, 0.0, 0.0, 2.0],
                [0.0; 4],
                [1.0, 0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0, 0.0],
                [1.0, 0.0, 0.0, 0.0],
                [nan, 0.0, 0.0, 0.0],
            ],
            ..Geometry::default()
        }
    }

    #[test]
    fn light_is_lost_where_a_gaussian_is_on_the_piece() {
        let ray = |x: f64, y: f64, from: f64, to: f64| Ray {
            origin: DVec3::new(x, y, -10.0),
            direction: DVec3::Z,
            from,
            to,
        };
        let rays = [
            ray(1.0, 2.0, 0.0, 20.0),
            ray(1.0, 2.0, 0.0, 14.0),
            ray(1.0, 2.0, 16.0, 20.0),
            // One unit along y is one standard deviation, along x two.
            ray(1.0, 3.0, 0.0, 20.0),
            ray(2.0, 2.0, 0.0, 20.0),
            ray(0.0, 0.0, 0.0, 20.0),
            ray(40.0, 0.0, 0.0, 20.0),
        ];
        let found = transmittances(&scene(), &rays);
        let one = 1.0 - 0.5 * (-0.5_f64).exp();
        let two = 1.0 - 0.5 * (-2.0_f64).exp();
        // Past the ball, which is capped, and the disc's edge.
        let both = 0.01 * (1.0 - 0.5 * (-0.5_f64 * (4.0 + 4.0)).exp());
        for (found, expected) in found.iter().zip([0.5, 1.0, 1.0, one, two, both, 1.0]) {
            assert!((found - expected).abs() < 1e-4, "{found}, expected {expected}");
        }
        assert_eq!(transmittances(&Geometry::default(), &rays), [1.0; 7]);
    }

    fn cloud() -> Geometry {
        let mut g = Geometry::default();
        for i in 0..40_000_u16 {
            let t = f32::from(i) * 0.37;
            let share = |step: f32| (f32::from(i) * step).fract() * 6.0 - 3.0;
            g.positions.push([share(0.754_877_7), share(0.569_840_3), share(0.430_159_7)]);
            g.opacities.push((t * 0.9).sin() * 2.0 - 4.0);
            g.scales.push([-1.5, -1.0, -2.0]);
            g.rotations.push([1.0, t.sin(), t.cos(), 0.3]);
        }
        g
    }

    fn through(xs: [f64; 3]) -> [Ray; 3] {
        xs.map(|x| Ray { origin: DVec3::new(x, 0.1, -9.0), direction: DVec3::Z, from: 0.2, to: 18.0 })
    }

    #[test]
    fn every_third_counts_three_times() {
        let (g, rays) = (cloud(), through([-1.0, 0.5, 1.5]));
        let all = transmittances(&g, &rays);
        for (a, b) in all.iter().zip(thinned(&g, &rays, 3)) {
            assert!((a.ln() / b.ln() - 1.0).abs() < 0.35 && *a != b, "{a} {b}");
        }
    }

    #[test]
    fn threads_do_not_matter() {
        let g = cloud();
        let rays = through([0.0, 0.5, 1.0]);
        let all = transmittances(&g, &rays);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(one.install(|| transmittances(&g, &rays)), all);
        assert!(all.iter().all(|t| *t > 1e-6 && *t < 0.99), "{all:?}");
    }
}
