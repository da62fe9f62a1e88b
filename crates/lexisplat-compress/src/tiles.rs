//! The steps of [`lexisplat::packed::tiles`] that draw.

use lexisplat::packed::Preset;
use lexisplat::packed::tiles::{Bucket, Coded, Coding, Counts, LookStatistics, Looked, Plan};
use lexisplat::{AppearanceSensitivity, Model, Progress, Splats};
use lexisplat_render::Renderer;

use crate::error::Result;
use crate::parts;
pub use crate::parts::in_parts;

/// Measures the sensitivity of a bucket with `renderer`, for the quality that `preset` aims at. Without a renderer the
/// sensitivity is guessed from each Gaussian alone.
///
/// # Errors
/// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the bucket does not
/// fit.
pub fn look(
    plan: &Plan,
    bucket: &Bucket,
    renderer: Option<&mut Renderer>,
    preset: Preset,
    progress: &dyn Progress,
) -> Result<(LookStatistics, Looked)> {
    let (part, options) = (bucket.splats(), plan.options());
    let observe = |renderer| parts::observe(renderer, part, options, preset.decibels(), progress);
    let observed = renderer.map(observe).transpose()?;
    Ok(bucket.look(plan, observed)?)
}

/// Codes a bucket. If its sensitivity was not `guessed`, base colours and opacities are fitted to pictures.
///
/// # Errors
/// As [`Coding::code`], and errors of drawing.
pub fn code(
    plan: &Plan,
    coding: &Coding,
    bucket: &Bucket,
    looked: &Looked,
    guessed: bool,
    progress: &dyn Progress,
) -> Result<(Counts, Coded)> {
    let mut refit = |part: &Splats, model: &Model, own: &[AppearanceSensitivity]| {
        parts::refit(part, model, own, looked.memo(), progress).map(Some)
    };
    coding.code(plan, bucket, looked, if guessed { None } else { Some(&mut refit) }, progress)
}
