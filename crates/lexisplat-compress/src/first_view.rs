//! Chooses the view from which viewers show a scene first.
//!
//! A good first view is like a photograph, shows much detail, and has the scene's subject in the picture. It is chosen among
//! given cameras, or among views of a ring around the subject and views like photographs. Small pictures of a sample of the
//! Gaussians decide.

use lexisplat::{Geometry, Progress, SplatSource, Splats};
use lexisplat_render::{Camera, Pose, RenderOptions, Renderer, Scene, levelled, object, subject, upward};

use crate::error::Result;
use crate::found::{BARE, GENERATED_SIZE, LEAST_LIT, SMALL, detail, likely, lit, sketch};
use crate::observed_directions::ObservedDirections;
use crate::photo_views::likelihood;
use crate::size_spread::Sizes;

/// Largest number of Gaussians that are drawn, and the number of neighbours in the source that are read at once.
const SAMPLE: usize = 1 << 16;
const RUN: usize = 16;
/// Largest number of given cameras among which the view is chosen, evenly spread.
const GIVEN: usize = 32;
/// Number of views of the ring, and of views like photographs.
const RING: usize = 16;
const LIKELY: usize = 128;
/// Weight of the likelihood that a photograph was taken from the place of a view, beside the logarithms of the detail and of
/// the subject's share. With a weight of 1, the chosen view of the room is from outside, through its walls (docs/METHOD.md).
const LIKELIHOOD: f64 = 2.0;
/// Shares of the subject in the picture. Larger shares count as the larger one, smaller ones as the smaller one. From inside a
/// room, a good view shows about half of it.
const SHARES: [f64; 2] = [0.01, 0.6];
/// Least detail of a chosen view, as a multiple of the detail that a share `1 - DETAILED` of the views like photographs do not
/// reach. Views through haze have less.
const LEAST_DETAIL: f64 = 0.7;
const DETAILED: f64 = 0.15;
/// Range of the sine of the angle by which generated views look up: 58 degrees down to 6 degrees up. Few photographs are taken
/// from below or straight from above.
const LOOKS_UP: std::ops::RangeInclusive<f64> = -0.85..=0.1;
/// Share of the picture, from its middle, in which the subject counts as in the picture.
const WITHIN: f32 = 0.9;
/// Radius around the subject's centre, as a share of the subject's radius, within which Gaussians belong to it.
const OWN: f64 = 0.7;
/// Number of Gaussians of the subject that are looked for in each picture.
const ASKED: usize = 2048;
/// Least distance of the pivot, as a share of the subject's radius.
const NEAREST_PIVOT: f64 = 0.1;

