//! The score of a compressed scene over the judging views.

use lexisplat::{Progress, Splats, Stage};
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene, squared_error};

use crate::error::Result;
use crate::metrics::decibels;

/// PSNR that identical pictures count as, in dB, so that means are finite.
const IDENTICAL: f64 = 100.0;

/// Photographs are about as hard as the hardest of this many parts of generated views (docs/METHOD.md, "The judging views").
const HARD_PARTS: usize = 4;

/// Scores models of one scene against the scene itself.
#[derive(Debug)]
pub struct Judge {
    renderer: Renderer,
    views: Vec<(Camera, Image)>,
    given: bool,
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
            drawn.push((camera.clone(), picture));
            progress.advance(1);
        }
        progress.end();
        drop(scene);
        Ok(Self { renderer, views: drawn, given })
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
    pub(super) fn against(self, splats: &Splats, progress: &dyn Progress) -> Result<Self> {
        let cameras: Vec<Camera> = self.views.iter().map(|view| view.0.clone()).collect();
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
        for (camera, original) in &self.views {
            progress.check()?;
            let picture = self.renderer.render(&scene, camera, &RenderOptions::default())?;
            let found = decibels(squared_error(original, &picture)?, camera.drawn_pixels());
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
