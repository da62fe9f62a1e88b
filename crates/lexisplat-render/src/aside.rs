//! Views beside other views.
//!
//! People look at a scene from places beside its cameras too: from nearer, from further away and from the side.

use glam::DVec3;
use lexisplat::Geometry;

use crate::camera::Camera;
use crate::surround::PLASTIC;

/// Half the width of the middle of a picture, as a tangent. A camera's subject is searched for in this middle.
const MIDDLE: f32 = 0.15;
/// Largest weight of one Gaussian in the middle of a picture, as a share of the squared distance. Without this limit a
/// near Gaussian would cover the whole middle.
const LARGEST: f64 = 0.1;
/// Limits of a move around the subject.
struct Move {
    /// Largest angle, in radians.
    turn: f64,
    /// Smallest and largest distance of the moved camera from the subject, in distances of the camera itself.
    distances: [f64; 2],
}

/// Moves of [`aside`].
const FAR: Move = Move { turn: std::f64::consts::FRAC_PI_3, distances: [0.3, 2.0] };
/// Moves of [`nearby`].
const NEAR: Move = Move { turn: std::f64::consts::FRAC_PI_3 / 3.0, distances: [0.77, 1.3] };

/// Returns at most `count` cameras beside `cameras`. Evenly chosen cameras are moved around their subject, and towards it
/// or away from it. They keep the size of their pictures and their name. Cameras that look at nothing are skipped. The
/// same input gives the same cameras.
#[must_use]
pub fn aside(geometry: &Geometry, cameras: &[Camera], count: usize) -> Vec<Camera> {
    let stride = cameras.len().div_ceil(count.max(1)).max(1);
    let some = cameras.iter().skip(stride / 2).step_by(stride).take(count).enumerate();
    some.filter_map(|(number, camera)| {
        let moved = moved(camera, subject_distance(camera, geometry)?, number, &FAR);
        // A camera far out may be moved beyond the range of `f32`.
        moved.validate().is_ok().then_some(moved)
    })
    .collect()
}

/// Returns `rounds` times a camera near each of `cameras`: moved by up to 20 degrees around its subject, to 0.77 to 1.3 times the
/// distance, each time to another place. They keep the size of their pictures and their name. Cameras that look at nothing are
/// skipped. The same input gives the same cameras.
#[must_use]
pub fn nearby(geometry: &Geometry, cameras: &[Camera], rounds: usize) -> Vec<Vec<Camera>> {
    let distances: Vec<Option<f64>> =
        cameras.iter().map(|camera| subject_distance(camera, geometry)).collect();
    let round = |round: usize| {
        let all = cameras.iter().zip(&distances).enumerate();
        let near = all.filter_map(|(k, (camera, distance))| {
            Some(moved(camera, (*distance)?, round * cameras.len() + k, &NEAR))
        });
        near.filter(|camera| camera.validate().is_ok()).collect()
    };
    (0..rounds).map(round).collect()
}

/// Returns the `number`-th moved camera, from a camera whose subject is at `distance`.
fn moved(camera: &Camera, distance: f64, number: usize, Move { turn, distances }: &Move) -> Camera {
    let spread = |k: usize| ((number as f64 + 0.5) * PLASTIC[k]).fract();
    let [right, down, forward] =
        [0, 1, 2].map(|k| DVec3::from_array(camera.rotation.map(|row| f64::from(row[k]))));
    // The camera turns towards a direction across the line of sight. The axis perpendicular to both stays fixed.
    let (sine, cosine) = libm::sincos(std::f64::consts::TAU * spread(0));
    let [towards, level] = [cosine * right + sine * down, cosine * down - sine * right];
    let (turn_sine, turn_cosine) = libm::sincos(turn * libm::sqrt(spread(1)));
    let new_forward = turn_cosine * forward + turn_sine * towards;
    let new_towards = turn_cosine * towards - turn_sine * forward;
    let axes = [cosine * new_towards - sine * level, sine * new_towards + cosine * level, new_forward];
    let [near, far] = distances.map(libm::log);
    let subject = DVec3::from_array(camera.position.map(f64::from)) + distance * forward;
    let position = subject - distance * libm::exp(near + spread(2) * (far - near)) * new_forward;
    let rotation = std::array::from_fn(|row| axes.map(|axis| axis[row]));
    let rounded = Camera::rounded(String::new(), [1; 2], [1.0; 2], position.to_array(), rotation);
    Camera { position: rounded.position, rotation: rounded.rotation, ..camera.clone() }
}

