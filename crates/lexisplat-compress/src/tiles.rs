//! The steps of [`lexisplat::packed::tiles`] that draw.

use lexisplat::Progress;
use lexisplat::packed::tiles::{Bucket, Coded, Coding, Counts, LookStatistics, Looked, Plan};
use lexisplat::packed::ToRefit;
use lexisplat_render::Renderer;

use crate::effort::Refine;
use crate::error::Result;
use crate::parts::Parts;
pub use crate::parts::in_parts;

/// Measures the sensitivity of a bucket with `renderer`, for a PSNR of about `decibels`, and refines its Gaussians if there
/// is `refine`. Without a renderer the sensitivity is guessed from each Gaussian alone.
///
/// # Errors
/// [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`]; on a GPU [`crate::Error::Render`] if the bucket does not
/// fit.
pub fn look(
    plan: &Plan,
    bucket: &Bucket,
    renderer: Option<&mut Renderer>,
    decibels: f64,
    refine: Option<Refine>,
    progress: &dyn Progress,
) -> Result<(LookStatistics, Looked)> {
    let parts = parts(plan, decibels, refine);
    let observe = |renderer| parts.observe(renderer, bucket.splats(), progress);
    let observed = renderer.map(observe).transpose()?;
    Ok(bucket.look(plan, observed.map(|(observed, _)| observed))?)
}

/// Codes a bucket. With `drawn`, the decibels for which its sensitivity was measured in pictures, the file is fitted to pictures: base
/// colours and opacities, and with `refine` SH-rest.
///
/// # Errors
/// As [`Coding::code`], and errors of drawing.
pub fn code(
    plan: &Plan,
    coding: &Coding,
    bucket: &Bucket,
    looked: &Looked,
    drawn: Option<f64>,
    refine: Option<Refine>,
    progress: &dyn Progress,
) -> Result<(Counts, Coded)> {
    let Some(decibels) = drawn else {
        return coding.code(plan, bucket, looked, None, progress);
    };
    let parts = parts(plan, decibels, refine);
    let mut refit = |of: ToRefit<'_, '_>| parts.refit(of, progress).map(Some);
    coding.code(plan, bucket, looked, Some(&mut refit), progress)
}

fn parts(plan: &Plan, decibels: f64, refine: Option<Refine>) -> Parts<'_> {
    let (options, gaussians) = (plan.options(), plan.len());
    Parts { options, decibels, refine, gaussians }
}
