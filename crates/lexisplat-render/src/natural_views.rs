//! Views of each region of a scene from likely places of photographs of it.
//!
//! Training makes Gaussians as small as the photographs need: in a photograph the size of a Gaussian is a certain share
//! of its distance. The size of a Gaussian therefore tells how far away the camera may have been.

use glam::DVec3;
use lexisplat::Geometry;

use crate::bulk::opacity_weights;
use crate::camera::Camera;
use crate::near::near_plane;
use crate::orbit::{axes, pinhole};
use crate::surround::PLASTIC;
use crate::transmittance::unit_rotation;

/// Logarithm of a Gaussian's distance from the nearest and from the farthest camera, in its largest standard deviations.
/// The mean of the Gaussians in a photograph of 400 pixels is 2.6 to 5.1 (20 to 173 views each of six scenes;
/// docs/METHOD.md). A model trained at three times that width has Gaussians of a third of the size, so the logarithm is
/// ln 3 = 1.1 larger.
const DISTANCES: [f64; 2] = [3.0, 6.6];
/// Focal lengths in picture widths, which are used in turn: fields of view of 84, 67, 56 and 42 degrees.
const FOCALS: [f64; 4] = [0.55, 0.75, 0.95, 1.3];
/// Largest absolute y of a direction for which the world's up can be used.
const STEEP: f64 = 0.95;

/// Returns at most `count` cameras of a `size` (width and height), named `natural_000`, `natural_001` and so on. Each
/// camera looks at a Gaussian from its natural distance, mostly at its flat side. Opaque Gaussians are chosen more often.
/// Walls and other Gaussians may be in the way. The same input gives the same cameras.
///
/// A scene that is moved, turned or scaled has the same views, except for their rotation about the line of sight.
#[must_use]
pub fn natural_views(geometry: &Geometry, count: usize, size: [u32; 2]) -> Vec<Camera> {
    let size = size.map(|side| side.clamp(1, crate::MAX_SIDE));
    let (weights, near) = (opacity_weights(geometry), near_plane(geometry));
    let total: f64 = weights.iter().filter(|w| w.is_finite()).sum();
    let mut out = Vec::with_capacity(count);
    let mut sum = 0.0;
    for (i, weight) in weights.iter().enumerate().filter(|(_, w)| w.is_finite()) {
        sum += weight;
        // Gaussians are chosen evenly over the cumulative sum of the weights.
        while out.len() < count && sum * count as f64 > (out.len() as f64 + 0.5) * total {
            let Some(camera) = natural_view(geometry, i, out.len(), size) else { break };
            out.push(camera.with_near(near));
        }
    }
    out
}

/// Returns the `number`-th view, which looks at Gaussian `i`; `None` if its numbers are too large for a camera.
fn natural_view(geometry: &Geometry, i: usize, number: usize, size: [u32; 2]) -> Option<Camera> {
    let spread = |k: usize| (number as f64 * PLASTIC[k]).fract();
    let scales = geometry.scales[i].map(f64::from);
    let shortest = (0..3).min_by(|&a, &b| scales[a].total_cmp(&scales[b])).unwrap_or(0);
    let largest = scales.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let distance = libm::exp(largest + DISTANCES[0] + (DISTANCES[1] - DISTANCES[0]) * spread(0));
    if !(distance > 0.0 && distance < f64::from(f32::MAX)) {
        return None;
    }
    // Directions are spread by the cosine of the angle to the flat side, on both sides of the Gaussian.
    let [sine, cosine] = [libm::sqrt(1.0 - spread(1)), libm::sqrt(spread(1))];
    let (turn_sine, turn_cosine) = libm::sincos(std::f64::consts::TAU * spread(2));
    let side = if number.is_multiple_of(2) { cosine } else { -cosine };
    let mut direction = [0.0; 3];
    direction[shortest] = side;
    direction[(shortest + 1) % 3] = sine * turn_cosine;
    direction[(shortest + 2) % 3] = sine * turn_sine;
    let out = (unit_rotation(geometry.rotations[i]) * DVec3::from_array(direction)).normalize_or(DVec3::Z);
    let position = DVec3::from_array(geometry.positions[i].map(f64::from)) + out * distance;
    let up = if out.y.abs() > STEEP { DVec3::X } else { DVec3::NEG_Y };
    let focal = f64::from(size[0]) * FOCALS[number % FOCALS.len()];
    let camera = pinhole(format!("natural_{number:03}"), size, focal, position, axes(-out, up));
    camera.validate().is_ok().then_some(camera)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::single;

    #[test]
    fn each_view_is_at_a_natural_distance_of_an_opaque_gaussian() {
        let mut g = Geometry::default();
        for i in 0..300_u16 {
            let t = f64::from(i);
            g.positions.push([t, (t * 0.7).sin() * 9.0, (t * 1.3).cos() * 9.0].map(single));
            g.scales.push([-2.0, -4.0, single(-1.0 - t / 300.0)]);
            g.rotations.push([0.5, single(t), -1.0, 0.3]);
            g.opacities.push(if i % 3 == 0 { 4.0 } else { -40.0 });
        }
        let views = natural_views(&g, 40, [96, 64]);
        assert_eq!(views.len(), 40);
        assert_eq!(views, natural_views(&g, 40, [96, 64]));
        for camera in &views {
            camera.validate().unwrap();
            // Opaque Gaussians in the middle of the picture, by the logarithm of their distance in their sizes.
            let seen = (0..300).step_by(3).filter_map(|i| {
                let [x, y, z] = camera.to_view(g.positions[i]).map(f64::from);
                let size = f64::from(g.scales[i][2].max(g.scales[i][0]));
                (z > 0.0 && x.hypot(y) < 1e-3 * z).then(|| z.ln() - size)
            });
            assert!(seen.into_iter().any(|d| (2.99..6.61).contains(&d)), "{camera:?}");
        }
    }

    #[test]
    fn impossible_gaussians_have_no_views() {
        let mut g = Geometry::default();
        assert!(natural_views(&g, 3, [96, 64]).is_empty());
        g.positions = vec![[0.0; 3]; 4];
        g.rotations = vec![[0.0; 4]; 4];
        g.opacities = vec![f32::NAN, 1.0, 1.0, 1.0];
        g.scales = vec![[0.0; 3], [90.0; 3], [f32::NAN; 3], [1.0; 3]];
        for camera in natural_views(&g, 9, [96, 64]) {
            camera.validate().unwrap();
        }
    }
}
