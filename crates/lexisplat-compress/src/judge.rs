//! The score of a compressed scene over the views that judge.

use lexisplat::packed::ReachedRecord;
use lexisplat::{Progress, Splats, Stage};
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene, squared_error};

use crate::backgrounds::opposite;
use crate::decibels::decibels;
use crate::error::Result;

/// PSNR of identical pictures, in dB, so that means are finite.
const IDENTICAL: f64 = 100.0;

/// Inverse of the share of generated views, the hardest ones, that are about as hard as photographs (docs/METHOD.md, "The
/// judging views").
const HARD_PARTS: usize = 4;

/// Amount by which given cameras that judge look better than other views of a refined scene, in dB. Views beside them are fitted
/// to. It is the mean of bonsai-3dgs, room, room-large, fern and lego, which have 0 to 0.6 (docs/METHOD.md, "Refining").
const NEAR_FITTED_DB: f64 = 0.3;

/// Scores models of a scene against the scene itself.
#[derive(Debug)]
pub struct Judge {
    renderer: Renderer,
    views: Vec<View>,
    given: bool,
    /// Amount by which the views look better than others, in dB.
    better: f64,
}

/// A view that judges.
#[derive(Debug)]
struct View {
    camera: Camera,
    original: Image,
    /// Number of pixels by which the squared error is divided.
    pixels: u64,
}

impl Judge {
    /// Draws the original `splats` from the cameras `judging`, each over its background. `renderer` draws the originals and later
    /// the models. `given` tells whether the cameras were given or generated. Reports [`Stage::Draw`] to `progress`, in views.
    /// `progress` can cancel.
    ///
    /// # Errors
    /// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the scene or a
    /// view does not fit.
    pub fn new(
        mut renderer: Renderer,
        splats: &Splats,
        judging: &[Camera],
        given: bool,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let scene = renderer.prepare(Scene::from(splats))?;
        let mut drawn = Vec::with_capacity(judging.len());
        progress.begin(Stage::Draw, judging.len() as u64);
        for camera in judging {
            progress.check()?;
            let picture = renderer.render(&scene, camera, &RenderOptions::default())?;
            drawn.push(View { camera: camera.clone(), original: picture, pixels: camera.drawn_pixels() });
            progress.advance(1);
        }
        progress.end();
        drop(scene);
        Ok(Self { renderer, views: drawn, given, better: 0.0 })
    }

    /// Returns a judge of a `part` of a scene. Squared errors are divided by the number of pixels that the part covers,
    /// because the other pixels show other parts.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn of_part(
        renderer: Renderer,
        part: &Splats,
        judging: &[Camera],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut judge = Self::new(renderer, part, judging, false, progress)?;
        let (scene, options) = (judge.renderer.prepare(Scene::from(part))?, RenderOptions::default());
        for View { camera, original, pixels } in &mut judge.views {
            progress.check()?;
            let behind = opposite(camera.background.unwrap_or_default());
            let other = camera.clone().with_background(behind);
            *pixels = covered(camera, original, &judge.renderer.render(&scene, &other, &options)?);
        }
        drop(scene);
        Ok(judge)
    }

    /// Returns a judge of refined scenes. The judged quality over given cameras is then as much less as they look better than other
    /// views.
    pub(crate) fn of_refined(self, refined: bool) -> Self {
        let better = if refined && self.given { NEAR_FITTED_DB } else { 0.0 };
        Self { better, ..self }
    }

    /// Returns the number of views that judge.
    #[must_use]
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// Returns whether the views are given cameras. Otherwise they were generated.
    #[must_use]
    pub fn views_are_given(&self) -> bool {
        self.given
    }

    /// Returns a judge with the same views that scores models against `splats` instead.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn against(self, splats: &Splats, progress: &dyn Progress) -> Result<Self> {
        let cameras: Vec<Camera> = self.views.iter().map(|view| view.camera.clone()).collect();
        let better = self.better;
        Ok(Self { better, ..Self::new(self.renderer, splats, &cameras, self.given, progress)? })
    }

    /// Scores a model or another scene. Reports [`Stage::Draw`] to `progress`, in views. `progress` can cancel.
    ///
    /// # Errors
    /// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the scene or a
    /// view does not fit.
    pub fn score<'a>(&mut self, scene: impl Into<Scene<'a>>, progress: &dyn Progress) -> Result<Score> {
        let scene = self.renderer.prepare(scene.into())?;
        let mut all = Vec::with_capacity(self.views.len());
        progress.begin(Stage::Draw, self.views.len() as u64);
        for View { camera, original, pixels } in &self.views {
            progress.check()?;
            let picture = self.renderer.render(&scene, camera, &RenderOptions::default())?;
            let found = decibels(squared_error(original, &picture)?, *pixels);
            all.push(found.map_or(IDENTICAL, |decibels| decibels.min(IDENTICAL)));
            progress.advance(1);
        }
        progress.end();
        all.sort_by(f64::total_cmp);
        let mean = |views: &[f64]| views.iter().sum::<f64>() / views.len().max(1) as f64;
        let hard = if self.given { all.len() } else { all.len().div_ceil(HARD_PARTS) };
        let least = all.first().copied().unwrap_or(IDENTICAL);
        Ok(Score { judged: mean(&all[..hard]) - self.better, mean: mean(&all), least })
    }
}

