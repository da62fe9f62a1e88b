//! Views from all around a scene without cameras, for measuring its sensitivity.

use glam::DVec3;
use lexisplat::Geometry;

use crate::bulk::least_radius;
use crate::camera::Camera;
use crate::near::near_plane;
use crate::orbit::{axes, pinhole};
use crate::subject::detail;

/// Angle between neighbouring points of a Fibonacci spiral: the golden angle.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Steps of the low-discrepancy sequences that spread distances and the points looked at. They are powers of the
/// reciprocal plastic number (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences").
pub const PLASTIC: [f64; 4] =
    [0.754_877_666_246_692_7, 0.569_840_290_998_053_2, 0.430_159_709_001_946_8, 0.324_717_957_244_746];
/// Focal length in picture widths: a field of view of 53 degrees.
const FOCAL: f64 = 1.0;
/// Largest absolute y of a direction for which the world's up can be used.
const STEEP: f64 = 0.9;

/// Returns `count` cameras of a `size` (width and height) on all sides of the scene's detail, named `surround_000`,
/// `surround_001` and so on. They look at points of the detail. `distances` are the smallest and the largest distance, in
/// radii of the detail. The same input gives the same cameras.
///
/// The detail is the region of small opaque Gaussians, because training cameras looked there. The places of training
/// cameras are not known, so some views are from behind walls or below the floor.
#[must_use]
pub fn surround(geometry: &Geometry, count: usize, size: [u32; 2], distances: [f64; 2]) -> Vec<Camera> {
    let size = size.map(|side| side.clamp(1, crate::MAX_SIDE));
    let (centre, half) = detail(geometry);
    let radius = half.length().max(least_radius(geometry, centre));
    let plane = near_plane(geometry);
    let focal = f64::from(size[0]) * FOCAL;
    let steps = u32::try_from(count).unwrap_or(u32::MAX);
    (0..steps)
        .map(|i| {
            let spread = |k: usize| (f64::from(i) * PLASTIC[k]).fract();
            let y = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(steps);
            let around = (1.0 - y * y).max(0.0).sqrt();
            let turn = f64::from(i) * GOLDEN_ANGLE;
            let (sine, cosine) = libm::sincos(turn);
            let out = DVec3::new(around * cosine, y, around * sine);
            let [near, far] = distances.map(libm::log);
            let position = centre + out * radius * libm::exp(near + spread(0) * (far - near));
            let offset = DVec3::new(spread(1), spread(2), spread(3)) * 2.0 - DVec3::ONE;
            let target = centre + offset * half.max_element();
            let forward = (target - position).normalize_or(-out);
            let up = if forward.y.abs() > STEEP { DVec3::X } else { DVec3::NEG_Y };
            pinhole(format!("surround_{i:03}"), size, focal, position, axes(forward, up)).with_near(plane)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::single;

    #[test]
    fn views_surround_the_detail_and_look_at_it() {
        // A ball of small Gaussians in a shell of large ones far away.
        let mut g = Geometry::default();
        for i in 0..2000_u16 {
            let t = f64::from(i);
            let y = 1.0 - (2.0 * t + 1.0) / 2000.0;
            let around = (1.0 - y * y).sqrt();
            let (radius, scale) = if i % 2 == 0 { (1.0, -4.0) } else { (50.0, 0.0) };
            let p = DVec3::new(around * (t * 2.4).cos(), y, around * (t * 2.4).sin()) * radius;
            g.positions.push((p + DVec3::new(5.0, -2.0, 7.0)).to_array().map(single));
            g.scales.push([scale; 3]);
            g.opacities.push(1.0);
        }
        let cameras = surround(&g, 40, [96, 64], [2.0, 12.0]);
        assert_eq!(cameras.len(), 40);
        let mut sum = DVec3::ZERO;
        for camera in &cameras {
            camera.validate().unwrap();
            let [x, y, z] = camera.to_view([5.0, -2.0, 7.0]).map(f64::from);
            let distance = (x * x + y * y + z * z).sqrt();
            assert!((1.0..15.0).contains(&distance) && z > 0.6 * distance, "{camera:?}");
            sum +=
                (DVec3::from_array(camera.position.map(f64::from)) - DVec3::new(5.0, -2.0, 7.0)) / distance;
        }
        assert!(sum.length() < 6.0, "on all sides: {sum}");
        assert_eq!(cameras, surround(&g, 40, [96, 64], [2.0, 12.0]));
        assert!(surround(&g, 0, [10, 10], [2.0, 12.0]).is_empty());
        for camera in surround(&Geometry::default(), 3, [10, 10], [2.0, 12.0]) {
            camera.validate().unwrap();
        }
    }
}
