//! Views around a scene without cameras.

use glam::DVec3;
use lexisplat::Geometry;

use crate::bulk::bulk;
use crate::camera::Camera;
use crate::near::near_plane;

/// Field of view along the shorter side of the picture, in degrees.
const FIELD_OF_VIEW: f64 = 50.0;
/// Mean elevation of the ring above the centre, in degrees.
const ELEVATION: f64 = 20.0;
/// Largest difference of an elevation from [`ELEVATION`], in degrees.
const ELEVATION_SWAY: f64 = 10.0;
/// Number of times that the elevation rises and falls in one turn.
const SWAYS: f64 = 3.0;
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
}
