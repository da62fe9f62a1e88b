//! The upward direction of a scene without cameras.

use glam::DVec3;
use lexisplat::Geometry;

use crate::camera::{Camera, single};
use crate::transmittance::unit_rotation;

/// The upward direction of most scenes, roughly: trainers keep COLMAP's world, whose y points down.
const USUAL: DVec3 = DVec3::NEG_Y;
/// Cosine of the largest angle between a scene's upward direction and the usual one: 30 degrees. Without a limit, walls and
/// lying objects decide.
const NEAR_USUAL: f64 = 0.866;
/// Number of directions that are tried. Neighbours are about 2 degrees apart.
const TRIED: u32 = 512;
/// Cosine of the largest angle between a direction and a normal that counts for it: 10 degrees.
const AGREES: f64 = 0.985;
/// Least share of the area whose normals agree with the upward direction. Of normals in all directions 1.5 % agree.
const LEAST_SHARE: f64 = 0.05;
/// Number of Gaussians whose normals are looked at, evenly chosen.
const ASKED: usize = 4096;
/// Least difference of the logarithms of the two smallest sizes of a flat Gaussian.
const FLAT: f64 = 1.0;
/// Inverse of the share of Gaussians whose area counts as no larger than that of the others, so that no single one decides.
const LARGE_SHARE: usize = 10;
/// Angle between neighbouring points of a Fibonacci spiral: the golden angle, in radians.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Largest absolute cosine between up and the direction of a view that is levelled.
const STEEP: f64 = 0.95;

/// Returns the upward direction of `geometry`, a unit vector: the direction near world -y with which the normals of most of the
/// flat area agree, as those of floors and tables do. Returns world -y if few agree.
#[must_use]
pub fn upward(geometry: &Geometry) -> [f64; 3] {
    let normals = normals(geometry);
    let total: f64 = normals.iter().map(|(_, area)| area).sum();
    let area = |direction: DVec3| -> f64 {
        normals.iter().filter(|(normal, _)| normal.dot(direction).abs() > AGREES).map(|(_, area)| area).sum()
    };
    let tried = (0..TRIED).map(|k| {
        // Even over the cap around the usual direction.
        let cosine = 1.0 - (1.0 - NEAR_USUAL) * f64::from(k) / f64::from(TRIED);
        let (sin, cos) = libm::sincos(GOLDEN_ANGLE * f64::from(k));
        let sine = libm::sqrt(1.0 - cosine * cosine);
        USUAL * cosine + DVec3::X * (sine * cos) + DVec3::Z * (sine * sin)
    });
    let best =
        tried.map(|direction| (area(direction), direction)).reduce(|a, b| if b.0 > a.0 { b } else { a });
    match best {
        Some((area, direction)) if area > LEAST_SHARE * total => direction.to_array(),
        _ => USUAL.to_array(),
    }
}

/// Returns the normals of flat opaque Gaussians, and their areas up to a factor.
fn normals(geometry: &Geometry) -> Vec<(DVec3, f64)> {
    let opaque: Vec<usize> = (0..geometry.len()).filter(|&i| geometry.opacities[i] > 0.0).collect();
    let step = opaque.len().div_ceil(ASKED).max(1);
    let mut out: Vec<(DVec3, f64)> =
        opaque.iter().step_by(step).filter_map(|&i| normal(geometry, i)).collect();
    let mut areas: Vec<f64> = out.iter().map(|(_, area)| *area).collect();
    areas.sort_by(f64::total_cmp);
    let most = areas.get(areas.len() - areas.len() / LARGE_SHARE - usize::from(!areas.is_empty())).copied();
    out.iter_mut().for_each(|(_, area)| *area = area.min(most.unwrap_or(0.0)));
    out
}

/// Returns the normal and the area of Gaussian `i`; `None` if it is not flat.
fn normal(geometry: &Geometry, i: usize) -> Option<(DVec3, f64)> {
    let scales = geometry.scales[i].map(f64::from);
    let shortest = (0..3).min_by(|&a, &b| scales[a].total_cmp(&scales[b]))?;
    let [a, b] = [1, 2].map(|k| scales[(shortest + k) % 3]);
    let normal = unit_rotation(geometry.rotations[i]) * DVec3::AXES[shortest];
    let area = libm::exp(a + b);
    (a.min(b) - scales[shortest] > FLAT && area.is_finite() && normal.is_finite()).then_some((normal, area))
}

/// Returns `camera`, turned about its line of sight until it is level in a world with this upward direction. A camera that looks
/// steeply up or down stays as it is.
#[must_use]
pub fn levelled(camera: Camera, up: [f64; 3]) -> Camera {
    let up = DVec3::from_array(up);
    let forward = DVec3::from_array(camera.rotation.map(|row| f64::from(row[2])));
    if forward.dot(up).abs() > STEEP {
        return camera;
    }
    let right = forward.cross(up).normalize();
    let down = forward.cross(right);
    let rotation = [0, 1, 2].map(|row| [right[row], down[row], forward[row]].map(single));
    let turned = Camera { rotation, ..camera.clone() };
    if turned.validate().is_ok() { turned } else { camera }
}

#[cfg(test)]
mod tests {
    use crate::orbit::orbit;

    use super::*;

    /// Flat Gaussians on a floor whose normal is `up`, and as many in all directions.
    fn floor(up: DVec3) -> Geometry {
        let mut g = Geometry::default();
        let turn = glam::DQuat::from_rotation_arc(DVec3::Y, up);
        for i in 0..600_u16 {
            let t = f64::from(i);
            g.positions.push([t.sin(), t.cos(), (0.7 * t).sin()].map(single));
            let any = glam::DQuat::from_euler(glam::EulerRot::XYZ, 1.7 * t, 2.3 * t, 0.9 * t);
            let q = if i % 2 == 0 { turn } else { any };
            g.rotations.push([q.w, q.x, q.y, q.z].map(single));
            g.scales.push([-3.0, -6.0, -3.0]);
            g.opacities.push(2.0);
        }
        g
    }

    #[test]
    fn floors_tell_the_upward_direction() {
        for tilt in [0.0, 0.2, -0.4] {
            let wanted = DVec3::new(f64::sin(tilt), -f64::cos(tilt), 0.0);
            let found = DVec3::from_array(upward(&floor(wanted)));
            assert!(found.dot(wanted) > 0.98, "{tilt}: {found}");
        }
        // A wall, and nothing at all.
        assert!(upward(&floor(DVec3::X))[1] < -NEAR_USUAL);
        assert_eq!(upward(&Geometry::default()), [0.0, -1.0, 0.0]);
    }

    #[test]
    fn views_are_levelled() {
        let up = DVec3::new(0.3, -0.9, 0.1).normalize();
        for camera in orbit(&floor(up), 7, 30, 20) {
            let level = levelled(camera.clone(), up.to_array());
            level.validate().unwrap();
            let column = |k: usize| DVec3::from_array(level.rotation.map(|row| f64::from(row[k])));
            assert!(column(0).dot(up).abs() < 1e-6 && column(1).dot(up) < 0.0);
            assert_eq!(level.rotation.map(|row| row[2]), camera.rotation.map(|row| row[2]));
        }
    }
}
