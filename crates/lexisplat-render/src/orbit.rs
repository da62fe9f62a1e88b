//! Views around a scene without cameras.

use glam::DVec3;
use lexisplat::Geometry;

use crate::camera::Camera;
use crate::near::near_plane;

/// Share of the opacity at either end of each axis that is outside of the bulk. Floaters and far backgrounds are many
/// Gaussians, but have little opacity.
pub(crate) const TRIM: f64 = 0.2;
/// Field of view along the shorter side of the picture, in degrees.
const FIELD_OF_VIEW: f64 = 50.0;
/// Mean elevation of the ring above the centre, in degrees.
const ELEVATION: f64 = 20.0;
/// Largest difference of an elevation from [`ELEVATION`], in degrees.
const ELEVATION_SWAY: f64 = 10.0;
/// Number of times that the elevation rises and falls in one turn.
const SWAYS: f64 = 3.0;
/// Radius of the bulk, in half diagonals of the trimmed box. It leaves a little space around the box.
const AIR: f64 = 1.2;
/// Smallest radius, in standard deviations of a small Gaussian, for scenes whose Gaussians are all at about one place.
const LEAST_SIGMAS: f64 = 3.0;
/// Inverse of the share of the Gaussians that are smaller than the small Gaussian.
const SMALL_SHARE: usize = 10;
/// Smallest radius, as a share of the distance of the centre from the origin: 8 units in the last place of a position.
const LEAST_SHARE: f64 = 1e-6;
/// Radius of a scene without any size, in world units.
const NO_RADIUS: f64 = 1e-3;
/// Largest absolute natural logarithm of a standard deviation. Logarithms are clamped to it, so that their sums are
/// finite.
const MAX_LOG_SCALE: f64 = 60.0;
/// The direction up in the world. Scenes trained from COLMAP's cameras are about upright with y down.
pub(crate) const UP: DVec3 = DVec3::NEG_Y;

/// Returns `count` cameras on a ring around the bulk of `geometry`, named `orbit_000`, `orbit_001` and so on. The ring
/// rises and falls, and all cameras look at its centre. The same input gives the same cameras.
///
/// The bulk is the region of most of the opacity, so floaters do not count. Its radius fits the field of view. World y is
/// assumed to point down, as in scenes trained from COLMAP's cameras.
#[must_use]
pub fn orbit(geometry: &Geometry, count: usize, width: u32, height: u32) -> Vec<Camera> {
    ring(bulk(geometry), count, [width, height], near_plane(geometry))
}

/// Returns cameras like [`orbit`] around a centre, at a distance from which a ball of the radius fits the field of view.
pub(crate) fn ring(
    (centre, radius): ([f64; 3], f64),
    count: usize,
    size: [u32; 2],
    near: f32,
) -> Vec<Camera> {
    let size = size.map(|side| side.clamp(1, crate::MAX_SIDE));
    let centre = DVec3::from_array(centre);
    let half_view = (FIELD_OF_VIEW / 2.0).to_radians();
    let focal = f64::from(size[0].min(size[1])) / 2.0 / libm::tan(half_view);
    let distance = radius / libm::sin(half_view);
    let steps = u32::try_from(count).unwrap_or(u32::MAX);
    (0..steps)
        .map(|i| {
            let turn = f64::from(i) / f64::from(steps) * std::f64::consts::TAU;
            let elevation = (ELEVATION + ELEVATION_SWAY * libm::sin(SWAYS * turn)).to_radians();
            let around = DVec3::new(libm::sin(turn), 0.0, -libm::cos(turn));
            let out = around * libm::cos(elevation) + UP * libm::sin(elevation);
            pinhole(format!("orbit_{i:03}"), size, focal, centre + out * distance, axes(-out, UP))
                .with_near(near)
        })
        .collect()
}

/// Returns the right, down and forward axes of a camera that looks along `forward`. `up` is a direction that points up in
/// the picture. It must not be parallel to `forward`.
pub(crate) fn axes(forward: DVec3, up: DVec3) -> [DVec3; 3] {
    let right = forward.cross(up).normalize();
    [right, forward.cross(right), forward]
}

/// Returns the generated camera with this width, height and focal length, in pixels. `axes` are its right, down and
/// forward axes.
pub(crate) fn pinhole(name: String, size: [u32; 2], focal: f64, position: DVec3, axes: [DVec3; 3]) -> Camera {
    let rotation = std::array::from_fn(|row| axes.map(|axis| axis[row]));
    Camera::rounded(name, size, [focal; 2], position.to_array(), rotation)
}

/// Returns the centre and radius, in world units, of the region of most of the opacity. The radius is above 0.
#[must_use]
pub fn bulk(geometry: &Geometry) -> ([f64; 3], f64) {
    let (centre, half) = middle(geometry, &opacity_weights(geometry), TRIM);
    (centre.to_array(), (half.length() * AIR).max(least_radius(geometry, centre)))
}

/// Returns the radius, above 0, of a scene around `centre` whose Gaussians are all at about one place.
pub(crate) fn least_radius(geometry: &Geometry, centre: DVec3) -> f64 {
    let Some(size) = size_at(geometry, SMALL_SHARE) else { return NO_RADIUS };
    (LEAST_SIGMAS * size).max(LEAST_SHARE * centre.length())
}

