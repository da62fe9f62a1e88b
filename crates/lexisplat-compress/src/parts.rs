//! Packs a scene part by part. Each part is drawn as if it were the whole scene.

use lexisplat::packed::{Appearance, PackOptions, Packer, ToRefit};
use lexisplat::stream::{self, Observed, Observer};
use lexisplat::{Progress, Sensitivity, Sink, SplatSource, Splats, Stopwatch};
use lexisplat_render::{Renderer, Scene};

use crate::effort::Refine;
use crate::error::{Error, Result};
use crate::fewer::Removal;
use crate::memo::{memo_of, views_of};
use crate::packing::Packing;
use crate::packing_views::PackingViews;
use crate::part_step::{PartJudge, part_step};
use crate::reduce::Reduced;
use crate::refine::{Refining, RestCost};
use crate::refit::{Fit, GAIN_FOUND, refined};
use crate::report::{CompressionReport, RefineReport};
use crate::target::Target;

/// Packs part by part to a PSNR of about `decibels`. `renderer` draws the parts, which
/// are refined if there is `refine`. If `renderer` is `None`, the sensitivity is guessed.
///
/// # Errors
/// As [`stream::pack`], and errors of drawing.
pub(crate) fn in_parts(
    options: &PackOptions,
    decibels: f64,
    refine: Option<Refine>,
    renderer: Option<Renderer>,
    source: &dyn SplatSource,
    sink: Sink<'_>,
    progress: &dyn Progress,
) -> Result<CompressionReport> {
    let clock = Stopwatch::start();
    let parts = Parts { options, decibels, refine, gaussians: source.len() };
    let mut drawn =
        renderer.map(|renderer| Drawn { renderer, parts, progress, look_seconds: 0.0, refined: Vec::new() });
    let guessed = drawn.is_none();
    let observer = drawn.as_mut().map(|drawn| drawn as &mut dyn Observer<Error>);
    let done = stream::pack(source, observer, options, decibels, sink, progress)?;
    let (look_seconds, refined) =
        drawn.map_or((0.0, None), |drawn| (drawn.look_seconds, RefineReport::of_parts(drawn.refined)));
    let pack_seconds = clock.seconds() - look_seconds;
    let report = CompressionReport::in_parts(&done, guessed);
    Ok(CompressionReport { look_seconds, pack_seconds, refined, ..report })
}

/// Draws the parts of a scene.
struct Drawn<'a> {
    renderer: Renderer,
    parts: Parts<'a>,
    progress: &'a dyn Progress,
    look_seconds: f64,
    /// The results of refining the parts until now.
    refined: Vec<RefineReport>,
}

impl Observer<Error> for Drawn<'_> {
    fn observe(&mut self, part: &Splats) -> Result<Observed> {
        let clock = Stopwatch::start();
        let (observed, refined) = self.parts.observe(&mut self.renderer, part, self.progress)?;
        self.look_seconds += clock.seconds();
        self.refined.extend(refined);
        Ok(observed)
    }

    fn refit(&mut self, of: ToRefit<'_, '_>) -> Result<Option<Vec<Appearance>>> {
        refit(of, self.parts.refine, self.parts.gaussians, self.progress).map(Some)
    }

    fn device(&self) -> Option<String> {
        self.renderer.is_gpu().then(|| self.renderer.name().to_owned())
    }
}

/// The choices for the parts of a scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Parts<'a> {
    pub(crate) options: &'a PackOptions,
    pub(crate) decibels: f64,
    pub(crate) refine: Option<Refine>,
    /// Number of Gaussians of all parts.
    pub(crate) gaussians: usize,
}

impl Parts<'_> {
    /// Draws `part` of a scene from views like photographs of the part, from all around it, and from views evenly spread over its
    /// Gaussians. The result has the sensitivity of these pictures, the step factor with which the part has a PSNR of about the
    /// decibels asked for, and the views as the memo. A part without Gaussians has no views. With views from all around alone,
    /// files of the same size were 1.7 dB worse (docs/results/scale.md).
    ///
    /// If parts are refined, fewer Gaussians are packed instead of the part, fitted to its pictures.
    ///
    /// # Errors
    /// [`lexisplat::Error::Cancelled`] within [`Error::Codec`]; on a GPU [`Error::Render`] if the part does not fit.
    pub(crate) fn observe(
        &self,
        renderer: &mut Renderer,
        part: &Splats,
        progress: &dyn Progress,
    ) -> Result<(Observed, Option<RefineReport>)> {
        let Self { options, decibels, .. } = *self;
        if part.is_empty() {
            return Ok((Sensitivity::default().into(), None));
        }
        let (views, even) = PackingViews::found_of_part(renderer, part, progress)?;
        let sensitivity = views.sensitivity(renderer, part, progress)?;
        let mut judge = PartJudge::new(part, [&views.judging_part(), &even], progress)?;
        let (instead, sensitivity, gain, report) = match self.refine {
            Some(effort) => {
                let effort = effort.of_part(part.len(), self.gaussians);
                let refining = Refining::to(part, views.refining_found(part), effort, progress)?;
                let fit = &fit_to(part, &views, progress)?.before_refining();
                let mut removal = Removal { views: &views, renderer, fit, progress };
                let packing = Packing::new(Target::MeanPsnr(decibels)).with_options(options.clone());
                let score = &mut |splats: &Splats| judge.score(splats, progress);
                let Reduced { splats, sensitivity, gain, report, .. } =
                    packing.reduced(part, sensitivity, &mut removal, &refining, score, 0)?;
                (Some(splats), sensitivity, gain, Some(report))
            }
            None => (None, sensitivity, if options.may_change() { GAIN_FOUND } else { 0.0 }, None),
        };
        let packed = instead.as_ref().unwrap_or(part);
        let packer = Packer::new(packed, &sensitivity, options)?;
        let begin = packer.step_for(decibels);
        let step = part_step(&packer, &mut judge, begin, decibels - gain, progress)?;
        // The usual step falls with the root of the number of Gaussians.
        let usual = begin * (packed.len() as f64 / part.len() as f64).sqrt();
        let memo = memo_of(&views);
        drop(packer);
        let step_factor = step / usual;
        Ok((Observed { instead, sensitivity, step_factor, memo }, report))
    }
}

/// Returns base colours and opacities that are fitted to pictures of the part alone. If parts are refined, SH-rest is fitted too. The
/// memo is that of [`Parts::observe`]. The whole scene has `gaussians` Gaussians.
///
/// # Errors
/// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`Error::Codec`].
pub(crate) fn refit(
    ToRefit { part, model, quantised, sensitivities, step, memo }: ToRefit<'_, '_>,
    refine: Option<Refine>,
    gaussians: usize,
    progress: &dyn Progress,
) -> Result<Vec<Appearance>> {
    let views = views_of(memo)?;
    if let Some(effort) = refine {
        let effort = effort.of_part(part.len(), gaussians);
        let refining = Refining::to(part, views.refining_found(part), effort, progress)?;
        let cost = RestCost::new(sensitivities.iter().map(|s| s.colour), step);
        return refined(&refining, quantised, model.into_splats(), &cost, progress);
    }
    fit_to(part, &views, progress)?.appearances(Scene::from(&model), &sensitivities, progress)
}

/// Draws the pictures of `part` that base colours and opacities are fitted to. Parts are for scenes that leave little memory, so
/// nothing is kept from one step of a fit to the next.
fn fit_to(part: &Splats, views: &PackingViews, progress: &dyn Progress) -> Result<Fit> {
    Ok(Fit::to(part, views.fitting_part(part), false, progress)?.keeping(0))
}
