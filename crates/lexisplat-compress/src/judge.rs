//! The score of a compressed scene over the judging views.

use lexisplat::{Progress, Splats, Stage};
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene, squared_error};

use crate::decibels::decibels;
use crate::error::Result;

/// PSNR that identical pictures count as, in dB, so that means are finite.
const IDENTICAL: f64 = 100.0;

/// Photographs are about as hard as the hardest of this many parts of generated views (docs/METHOD.md, "The judging views").
const HARD_PARTS: usize = 4;

/// Scores models of one scene against the scene itself.
#[derive(Debug)]
pub struct Judge {
    renderer: Renderer,
    views: Vec<View>,
    given: bool,
}

/// A view that judges.
#[derive(Debug)]
struct View {
    camera: Camera,
    original: Image,
    /// Number of pixels that the squared error is divided by.
    pixels: u64,
}

impl Judge {
    /// Draws `splats` from the cameras `judging` with `renderer`, which will also draw the models. The cameras were
    /// `given`, or else generated. Reports [`Stage::Draw`], in views, to `progress`, which can cancel.
    ///
    /// # Errors
    /// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the scene
    /// or a view does not fit.
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
        Ok(Self { renderer, views: drawn, given })
    }

    /// Judges `part` of a scene. Only the pixels that it covers count, for others of the scene are in all of them.
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
        let scene = judge.renderer.prepare(Scene::from(part))?;
        let white = RenderOptions::default().with_background([1.0; 3]);
        for View { camera, original, pixels } in &mut judge.views {
            progress.check()?;
            *pixels = covered(camera, original, &judge.renderer.render(&scene, camera, &white)?);
        }
        drop(scene);
        Ok(judge)
    }

    /// Number of views that judge.
    #[must_use]
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// Whether the views are given cameras. Otherwise they were generated.
    #[must_use]
    pub fn views_are_given(&self) -> bool {
        self.given
    }

    /// The same views of `splats`, against which models are scored instead.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(crate) fn against(self, splats: &Splats, progress: &dyn Progress) -> Result<Self> {
        let cameras: Vec<Camera> = self.views.iter().map(|view| view.camera.clone()).collect();
        Self::new(self.renderer, splats, &cameras, self.given, progress)
    }

    /// Scores a model or another scene. Reports [`Stage::Draw`], in views, to `progress`, which can cancel.
    ///
    /// # Errors
    /// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the scene
    /// or a view does not fit.
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
        Ok(Score { judged: mean(&all[..hard]), mean: mean(&all), least })
    }
}

/// Number of pixels of `camera` that a scene covers, which is drawn over black and over white.
fn covered(camera: &Camera, black: &Image, white: &Image) -> u64 {
    let pairs = black.pixels.iter().zip(&white.pixels).enumerate();
    let within = pairs.filter(|(drawn, _)| camera.place_of_drawn(*drawn).is_some());
    // What is seen of the background, in each channel alike.
    let open: f64 = within.map(|(_, (black, white))| f64::from(white[0] - black[0]).clamp(0.0, 1.0)).sum();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the number of pixels")]
    let covered = (camera.drawn_pixels() as f64 - open).max(0.0).round() as u64;
    covered
}

/// PSNR over the judging views, in dB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// What photographs are expected to show on average: the mean of given views, or that of the worst quarter of
    /// generated ones.
    pub judged: f64,
    /// The mean of all views.
    pub mean: f64,
    /// The least of a view.
    pub least: f64,
}