/// Returns the first view of `source`: the best of `cameras`, or of generated views if there are none. Returns `None` if no view
/// shows anything. The same input gives the same view.
///
/// # Errors
/// Errors of the source; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub(crate) fn first_view(
    source: &dyn SplatSource,
    cameras: Option<&[Camera]>,
    progress: &dyn Progress,
) -> Result<Option<Pose>> {
    let splats = sampled(source)?;
    let sketch = enlarged(sketch(&splats), source.len() as f64 / splats.len().max(1) as f64);
    let mut renderer = Renderer::cpu();
    let scene = renderer.prepare(Scene::from(&sketch))?;
    let ranking = Ranking::of(&splats);
    let mut drawn = |cameras: Vec<Camera>| -> Result<Vec<Candidate>> {
        let draw = |camera: Camera| {
            progress.check()?;
            // Black shows how much of the picture is lit.
            let small = camera.with_max_width(SMALL[0]).with_background(None);
            let picture = renderer.render(&scene, &small, &RenderOptions::default())?;
            Ok(Candidate { detail: detail(&picture), lit: lit(&picture), camera })
        };
        cameras.into_iter().map(draw).collect()
    };
    let (mut candidates, like_photographs) = match cameras {
        Some(cameras) => {
            let step = cameras.len().div_ceil(GIVEN).max(1);
            (Vec::new(), drawn(cameras.iter().step_by(step).cloned().collect())?)
        }
        None => {
            let up = upward(&splats.geometry);
            let level = |cameras: Vec<Camera>| -> Vec<Camera> {
                let usual = cameras.into_iter().filter(|camera| {
                    let sine: f64 = (0..3).map(|k| f64::from(camera.rotation[k][2]) * up[k]).sum();
                    LOOKS_UP.contains(&sine)
                });
                usual.map(|camera| levelled(camera, up)).collect()
            };
            let [width, height] = GENERATED_SIZE;
            let ring = drawn(level(object(&splats.geometry, RING, width, height)))?;
            if quantile(ring.iter().map(|view| view.lit), 0.5) < BARE {
                // An object before nothing: pictures of the ring show all of it.
                return Ok(ranking.best(&ring, 0.0));
            }
            let (photo, others) = likely(&splats, LIKELY);
            (ring, drawn(level([photo, others].concat()))?)
        }
    };
    let least = LEAST_DETAIL * quantile(like_photographs.iter().map(|view| view.detail), 1.0 - DETAILED);
    let lit = LEAST_LIT * quantile(like_photographs.iter().map(|view| view.lit), 0.5);
    candidates.extend(like_photographs);
    candidates.retain(|view| view.detail >= least && view.lit >= lit);
    Ok(ranking.best(&candidates, LIKELIHOOD))
}

/// A view that was drawn.
struct Candidate {
    detail: f64,
    /// Share of the pixels that show something.
    lit: f64,
    camera: Camera,
}

/// The facts about a scene by which views are ranked.
struct Ranking {
    observed: ObservedDirections,
    sizes: Sizes,
    centre: [f64; 3],
    radius: f64,
    /// Positions of some Gaussians of the subject.
    own: Vec<[f32; 3]>,
}

impl Ranking {
    fn of(splats: &Splats) -> Self {
        let geometry = &splats.geometry;
        let (centre, radius) = subject(geometry);
        Self {
            observed: ObservedDirections::of(splats),
            sizes: Sizes::of(geometry),
            centre,
            radius,
            own: own(geometry, centre, OWN * radius),
        }
    }

    /// Returns the pose of the best of the views that show anything. `weight` is that of the likelihood.
    fn best(&self, candidates: &[Candidate], weight: f64) -> Option<Pose> {
        let shown = candidates.iter().filter(|view| view.detail > 0.0);
        let best = shown.max_by(|a, b| self.score(a, weight).total_cmp(&self.score(b, weight)))?;
        let camera = &best.camera;
        let ahead: f64 = (0..3)
            .map(|k| (self.centre[k] - f64::from(camera.position[k])) * f64::from(camera.rotation[k][2]))
            .sum();
        Some(Pose::of_camera(camera, ahead.max(NEAREST_PIVOT * self.radius)))
    }

    fn score(&self, Candidate { detail, camera, .. }: &Candidate, weight: f64) -> f64 {
        let likelihood = likelihood(&self.observed, camera.position, &self.sizes.seen_from(camera.position));
        // A likelihood of minus infinity times a weight of zero is not a number.
        let likelihood = if weight > 0.0 { weight * likelihood } else { 0.0 };
        libm::log(*detail) + likelihood + libm::log(self.share_in(camera).clamp(SHARES[0], SHARES[1]))
    }

    /// Returns the share of the subject that is in the picture of `camera`.
    fn share_in(&self, camera: &Camera) -> f64 {
        let half = [camera.width as f32 / camera.fx, camera.height as f32 / camera.fy]
            .map(|side| 0.5 * WITHIN * side);
        let is_in = |position: &&[f32; 3]| {
            let [x, y, z] = camera.to_view(**position);
            z > 0.0 && x.abs() < half[0] * z && y.abs() < half[1] * z
        };
        self.own.iter().filter(is_in).count() as f64 / self.own.len().max(1) as f64
    }
}

