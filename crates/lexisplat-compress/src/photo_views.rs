//! Views from likely places of photographs of a scene.
//!
//! Two signs tell whether photographs were taken from a place: view-dependent colours
//! ([`ObservedDirections`](crate::observed_directions::ObservedDirections)), and sizes of Gaussians, which are about
//! proportional to the distance ([`Sizes`](crate::size_spread::Sizes)).

use lexisplat_render::{Camera, PLASTIC};

use crate::observed_directions::{ObservedDirections, Seen};
use crate::size_spread::SizesSeen;

/// Number of directions that are tried at each place.
const DIRECTIONS: usize = 24;
/// Cosine of half the angle that a picture is assumed to show: 32 degrees.
const CONE: f32 = 0.85;
/// The usual natural logarithm of the median size of Gaussians over their distance, as seen from places of photographs, and
/// the largest difference from it that counts as usual. The logarithm is -5.4 to -4.2 (seven models of three trainers,
/// pictures of 400 to 1,200 pixels).
const USUAL_SIZE: f64 = -5.0;
const USUAL_RANGE: f64 = 0.9;
/// Largest absolute y of a direction for which the world's up can be used.
const STEEP: f64 = 0.95;

/// Returns a score of how likely photographs were taken from `position`; larger is likelier. `sizes` are the sizes as seen
/// from there. The score has three terms with equal weights. Each differs by about 1 between places of photographs and
/// other places.
pub(crate) fn likelihood(observed: &ObservedDirections, position: [f32; 3], sizes: &SizesSeen) -> f64 {
    let (mut focus, mut count) = (0.0, 0.0);
    for seen in observed.from(position) {
        focus += f64::from(seen.focus * seen.count);
        count += f64::from(seen.count);
    }
    let unusual = ((sizes.median - USUAL_SIZE).abs() - USUAL_RANGE).max(0.0);
    let likelihood = focus / count - sizes.spread - unusual;
    if likelihood.is_finite() { likelihood } else { f64::NEG_INFINITY }
}

/// Returns `camera`, the `number`-th, turned to the Gaussians that seem to have been seen from its place. If there are
/// none, the camera stays as it is.
pub(crate) fn turned(camera: &Camera, number: usize, observed: &ObservedDirections) -> Camera {
    let seen: Vec<Seen> = observed.from(camera.position).collect();
    let dot = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f32>();
    let mut best: Option<(f32, [f32; 3])> = None;
    for direction in 0..DIRECTIONS {
        let spread = ((number * DIRECTIONS + direction) as f64 + 0.5) * PLASTIC[0];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
        let at = (spread.fract() * seen.len() as f64) as usize;
        let Some(middle) = seen.get(at).map(|group| group.direction) else { continue };
        let within = seen.iter().filter(|group| dot(group.direction, middle) > CONE);
        let more: f32 = within.map(|group| (group.focus - 1.0) * group.count).sum();
        if best.is_none_or(|(most, _)| more > most) {
            best = Some((more, middle));
        }
    }
    let Some((_, forward)) = best else { return camera.clone() };
    let turned = Camera { rotation: facing(forward), ..camera.clone() };
    if turned.validate().is_ok() { turned } else { camera.clone() }
}

/// Returns the rotation of a camera that looks along `forward`, a unit vector, and is upright in a world whose y points
/// down.
fn facing(forward: [f32; 3]) -> [[f32; 3]; 3] {
    let forward = forward.map(f64::from);
    let down = if forward[1].abs() > STEEP { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let cross = |a: [f64; 3], b: [f64; 3]| {
        std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
    };
    let across: [f64; 3] = cross(down, forward);
    let length = across.iter().map(|v| v * v).sum::<f64>().sqrt();
    let right = across.map(|v| v / length);
    let down: [f64; 3] = cross(forward, right);
    #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
    let row = |k: usize| [right[k], down[k], forward[k]].map(|v| v as f32);
    [row(0), row(1), row(2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observed_directions::tests::trained;
    use crate::size_spread::Sizes;

    /// Two walls, of which one was seen from one place and the other from another.
    #[test]
    fn views_turn_to_what_was_seen_from_there() {
        let [first, second] = [[-6.0, 0.0, 0.0], [6.0, 0.0, 0.0]];
        let mut splats = trained([-6.0, 0.0, 10.0], &[first], 4000);
        splats.append(trained([6.0, 0.0, 10.0], &[second], 4000));
        let observed = ObservedDirections::of(&splats);
        for (place, other, number) in [(first, second, 3), (second, first, 4)] {
            let camera = Camera::rounded(
                "view".into(),
                [96, 64],
                [70.0; 2],
                place.map(f64::from),
                facing([0.0, 0.0, -1.0]).map(|row| row.map(f64::from)),
            );
            let view = turned(&camera, number, &observed);
            view.validate().unwrap();
            assert_eq!((view.position, view.fx, view.width), (camera.position, camera.fx, camera.width));
            let ahead = |wall: [f32; 3]| {
                let [x, y, z] = view.to_view([wall[0], wall[1], wall[2] + 10.0]);
                z / (x * x + y * y + z * z).sqrt()
            };
            assert!(ahead(place) > CONE, "{} {view:?}", ahead(place));
            assert!(ahead(place) > ahead(other));
        }
        let nothing = ObservedDirections::of(&trained([0.0; 3], &[], 60));
        let camera = Camera::rounded(
            "view".into(),
            [96, 64],
            [70.0; 2],
            [0.0; 3],
            facing([0.0, 0.0, 1.0]).map(|row| row.map(f64::from)),
        );
        assert_eq!(turned(&camera, 0, &nothing), camera);
    }

    #[test]
    fn places_of_photographs_are_likelier_than_others() {
        let camera = [0.5, -1.0, -9.0];
        let mut splats = trained([0.0; 3], &[camera], 4000);
        let sizes = splats.geometry.positions.iter().map(|p| {
            let far = (0..3).map(|k| (p[k] - camera[k]).powi(2)).sum::<f32>().sqrt();
            [far.ln() - 5.0; 3]
        });
        splats.geometry.scales = sizes.collect();
        let (observed, sizes) = (ObservedDirections::of(&splats), Sizes::of(&splats.geometry));
        let likely = |place: [f32; 3]| likelihood(&observed, place, &sizes.seen_from(place));
        let here = likely(camera);
        for other in
            [[9.0, 0.0, -1.0], [0.0, 0.0, 9.0], [0.0, -9.0, 1.0], [1.0, -2.0, -60.0], [0.2, -0.3, -1.5]]
        {
            assert!(likely(other) < here - 0.5, "{other:?}: {} {here}", likely(other));
        }
        let nothing = Sizes::of(&lexisplat::Geometry::default());
        assert_eq!(likelihood(&observed, camera, &nothing.seen_from(camera)), f64::NEG_INFINITY);
    }

    #[test]
    fn cameras_stand_upright() {
        for forward in
            [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, -0.8, 0.0], [0.0, -0.96, 0.28]]
        {
            let rotation = facing(forward);
            let camera = Camera {
                rotation,
                ..Camera::rounded(
                    "view".into(),
                    [9, 9],
                    [9.0; 2],
                    [0.0; 3],
                    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                )
            };
            camera.validate().unwrap();
            let [x, y, z] = camera.to_view(forward);
            assert!(x.abs() < 1e-6 && y.abs() < 1e-6 && (z - 1.0).abs() < 1e-5);
            // A point below lies lower in the picture, unless the camera looks up or down.
            assert!(forward[1].abs() > 0.95 || camera.to_view([0.0, 1.0, 0.0])[1] > 0.0);
        }
    }
}
