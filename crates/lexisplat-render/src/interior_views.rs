//! Views from inside a scene without cameras, and the test for scenes that should be seen from inside.

use glam::DVec3;
use lexisplat::Geometry;

use crate::bulk::{TRIM, bulk, middle, opacity_weights};
use crate::camera::Camera;
use crate::near::near_plane;
use crate::object::object;
use crate::orbit::{UP, axes, pinhole};
use crate::subject::{detail, subject};
use crate::surround::PLASTIC;
use crate::transmittance::{Ray, transmittances};

/// Number of tried views of [`object`].
const TRIED_VIEWS: usize = 8;
/// Number of Gaussians that each tried view should see.
const TARGETS: usize = 24;
/// Distance before its target at which a line of sight ends, in radii of the subject. The target's neighbours on the same
/// surface are therefore not in the way.
const SHORT: f64 = 0.1;
/// Smallest share of light that must arrive from a target that is seen.
const SEEN: f64 = 0.5;
/// Largest share of free lines from outside in an interior. It is 0.34 to 0.66 for real objects, with and without a
/// background (bonsai, snowmiku, flowers, leica, fruit), and 0 for a made-up room.
const FEW: f64 = 0.15;

/// Smallest share of free lines from inside in an interior. It is at most 0.5 for the sample scene, whose objects hide
/// each other when they are made of few Gaussians, and 1 for a made-up room.
const MANY: f64 = 0.7;

/// Number of tried places of cameras.
const PLACES: u32 = 32;
/// Largest distance of tried places from the centre to either side, in half extents of the bulk.
const ASIDE: f64 = 0.7;
/// Largest height of tried places above the centre, in half extents of the bulk. No place is below the centre, because
/// floors are there, and the space below a floor is free only because no training camera saw it.
const ABOVE: f64 = 0.5;
/// Number of directions in which the way from a place is tested.
const DIRECTIONS: u32 = 8;
/// Length of these ways, in radii of the bulk.
const FREE: f64 = 0.5;
/// Lines that must be free before a view: the line through its middle, and lines this far to the right of it and below
/// it, as tangents of the angle.
const BUNDLE: [[f64; 2]; 5] = [[0.0, 0.0], [0.4, 0.3], [-0.4, 0.3], [0.4, -0.3], [-0.4, -0.3]];
/// Largest number of places from which views are taken.
const STANDS: usize = 3;
/// Smallest ratio of the free ways of a used place to those of the best place.
const GOOD: f64 = 0.8;
/// Smallest share of light on the way of a view. With less light the view is taken from another place.
const CLEAR: f64 = 0.8;
/// Field of view along the shorter side of the picture, in degrees.
const FIELD_OF_VIEW: f64 = 60.0;
/// Elevations of the views, in turn, in degrees.
const PITCH: [f64; 3] = [0.0, -12.0, 8.0];

/// Returns whether `geometry` should be seen from inside: walls hide nearly all of its detail from the cameras of
/// [`object`], and most of the detail is visible from the places of [`interior_views`].
#[must_use]
pub fn is_interior(geometry: &Geometry) -> bool {
    let (targets, near) = (targets(geometry), f64::from(near_plane(geometry)));
    let around: Vec<DVec3> = object(geometry, TRIED_VIEWS, 1, 1)
        .iter()
        .map(|camera| DVec3::from_array(camera.position.map(f64::from)))
        .collect();
    if seen(geometry, &around, &targets, near).is_none_or(|share| share >= FEW) {
        return false;
    }
    let (_, radius) = bulk(geometry);
    seen(geometry, &stands(geometry, radius, near), &targets, near).is_some_and(|share| share >= MANY)
}

/// Returns the share of the lines from `places` to `targets` that are free beyond the distance `from`; `None` if there
/// are no lines.
fn seen(geometry: &Geometry, places: &[DVec3], targets: &[DVec3], from: f64) -> Option<f64> {
    let (_, radius) = subject(geometry);
    let mut lines = Vec::with_capacity(places.len() * targets.len());
    for &origin in places {
        lines.extend(targets.iter().map(|target| {
            let way = target - origin;
            let to = way.length() - SHORT * radius;
            Ray { origin, direction: way.normalize_or_zero(), from, to }
        }));
    }
    let free = transmittances(geometry, &lines).iter().filter(|light| **light >= SEEN).count();
    (!lines.is_empty()).then(|| free as f64 / lines.len() as f64)
}

/// Returns the centres of up to [`TARGETS`] opaque Gaussians of the detail, chosen evenly in the order of the file.
fn targets(geometry: &Geometry) -> Vec<DVec3> {
    let (centre, half) = detail(geometry);
    let all: Vec<DVec3> = geometry
        .positions
        .iter()
        .zip(&geometry.opacities)
        .filter(|(_, opacity)| **opacity > 0.0)
        .map(|(position, _)| DVec3::from_array(position.map(f64::from)))
        .filter(|position| (position - centre).abs().cmple(half).all())
        .collect();
    let step = all.len().div_ceil(TARGETS).max(1);
    all.into_iter().step_by(step).collect()
}

