//! The near plane of views of a scene without cameras, in proportion to the size of the scene.

use std::borrow::Cow;

use lexisplat::Geometry;

use crate::bulk::size_at;
use crate::camera::{Camera, single};
use crate::subject::subject;

/// Largest distance of the near plane, in radii of the subject.
const NEAR_RADII: f64 = 0.1;
/// Largest distance of the near plane, in standard deviations of the middle Gaussian along its longest axis. A natural
/// view is at least 20 standard deviations away from the Gaussian for which it was made.
const NEAR_SIGMAS: f64 = 3.5;
/// Inverse of the share of the Gaussians that are smaller than the middle one.
const MIDDLE_SHARE: usize = 2;
/// Largest number of Gaussians from which the subject is found. Of a larger scene every second, every third and so on is
/// used.
const MOST: usize = 1 << 16;
/// Largest number of cameras that [`hidden_share`] examines, evenly chosen.
const MOST_CAMERAS: usize = 16;

/// Returns the distance of the near plane, in world units, above 0, for generated views of `geometry`. It is in
/// proportion to the radius of the scene's subject and to the size of its Gaussians, so that a scene looks the same in
/// all units.
///
/// In models with cameras of their own, `room-large` among them, it is 0.08 to 0.8 units; the trainer's is 0.2. Of the
/// area that their cameras see, 99 % is farther than 1.9 units. With a fifth of this distance some views are judged by
/// single Gaussians just before the camera, and `--psnr 38` on the sample scene of 1,500 Gaussians reached 40.2 dB
/// instead of 38.2.
#[must_use]
pub fn near_plane(geometry: &Geometry) -> f32 {
    let step = geometry.len().div_ceil(MOST).max(1);
    let some = if step == 1 { Cow::Borrowed(geometry) } else { Cow::Owned(thinned(geometry, step)) };
    let by_radius = NEAR_RADII * subject(&some).1;
    let by_size = size_at(&some, MIDDLE_SHARE).map_or(f64::INFINITY, |size| NEAR_SIGMAS * size);
    single(by_radius.min(by_size)).clamp(f32::MIN_POSITIVE, f32::MAX)
}

/// Returns every `step`-th Gaussian of `geometry`, with the values that [`subject`] reads.
fn thinned(geometry: &Geometry, step: usize) -> Geometry {
    Geometry {
        positions: geometry.positions.iter().copied().step_by(step).collect(),
        opacities: geometry.opacities.iter().copied().step_by(step).collect(),
        scales: geometry.scales.iter().copied().step_by(step).collect(),
        ..Geometry::default()
    }
}

/// Returns the share, 0 to 1, of the opacity before `cameras` that their near planes hide. A Gaussian counts if its
/// centre would be in the picture without a near plane. The share is 0 if no Gaussian counts.
#[must_use]
pub fn hidden_share(geometry: &Geometry, cameras: &[Camera]) -> f64 {
    let step = geometry.len().div_ceil(MOST).max(1);
    let stride = cameras.len().div_ceil(MOST_CAMERAS).max(1);
    let (mut all, mut hidden) = (0.0, 0.0);
    for camera in cameras.iter().step_by(stride) {
        let [width, height] = [camera.width, camera.height].map(f64::from);
        let tangents = [width / (2.0 * f64::from(camera.fx)), height / (2.0 * f64::from(camera.fy))];
        let some = geometry.positions.iter().zip(&geometry.opacities).step_by(step);
        for (position, &opacity) in some {
            let [x, y, z] = camera.to_view(*position);
            let weight = 1.0 / (1.0 + libm::exp(-f64::from(opacity)));
            let [right, down, depth] = [x, y, z].map(f64::from);
            if weight.is_finite()
                && depth > 0.0
                && right.abs() < tangents[0] * depth
                && down.abs() < tangents[1] * depth
            {
                all += weight;
                hidden += if z > camera.near { 0.0 } else { weight };
            }
        }
    }
    if all > 0.0 { hidden / all } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::straight_ahead;

    /// A plane of Gaussians across the view, `distance` before the camera at the origin.
    fn plane(distance: f32, half: f32) -> Geometry {
        let mut g = Geometry::default();
        for i in 0..400_u16 {
            let at = |k: u16| (f32::from(k) / 19.0 * 2.0 - 1.0) * half;
            g.positions.push([at(i % 20), at(i / 20), distance]);
            g.opacities.push(2.0);
            g.scales.push([(half / 20.0).ln(); 3]);
            g.rotations.push([1.0, 0.0, 0.0, 0.0]);
        }
        g
    }

    #[test]
    fn the_plane_is_in_proportion_to_the_scene() {
        let one = near_plane(&plane(5.0, 1.0));
        assert!((0.05..0.2).contains(&one), "{one}");
        for factor in [1e-4, 1e-2, 1e4] {
            let other = near_plane(&plane(5.0 * factor, factor));
            assert!((other / (one * factor) - 1.0).abs() < 1e-3, "{factor}: {other}");
        }
        // Gaussians at one place have the size of one.
        let mut pile = plane(5.0, 1.0);
        pile.positions.fill([1.0, 2.0, 3.0]);
        assert!((0.01..0.05).contains(&near_plane(&pile)), "{}", near_plane(&pile));
        for nothing in [Geometry::default(), Geometry { scales: vec![[f32::NAN; 3]], ..Geometry::default() }]
        {
            assert!(near_plane(&nothing) > 0.0);
        }
    }

    #[test]
    fn what_is_before_the_plane_is_a_share() {
        let camera = straight_ahead(100, 100, 50.0);
        let mut both = plane(0.1, 0.05);
        assert_eq!(hidden_share(&both, std::slice::from_ref(&camera)), 1.0);
        assert_eq!(hidden_share(&both, &[camera.clone().with_near(0.01)]), 0.0);
        both.positions.extend(plane(2.0, 1.0).positions);
        both.opacities.extend(plane(2.0, 1.0).opacities);
        assert!((hidden_share(&both, std::slice::from_ref(&camera)) - 0.5).abs() < 1e-6);
        assert_eq!(hidden_share(&Geometry::default(), &[camera]), 0.0);
    }
}
