//! Views between given cameras.

use glam::{DMat3, DQuat, DVec3};

use crate::camera::Camera;

/// Least cosine of the angle between the directions of two cameras that see the same: 60 degrees.
const SAME_DIRECTION: f64 = 0.5;

/// Returns a camera beside each of `cameras` that has others of about the same direction: at the share `t`, 0 to 1, of the way to
/// its `rank`-th nearest, where 0 is the nearest. It keeps the size of its pictures and its name. The same input gives the
/// same cameras.
#[must_use]
pub fn between(cameras: &[Camera], rank: usize, t: f64) -> Vec<Camera> {
    let all: Vec<(DVec3, DMat3)> = cameras.iter().map(pose).collect();
    let beside = |(i, camera): (usize, &Camera)| {
        let (from, axes) = all[i];
        let mut others: Vec<(f64, usize)> = (0..all.len())
            .filter(|&k| k != i && all[k].1.z_axis.dot(axes.z_axis) >= SAME_DIRECTION)
            .map(|k| (all[k].0.distance_squared(from), k))
            .collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (to, other_axes) = all[others.get(rank)?.1];
        let turned = DQuat::from_mat3(&axes).lerp(DQuat::from_mat3(&other_axes), t);
        let columns = DMat3::from_quat(turned).to_cols_array_2d();
        let rotation = std::array::from_fn(|row| columns.map(|column| column[row]));
        let made = Camera::rounded(String::new(), [1; 2], [1.0; 2], from.lerp(to, t).to_array(), rotation);
        let made = Camera { position: made.position, rotation: made.rotation, ..camera.clone() };
        made.validate().is_ok().then_some(made)
    };
    cameras.iter().enumerate().filter_map(beside).collect()
}

/// Returns the position of a camera, and its right, down and forward directions.
fn pose(camera: &Camera) -> (DVec3, DMat3) {
    let rows = camera.rotation.map(|row| DVec3::from_array(row.map(f64::from)));
    (
        DVec3::from_array(camera.position.map(f64::from)),
        DMat3::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose(),
    )
}

#[cfg(test)]
mod tests {
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::orbit::orbit;

    #[test]
    fn views_lie_between_neighbours() {
        let splats = scene(&SampleOptions::new(50, 1));
        let cameras = orbit(&splats.geometry, 24, 90, 60);
        let near = between(&cameras, 0, 0.5);
        assert_eq!(near.len(), 24);
        for (view, camera) in near.iter().zip(&cameras) {
            view.validate().unwrap();
            let distance = |to: &Camera| pose(view).0.distance(pose(to).0);
            let mut all: Vec<f64> = cameras.iter().map(distance).collect();
            all.sort_by(f64::total_cmp);
            // Half-way between two, and nearer to them than to others.
            assert!(
                (all[0] - all[1]).abs() < 1e-4 * all[0] && (distance(camera) - all[0]).abs() < 1e-4 * all[0]
            );
            assert_eq!((view.width, view.fx), (camera.width, camera.fx));
            let axes = pose(view).1;
            assert!((axes.determinant() - 1.0).abs() < 1e-5, "a rotation, not a mirror");
            assert!((axes.transpose() * axes).abs_diff_eq(DMat3::IDENTITY, 1e-5));
        }
        assert_eq!(
            between(&cameras, 0, 0.0).iter().map(|c| c.position).collect::<Vec<_>>(),
            cameras.iter().map(|c| c.position).collect::<Vec<_>>()
        );
        assert_ne!(between(&cameras, 1, 0.5), near);
    }

    #[test]
    fn cameras_without_neighbours_have_none() {
        let splats = scene(&SampleOptions::new(50, 1));
        let cameras = orbit(&splats.geometry, 2, 90, 60);
        assert!(between(&cameras[..1], 0, 0.5).is_empty() && between(&[], 0, 0.5).is_empty());
        assert!(between(&cameras, 1, 0.5).is_empty());
    }
}