/// Returns the number of pixels of `camera` that a scene covers. One of the two pictures of the scene is over black, the other over
/// white.
fn covered(camera: &Camera, one: &Image, other: &Image) -> u64 {
    let pairs = one.pixels.iter().zip(&other.pixels).enumerate();
    let within = pairs.filter(|(drawn, _)| camera.place_of_drawn(*drawn).is_some());
    // The share of the background in each pixel, which is equal in all channels.
    let open: f64 = within.map(|(_, (one, other))| f64::from(one[0] - other[0]).abs().min(1.0)).sum();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the number of pixels")]
    let covered = (camera.drawn_pixels() as f64 - open).max(0.0).round() as u64;
    covered
}

/// PSNR over the views that judge, in dB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// The PSNR that photographs are expected to have on average: the mean over all views if the views were given, 0.3 dB less
    /// if the scene was refined too; otherwise the mean over the quarter of the views with the lowest PSNR.
    pub judged: f64,
    /// The mean over all views.
    pub mean: f64,
    /// The lowest PSNR of a view.
    pub least: f64,
}

/// Returns the record of a score by `judge`.
pub(crate) fn reached(score: Score, judge: &Judge) -> ReachedRecord {
    let views = u32::try_from(judge.views()).unwrap_or(u32::MAX);
    let psnr = [score.judged, score.mean, score.least].map(rounded_decibels);
    ReachedRecord::new(psnr, views, judge.views_are_given())
}

/// Rounds decibels to the thousandths that are reported.
fn rounded_decibels(decibels: f64) -> f64 {
    (decibels * 1000.0).round() / 1000.0
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::orbit;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    #[test]
    fn given_cameras_judge_refined_scenes_to_be_worse() {
        let all = scene(&SampleOptions::new(300, 3));
        let mut some = all.clone();
        some.retain(&(0..300).map(|i| i % 3 > 0).collect::<Vec<_>>());
        let views = orbit(&all.geometry, 5, 96, 72);
        let score = |given: bool, refined: bool| {
            let judge = Judge::new(Renderer::cpu(), &all, &views, given, &Silent).unwrap();
            // The margin stays if the judge compares with another scene.
            let mut judge = judge.of_refined(refined).against(&all, &Silent).unwrap();
            judge.score(&some, &Silent).unwrap()
        };
        let (plain, refined) = (score(true, false), score(true, true));
        assert!((plain.judged - refined.judged - NEAR_FITTED_DB).abs() < 1e-9, "{plain:?} {refined:?}");
        // Files record the other two as they were measured.
        assert_eq!((plain.mean, plain.least), (refined.mean, refined.least));
        assert_eq!(score(false, true), score(false, false));
    }
}