/// Returns `count` upright cameras inside `geometry` that look outwards all around. Their names are `room_000`,
/// `room_001` and so on. They stand at a few places near the middle of the bulk with little in front of them. World y is
/// assumed to point down, as in [`crate::orbit`]. The same input gives the same cameras.
#[must_use]
pub fn interior_views(geometry: &Geometry, count: usize, width: u32, height: u32) -> Vec<Camera> {
    let size = [width, height].map(|side| side.clamp(1, crate::MAX_SIDE));
    let focal = f64::from(size[0].min(size[1])) / 2.0 / libm::tan((FIELD_OF_VIEW / 2.0).to_radians());
    let steps = u32::try_from(count).unwrap_or(u32::MAX);
    let (_, radius) = bulk(geometry);
    let near = near_plane(geometry);
    let stands = stands(geometry, radius, f64::from(near));
    let looks: Vec<[DVec3; 3]> = (0..steps).map(|i| axes(look(i, steps), UP)).collect();
    let light = free_ways(geometry, &stands, &looks, [f64::from(near), radius]);
    let light = |stand: usize, look: usize| light[stand * looks.len() + look];
    (0..steps)
        .zip(&looks)
        .enumerate()
        .map(|(at, (i, columns))| {
            // Places are used in turn, unless something is in the way.
            let own = at % stands.len();
            let best = (0..stands.len()).fold(own, |a, b| if light(b, at) > light(a, at) { b } else { a });
            let stand = if light(own, at) >= CLEAR { own } else { best };
            pinhole(format!("room_{i:03}"), size, focal, stands[stand], *columns).with_near(near)
        })
        .collect()
}

/// Returns direction `i` of `count` directions. They go around once, with the elevations in turn.
fn look(i: u32, count: u32) -> DVec3 {
    let (sine, cosine) = libm::sincos(f64::from(i) / f64::from(count) * std::f64::consts::TAU);
    let (up, level) = libm::sincos(PITCH[i as usize % PITCH.len()].to_radians());
    DVec3::new(sine, 0.0, -cosine) * level + UP * up
}

/// Returns for each place the mean share of light left on the ways along all directions. The ways begin at the distance
/// `from`.
fn free_ways(
    geometry: &Geometry,
    places: &[DVec3],
    looks: &[[DVec3; 3]],
    [from, radius]: [f64; 2],
) -> Vec<f64> {
    let mut rays = Vec::with_capacity(places.len() * looks.len() * BUNDLE.len());
    for &origin in places {
        for [right, down, forward] in looks {
            rays.extend(BUNDLE.map(|[x, y]| {
                let direction = (forward + right * x + down * y).normalize();
                Ray { origin, direction, from, to: from + FREE * radius }
            }));
        }
    }
    let light = transmittances(geometry, &rays);
    light.chunks_exact(BUNDLE.len()).map(|bundle| bundle.iter().sum::<f64>() / BUNDLE.len() as f64).collect()
}