/// Returns the positions of up to about [`ASKED`] opaque Gaussians within `radius` of `centre`.
fn own(geometry: &Geometry, centre: [f64; 3], radius: f64) -> Vec<[f32; 3]> {
    let near = |position: &[f32; 3]| {
        (0..3).map(|k| (f64::from(position[k]) - centre[k]).powi(2)).sum::<f64>() < radius * radius
    };
    let all: Vec<[f32; 3]> = (geometry.positions.iter().zip(&geometry.opacities))
        .filter(|(position, opacity)| **opacity > 0.0 && near(position))
        .map(|(position, _)| *position)
        .collect();
    all.iter().step_by(all.len().div_ceil(ASKED).max(1)).copied().collect()
}

/// Returns at most [`SAMPLE`] Gaussians of `source`, in short runs that are evenly spread over it.
fn sampled(source: &dyn SplatSource) -> Result<Splats> {
    let runs = SAMPLE / RUN;
    let mut splats = source.empty();
    if source.len() <= SAMPLE {
        source.read(0..source.len(), &mut splats)?;
        return Ok(splats);
    }
    let mut run = source.empty();
    for k in 0..runs {
        let first = (source.len() - RUN) / (runs - 1) * k;
        source.read(first..first + RUN, &mut run)?;
        splats.append(run.clone());
    }
    Ok(splats)
}

/// Returns `splats` with each Gaussian so much larger that they cover what `times` as many cover.
fn enlarged(mut splats: Splats, times: f64) -> Splats {
    #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
    let by = (0.5 * libm::log(times.max(1.0))) as f32;
    splats.geometry.scales.iter_mut().flatten().for_each(|scale| *scale += by);
    splats
}

/// Returns the value that the share `share`, below 1, of `values` does not reach; 0 without values.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the number of values")]
    let place = (all.len() as f64 * share) as usize;
    all.get(place).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::{orbit, render};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    fn chosen(splats: &Splats, cameras: Option<&[Camera]>) -> Option<Pose> {
        first_view(splats, cameras, &Silent).unwrap()
    }

    #[test]
    fn the_view_shows_the_scene() {
        let splats = scene(&SampleOptions::new(1500, 3));
        let pose = chosen(&splats, None).unwrap();
        assert_eq!(chosen(&splats, None), Some(pose));
        let camera = pose.camera([300, 200], 0.01);
        let picture = render(&Scene::from(&splats), &camera, &RenderOptions::default()).unwrap();
        assert!(detail(&picture) > 0.0 && lit(&picture) > 0.3, "{pose}: {}", lit(&picture));
    }

    #[test]
    fn the_best_camera_is_not_one_that_looks_away() {
        let splats = scene(&SampleOptions::new(1500, 3));
        let mut cameras = orbit(&splats.geometry, 6, 300, 200);
        for camera in cameras.iter_mut().filter(|camera| camera.name != "orbit_004") {
            camera.rotation = camera.rotation.map(|[right, down, forward]| [-right, down, -forward]);
        }
        let pose = chosen(&splats, Some(&cameras)).unwrap();
        assert_eq!(pose.position, cameras[4].position.map(f64::from));
    }

    #[test]
    fn a_large_scene_is_sampled() {
        let few = scene(&SampleOptions::new(3000, 3));
        let mut many = few.clone();
        while many.len() <= SAMPLE + 3000 {
            many.append(few.clone());
        }
        let sample = sampled(&many).unwrap();
        assert_eq!(sample.len(), SAMPLE);
        assert!(chosen(&many, None).is_some());
    }

    #[test]
    fn scenes_without_anything_have_no_view() {
        let mut splats = scene(&SampleOptions::new(10, 3));
        splats.geometry.opacities.fill(-40.0);
        assert_eq!(chosen(&splats, None), None);
        splats.retain(&[false; 10]);
        assert_eq!(chosen(&splats, None), None);
    }
}
