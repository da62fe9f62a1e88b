//! Packs a scene part by part. Each part is drawn as if it were the whole scene.

use lexisplat::packed::{Appearance, PackOptions};
use lexisplat::stream::{self, Observed, Observer};
use lexisplat::{AppearanceSensitivity, Model, Progress, Sensitivity, Sink, SplatSource, Splats, Stopwatch};
use lexisplat_render::{Renderer, Scene};

use crate::error::{Error, Result};
use crate::memo::{memo_of, views_of};
use crate::only_cancels::OnlyCancels;
use crate::packing_views::PackingViews;
use crate::part_step::step_factor;
use crate::refit::Fit;
use crate::report::CompressionReport;

/// Packs part by part to a PSNR of about `decibels`. A scene that is one part is packed whole. `renderer` draws the parts.
/// If it is `None`, the sensitivity is guessed.
///
/// # Errors
/// As [`stream::pack`], and errors of drawing.
pub fn in_parts(
    options: &PackOptions,
    decibels: f64,
    renderer: Option<Renderer>,
    source: &dyn SplatSource,
    sink: Sink<'_>,
    progress: &dyn Progress,
) -> Result<CompressionReport> {
    let clock = Stopwatch::start();
    let mut parts =
        renderer.map(|renderer| Parts { renderer, options, decibels, progress, look_seconds: 0.0 });
    let guessed = parts.is_none();
    let observer = parts.as_mut().map(|parts| parts as &mut dyn Observer<Error>);
    let done = stream::pack(source, observer, options, decibels, sink, progress)?;
    let look_seconds = parts.map_or(0.0, |parts| parts.look_seconds);
    let pack_seconds = clock.seconds() - look_seconds;
    Ok(CompressionReport { look_seconds, pack_seconds, ..CompressionReport::in_parts(&done, guessed) })
}

/// Draws the parts of a scene.
struct Parts<'a> {
    renderer: Renderer,
    options: &'a PackOptions,
    decibels: f64,
    progress: &'a dyn Progress,
    look_seconds: f64,
}

impl Observer<Error> for Parts<'_> {
    fn observe(&mut self, part: &Splats) -> Result<Observed> {
        let clock = Stopwatch::start();
        let observed = observe(&mut self.renderer, part, self.options, self.decibels, self.progress);
        self.look_seconds += clock.seconds();
        observed
    }

    fn refit(
        &mut self,
        part: &Splats,
        model: &Model,
        sensitivities: &[AppearanceSensitivity],
        memo: &[u8],
    ) -> Result<Option<Vec<Appearance>>> {
        refit(part, model, sensitivities, memo, self.progress).map(Some)
    }

    fn device(&self) -> Option<String> {
        self.renderer.is_gpu().then(|| self.renderer.name().to_owned())
    }
}

/// Draws `part` of a scene from views like photographs of the part, from all around it, and from views evenly spread over its
/// Gaussians. The result has the
/// sensitivity of these pictures, the step factor with which the part has a PSNR of about `decibels`, and the views as the
/// memo. A part without Gaussians has no views. With views from all around alone, files of the same size were 1.7 dB worse
/// (docs/results/scale.md).
///
/// # Errors
/// [`lexisplat::Error::Cancelled`] within [`Error::Codec`]; on a GPU [`Error::Render`] if the part does not fit.
pub(crate) fn observe(
    renderer: &mut Renderer,
    part: &Splats,
    options: &PackOptions,
    decibels: f64,
    progress: &dyn Progress,
) -> Result<Observed> {
    if part.is_empty() {
        return Ok(Sensitivity::default().into());
    }
    // The surrounding work reports progress in Gaussians, not in views.
    let progress = &OnlyCancels(progress);
    let (views, even) = PackingViews::found_of_part(renderer, part, progress)?;
    let sensitivity = views.sensitivity(renderer, part, progress)?;
    let step_factor =
        step_factor(part, [&views.judging_part(), &even], &sensitivity, options, decibels, progress)?;
    Ok(Observed { sensitivity, step_factor, memo: memo_of(&views) })
}

/// Returns base colours and opacities of `model` that are fitted to pictures of `part` alone. `model` is the decoded file
/// of `part`. `memo` is the memo of [`observe`].
///
/// # Errors
/// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`Error::Codec`].
pub(crate) fn refit(
    part: &Splats,
    model: &Model,
    sensitivities: &[AppearanceSensitivity],
    memo: &[u8],
    progress: &dyn Progress,
) -> Result<Vec<Appearance>> {
    let progress = &OnlyCancels(progress);
    // Parts are for scenes that leave little memory, so nothing is kept.
    let fit = Fit::to(part, views_of(memo)?.fitting_part(part), false, progress)?.keeping(0);
    fit.appearances(Scene::from(model), sensitivities, progress)
}