/// Returns one to [`STANDS`] places: the freest place, then places that are about as free and farthest from the others.
fn stands(geometry: &Geometry, radius: f64, near: f64) -> Vec<DVec3> {
    let (centre, half) = middle(geometry, &opacity_weights(geometry), TRIM);
    let places: Vec<DVec3> = (0..PLACES)
        .map(|i| {
            // The first place is above the centre of the bulk.
            let share = |k: usize| (0.5 + f64::from(i) * PLASTIC[k]).fract();
            let aside = |k: usize| ASIDE * (2.0 * share(k) - 1.0);
            centre + half * (DVec3::new(aside(0), 0.0, aside(2)) + UP * ABOVE * share(1))
        })
        .collect();
    let looks: Vec<[DVec3; 3]> = (0..DIRECTIONS).map(|i| axes(look(i, DIRECTIONS), UP)).collect();
    let light = free_ways(geometry, &places, &looks, [near, radius]);
    let scores: Vec<f64> = light.chunks_exact(looks.len()).map(|ways| ways.iter().sum()).collect();
    let best = (0..places.len()).fold(0, |a, b| if scores[b] > scores[a] { b } else { a });
    let mut chosen = vec![places[best]];
    while chosen.len() < STANDS {
        let apart = |i: usize| chosen.iter().map(|c| c.distance(places[i])).fold(f64::INFINITY, f64::min);
        let good = (0..places.len()).filter(|&i| scores[i] >= GOOD * scores[best] && apart(i) > 0.0);
        let Some(next) = good.max_by(|&a, &b| apart(a).total_cmp(&apart(b))) else { break };
        chosen.push(places[next]);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::single;

    fn put(g: &mut Geometry, at: [f64; 3], scale: f64, opacity: f32) {
        g.positions.push(at.map(single));
        g.scales.push([single(scale.ln()); 3]);
        g.opacities.push(opacity);
        g.rotations.push([1.0, 0.0, 0.0, 0.0]);
    }

    /// Share `i` of a sequence that covers an interval evenly.
    fn share(i: u16, k: usize) -> f64 {
        (f64::from(i) * PLASTIC[k]).fract()
    }

    /// A vase on a table, and a background that is far and thin.
    fn still_life() -> Geometry {
        let mut g = Geometry::default();
        for i in 0..1500 {
            let (turn, high) = (std::f64::consts::TAU * share(i, 0), share(i, 1));
            put(&mut g, [0.5 * turn.cos(), -high, 0.5 * turn.sin()], 0.03, 4.0);
            put(&mut g, [4.0 * share(i, 0) - 2.0, 0.0, 4.0 * share(i, 1) - 2.0], 0.08, 4.0);
        }
        for i in 0..300 {
            let (turn, y) = (std::f64::consts::TAU * share(i, 0), 1.6 * share(i, 1) - 0.8);
            let level = (1.0 - y * y).sqrt() * 30.0;
            put(&mut g, [level * turn.cos(), 30.0 * y, level * turn.sin()], 1.0, -3.0);
        }
        g
    }

    /// Half the room's size, in world units.
    const HALF: [f64; 3] = [5.0, 1.5, 4.0];

    /// Walls, floor and ceiling, all opaque, and furniture along two of the walls.
    fn hollow_box() -> Geometry {
        let mut g = Geometry::default();
        for i in 0..4000 {
            let [a, b] = [0, 1].map(|k| 2.0 * share(i, k) - 1.0);
            let side = f64::from(i % 2) * 2.0 - 1.0;
            let on = [[side, a, b], [a, side, b], [a, b, side]][usize::from(i / 2 % 3)];
            put(&mut g, std::array::from_fn(|axis| on[axis] * HALF[axis]), 0.25, 6.0);
        }
        for i in 0..3000 {
            let side = f64::from(i % 2) * 2.0 - 1.0;
            let (x, y, z) = (9.0 * share(i, 0) - 4.5, 1.5 - share(i, 1), side * (3.0 + share(i, 2)));
            put(&mut g, [x, y, z], 0.05, 3.0);
        }
        g
    }

    #[test]
    fn rooms_are_told_from_objects() {
        assert!(!is_interior(&still_life()));
        assert!(is_interior(&hollow_box()));
        // Coarse models of objects hide themselves, from within as well.
        for gaussians in [100, 300, 1500, 6000] {
            let splats = lexisplat_sample::scene(&lexisplat_sample::SampleOptions::new(gaussians, 0));
            assert!(!is_interior(&splats.geometry), "{gaussians}");
        }
        // Without walls and ceiling in the way, furniture is looked at from outside.
        let mut open = hollow_box();
        open.opacities[..4000].fill(-4.0);
        assert!(!is_interior(&open));
    }

    #[test]
    fn views_of_a_room_are_inside_upright_and_all_around() {
        let g = hollow_box();
        let cameras = interior_views(&g, 12, 320, 200);
        assert_eq!(cameras.len(), 12);
        assert_eq!(cameras[7].name, "room_007");
        let mut sum = DVec3::ZERO;
        for camera in &cameras {
            camera.validate().unwrap();
            let position = camera.position.map(f64::from);
            assert!(position.iter().zip(HALF).all(|(p, half)| p.abs() < 0.9 * half), "{position:?}");
            let r = &camera.rotation;
            assert!(r[1][0].abs() < 1e-6 && r[1][1] > 0.9, "level, and not upside down");
            sum += DVec3::from_array(r.map(|row| f64::from(row[2])));
            // Walls before it are as far as a room's width allows.
            let near = g.positions.iter().filter(|p| {
                let [x, y, z] = camera.to_view(**p);
                z > camera.near && z < 0.7 && x.abs() < 0.3 * z && y.abs() < 0.3 * z
            });
            assert_eq!(near.count(), 0);
        }
        sum.y = 0.0;
        assert!(sum.length() < 0.5, "all around: {sum}");
        let mut places: Vec<[f32; 3]> = cameras.iter().map(|camera| camera.position).collect();
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        places.dedup();
        assert!(places.len() > 1, "from more than one place");
        assert_eq!(cameras, interior_views(&g, 12, 320, 200));
        assert!(interior_views(&g, 0, 10, 10).is_empty());
    }

    #[test]
    fn degenerate_scenes_still_give_cameras() {
        let mut one = Geometry::default();
        put(&mut one, [1.0, 2.0, 3.0], 0.5, 9.0);
        let mut broken = one.clone();
        broken.positions[0][1] = f32::NAN;
        broken.scales[0] = [f32::INFINITY; 3];
        broken.opacities[0] = f32::NAN;
        let mut equal = Geometry::default();
        (0..50).for_each(|_| put(&mut equal, [1.0, 2.0, 3.0], 1e-30, 3.0));
        let mut huge = one.clone();
        put(&mut huge, [-3e38; 3], 1e30, 9.0);
        put(&mut huge, [3e38; 3], 1e-30, 9.0);
        for geometry in [Geometry::default(), one, broken, equal, huge] {
            let _ = is_interior(&geometry);
            for camera in interior_views(&geometry, 3, 0, 10) {
                camera.validate().unwrap();
            }
        }
    }
}