/// Returns the standard deviation along the longest axis, in world units, of the Gaussian at the `1 / share` quantile of
/// sizes. Returns `None` if no size is finite. `share` must be 2 or more.
pub(crate) fn size_at(geometry: &Geometry, share: usize) -> Option<f64> {
    let largest = |scales: &[f32; 3]| scales.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
    let mut sizes: Vec<f32> = geometry.scales.iter().map(largest).filter(|size| size.is_finite()).collect();
    if sizes.is_empty() {
        return None;
    }
    let place = sizes.len() / share;
    let size = f64::from(*sizes.select_nth_unstable_by(place, f32::total_cmp).1);
    Some(libm::exp(size.clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE)))
}

/// Returns the opacities after the sigmoid.
pub(crate) fn opacity_weights(geometry: &Geometry) -> Vec<f64> {
    geometry.opacities.iter().map(|&o| 1.0 / (1.0 + libm::exp(f64::from(-o)))).collect()
}

/// Returns the weighted median of the positions, and half the extent along each axis. The share `trim` of the weight at
/// either end is excluded from the extent.
pub(crate) fn middle(geometry: &Geometry, weights: &[f64], trim: f64) -> (DVec3, DVec3) {
    let spans: [[f64; 3]; 3] = std::array::from_fn(|axis| {
        let values = geometry.positions.iter().map(|p| f64::from(p[axis]));
        quantiles(values.zip(weights.iter().copied()), [trim, 0.5, 1.0 - trim])
    });
    let centre = DVec3::from_array(spans.map(|[_, median, _]| median));
    (centre, DVec3::from_array(spans.map(|[low, _, high]| (high - low) / 2.0)))
}

/// Returns the values below which the given shares of the weight lie; 0 if there are no values. Pairs of a value and a
/// weight that are not finite do not count.
fn quantiles<const N: usize>(values: impl Iterator<Item = (f64, f64)>, shares: [f64; N]) -> [f64; N] {
    let mut sorted: Vec<(f64, f64)> = values.filter(|(v, w)| v.is_finite() && w.is_finite()).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = sorted.iter().map(|(_, w)| w).sum();
    shares.map(|share| {
        let mut sum = 0.0;
        let found = sorted.iter().find(|(_, weight)| {
            sum += weight;
            sum >= share * total
        });
        found.or(sorted.last()).map_or(0.0, |(value, _)| *value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud() -> Geometry {
        // A cube of side 2 around (5, -3, 1), and floaters far away.
        let mut positions = Vec::new();
        for i in 0_u16..1000 {
            let (x, y, z) = (i % 10, i / 10 % 10, i / 100);
            let at = |v: u16, centre: f32| centre + (f32::from(v) - 4.5) / 4.5;
            positions.push([at(x, 5.0), at(y, -3.0), at(z, 1.0)]);
        }
        positions.extend([[1e4, 1e5, -1e6]; 20]);
        let n = positions.len();
        Geometry {
            positions,
            dc: vec![[0.0; 3]; n],
            opacities: vec![2.0; n],
            scales: vec![[-3.0; 3]; n],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
            ..Geometry::default()
        }
    }

    #[test]
    fn every_view_is_upright_and_shows_the_bulk() {
        let geometry = cloud();
        let cameras = orbit(&geometry, 12, 320, 200);
        assert_eq!(cameras.len(), 12);
        assert_eq!(cameras[7].name, "orbit_007");
        for camera in &cameras {
            camera.validate().unwrap();
            // Right is level, and what is above in the world (smaller y) is above in the picture.
            assert!(camera.rotation[1][0].abs() < 1e-6 && camera.rotation[1][1] > 0.5);
            let r = &camera.rotation;
            let cross = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1])
                - r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0])
                + r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
            assert!((cross - 1.0).abs() < 1e-5, "a rotation, not a mirror");
            let inside = geometry.positions[..1000].iter().filter(|p| {
                let [x, y, z] = camera.to_view(**p);
                z > camera.near && (x / z * camera.fx).abs() < 160.0 && (y / z * camera.fy).abs() < 100.0
            });
            assert!(inside.count() >= 900);
        }
        assert_eq!(cameras, orbit(&geometry, 12, 320, 200));
    }

    #[test]
    fn degenerate_scenes_still_give_cameras() {
        let one = Geometry {
            positions: vec![[1.0, f32::NAN, 3.0]],
            dc: vec![[0.0; 3]],
            opacities: vec![f32::NAN],
            scales: vec![[0.0; 3]],
            rotations: vec![[0.0; 4]],
            ..Geometry::default()
        };
        for geometry in [Geometry::default(), one] {
            for camera in orbit(&geometry, 3, 0, 10) {
                camera.validate().unwrap();
            }
        }
        assert!(orbit(&cloud(), 0, 10, 10).is_empty());
    }

    #[test]
    fn quantiles_weigh() {
        let pairs = [(3.0, 1.0), (1.0, 1.0), (2.0, 2.0), (f64::NAN, 9.0)];
        assert_eq!(quantiles(pairs.into_iter(), [0.0, 0.25, 0.5, 0.75, 1.0]), [1.0, 1.0, 2.0, 2.0, 3.0]);
    }
}
