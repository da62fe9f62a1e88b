//! The steps of [`lexisplat::packed::tiles`] that draw.

use lexisplat::Progress;
use lexisplat::packed::ToRefit;
use lexisplat::packed::tiles::{Bucket, Coded, Coding, Counts, LookStatistics, Looked, Plan};
use lexisplat_render::Renderer;

use crate::effort::Refine;
use crate::error::Result;
use crate::parts::{Parts, refit};
use crate::report::RefineReport;

/// Measures the sensitivity of a bucket with `renderer`, for a PSNR of about `decibels`, and refines its Gaussians if there
/// is `refine`. The last value is the result of refining. Without a renderer the sensitivity is guessed from each Gaussian alone.
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
) -> Result<(LookStatistics, Looked, Option<RefineReport>)> {
    let parts = Parts { options: plan.options(), decibels, refine, gaussians: plan.len() };
    let observe = |renderer| parts.observe(renderer, bucket.splats(), progress);
    let (observed, refined) = renderer.map(observe).transpose()?.unzip();
    let (statistics, looked) = bucket.look(plan, observed)?;
    Ok((statistics, looked, refined.flatten()))
}

/// Codes a bucket. If its sensitivity was not `guessed`, the file is fitted to pictures: base colours and opacities, and with
/// `refine` SH-rest.
///
/// # Errors
/// As [`Coding::code`], and errors of drawing.
pub fn code(
    plan: &Plan,
    coding: &Coding,
    bucket: &Bucket,
    looked: &Looked,
    guessed: bool,
    refine: Option<Refine>,
    progress: &dyn Progress,
) -> Result<(Counts, Coded)> {
    let mut fit = |of: ToRefit<'_, '_>| refit(of, refine, plan.len(), progress).map(Some);
    coding.code(plan, bucket, looked, if guessed { None } else { Some(&mut fit) }, progress)
}