/// Returns the distance of the subject of `camera`, in world units: half of the weight of the Gaussians that cover the
/// middle of its picture is nearer. Returns `None` if no Gaussian is there.
fn subject_distance(camera: &Camera, geometry: &Geometry) -> Option<f64> {
    let mut found: Vec<(f32, f64)> = Vec::new();
    for (position, (scales, &opacity)) in
        geometry.positions.iter().zip(geometry.scales.iter().zip(&geometry.opacities))
    {
        let [x, y, z] = camera.to_view(*position);
        if z.is_finite() && z > camera.near && x.abs() < MIDDLE * z && y.abs() < MIDDLE * z {
            let mut sorted = scales.map(f64::from);
            sorted.sort_by(f64::total_cmp);
            let size = libm::exp(sorted[1] + sorted[2]) / (f64::from(z) * f64::from(z));
            let weight = size.min(LARGEST) / (1.0 + libm::exp(-f64::from(opacity)));
            if weight.is_finite() {
                found.push((z, weight));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * found.iter().map(|f| f.1).sum::<f64>();
    let mut sum = 0.0;
    let middle = found.iter().find(|(_, weight)| {
        sum += weight;
        sum >= half
    });
    middle.map(|(z, _)| f64::from(*z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::single;
    use crate::orbit::orbit;

    /// A ball of radius 1 around (5, -2, 7).
    fn ball() -> Geometry {
        let mut g = Geometry::default();
        for i in 0..1000_u16 {
            let t = f64::from(i);
            let y = 1.0 - (2.0 * t + 1.0) / 1000.0;
            let around = (1.0 - y * y).sqrt();
            let p = DVec3::new(around * (t * 2.4).cos(), y, around * (t * 2.4).sin());
            g.positions.push((p + DVec3::new(5.0, -2.0, 7.0)).to_array().map(single));
            g.scales.push([-3.0; 3]);
            g.opacities.push(2.0);
        }
        g
    }

    #[test]
    fn views_turn_around_what_cameras_look_at() {
        let geometry = ball();
        let cameras = orbit(&geometry, 30, 90, 60);
        let views = aside(&geometry, &cameras, 10);
        assert_eq!(views.len(), 10);
        let (mut nearest, mut farthest) = (f64::INFINITY, 0.0_f64);
        for (k, view) in views.iter().enumerate() {
            view.validate().unwrap();
            let of = &cameras[1 + 3 * k];
            assert_eq!((&view.name, view.width, view.fx), (&of.name, of.width, of.fx));
            // The two pictures have the same point in the middle.
            let distance = subject_distance(of, &geometry).unwrap();
            let forward = |camera: &Camera| DVec3::from_array(camera.rotation.map(|row| f64::from(row[2])));
            let subject = DVec3::from_array(of.position.map(f64::from)) + distance * forward(of);
            let [x, y, z] = view.to_view(subject.to_array().map(single)).map(f64::from);
            assert!(x.abs() < 1e-3 * z && y.abs() < 1e-3 * z, "{x} {y} {z}");
            assert!(forward(of).dot(forward(view)) > 0.499);
            (nearest, farthest) = (nearest.min(z / distance), farthest.max(z / distance));
            let r = &view.rotation;
            let cross = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1])
                - r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0])
                + r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
            assert!((cross - 1.0).abs() < 1e-4, "a rotation, not a mirror");
        }
        assert!(nearest < 0.5 && farthest > 1.3, "{nearest} {farthest}");
        assert_eq!(views, aside(&geometry, &cameras, 10));
        assert_eq!(aside(&geometry, &cameras[..2], 10).len(), 2);
    }

    #[test]
    fn views_nearby_are_in_other_places_each_round() {
        let geometry = ball();
        let cameras = orbit(&geometry, 12, 90, 60);
        let rounds = nearby(&geometry, &cameras, 3);
        assert_eq!(rounds.iter().map(Vec::len).collect::<Vec<_>>(), [12; 3]);
        for (k, of) in cameras.iter().enumerate() {
            let distance = subject_distance(of, &geometry).unwrap();
            for view in rounds.iter().map(|round| &round[k]) {
                view.validate().unwrap();
                let moved = (0..3).map(|i| (view.position[i] - of.position[i]).powi(2)).sum::<f32>().sqrt();
                // 20 degrees at 1.3 times the distance.
                assert!(moved > 0.0 && f64::from(moved) < 0.6 * distance, "{moved} {distance}");
            }
            assert!(rounds[0][k].position != rounds[1][k].position);
        }
        assert!(nearby(&Geometry::default(), &cameras, 2).iter().all(Vec::is_empty));
    }

    #[test]
    fn cameras_that_look_at_nothing_have_none() {
        let geometry = ball();
        let mut camera = orbit(&geometry, 1, 90, 60).remove(0);
        assert!(aside(&geometry, std::slice::from_ref(&camera), 0).is_empty());
        assert!(aside(&geometry, &[], 3).is_empty());
        assert!(aside(&Geometry::default(), std::slice::from_ref(&camera), 3).is_empty());
        camera.rotation.iter_mut().for_each(|row| *row = [-row[0], row[1], -row[2]]);
        assert!(aside(&geometry, std::slice::from_ref(&camera), 3).is_empty());
    }
}
