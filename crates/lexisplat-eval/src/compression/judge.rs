//! The score of a compressed scene over the judging views.

use lexisplat::{Model, Progress, Splats};
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene};

use super::views::PackingViews;
use crate::error::Result;
use crate::metrics::psnr;

/// Number of generated views that judge. Photographs are taken of what has detail and are more demanding than
/// most generated views, so those with the most detail judge (docs/METHOD.md has the measurements).
const JUDGES: usize = 18;
/// PSNR that identical pictures count as, in dB, so that means are finite.
const IDENTICAL: f64 = 100.0;

/// Scores models of one scene against the scene itself.
#[derive(Debug)]
pub struct Judge {
    renderer: Renderer,
    views: Vec<(Camera, Image)>,
    given: bool,
}

impl Judge {
    /// Draws `splats` from the judging views with `renderer`, which will also draw the models. `progress` can cancel.
    ///
    /// # Errors
    /// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the scene
    /// or a view does not fit.
    pub fn new(
        mut renderer: Renderer,
        splats: &Splats,
        views: &PackingViews,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let scene = renderer.prepare(Scene::from(splats))?;
        let most = if views.are_given() { usize::MAX } else { JUDGES };
        let mut drawn: Vec<(f64, Camera, Image)> = Vec::new();
        for camera in views.judging() {
            progress.check()?;
            let picture = renderer.render(&scene, camera, &RenderOptions::default())?;
            drawn.push((detail(&picture), camera.clone(), picture));
            if drawn.len() > most
                && let Some(least) = (0..drawn.len()).min_by(|&a, &b| drawn[a].0.total_cmp(&drawn[b].0))
            {
                drawn.remove(least);
            }
        }
        drop(scene);
        let drawn = drawn.into_iter().map(|(_, camera, picture)| (camera, picture)).collect();
        Ok(Self { renderer, views: drawn, given: views.are_given() })
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

    /// Returns the mean and the least PSNR of `model`, in dB. `progress` can cancel.
    ///
    /// # Errors
    /// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the model
    /// or a view does not fit.
    pub fn score(&mut self, model: &Model, progress: &dyn Progress) -> Result<[f64; 2]> {
        let scene = self.renderer.prepare(Scene::from(model))?;
        let (mut sum, mut least) = (0.0, IDENTICAL);
        for (camera, original) in &self.views {
            progress.check()?;
            let picture = self.renderer.render(&scene, camera, &RenderOptions::default())?;
            let decibels = psnr(original, &picture)?.unwrap_or(IDENTICAL).min(IDENTICAL);
            sum += decibels;
            least = f64::min(least, decibels);
        }
        Ok([sum / self.views.len().max(1) as f64, least])
    }
}

/// Mean squared difference of neighbouring pixels, never negative.
fn detail(picture: &Image) -> f64 {
    let width = picture.width as usize;
    let mut sum = 0.0;
    let mut add = |a: &[f32; 3], b: &[f32; 3]| {
        for (a, b) in a.iter().zip(b) {
            sum += f64::from(a - b).powi(2);
        }
    };
    for row in picture.pixels.chunks_exact(width.max(1)) {
        for pair in row.windows(2) {
            add(&pair[0], &pair[1]);
        }
    }
    for (above, below) in picture.pixels.iter().zip(picture.pixels.iter().skip(width)) {
        add(above, below);
    }
    sum / picture.pixels.len().max(1) as f64
}
