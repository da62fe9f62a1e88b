//! Fits the base colours and opacities of a packed scene to the pictures of the original.
//!
//! Pictures are linear in base colours, and nearly linear in small changes of opacities. A linear least-squares problem
//! therefore gives the colours and opacities that make up for removal and quantisation. The method of conjugate gradients
//! solves the problem with the renderer and its adjoint (docs/METHOD.md, "Refitting").

use std::borrow::Borrow;

use lexisplat::packed::{Appearance, Packed, Packer, Quantised};
use lexisplat::sh::C0;
use lexisplat::{AppearanceSensitivity, CompressReport, Geometry, Progress, Splats, Stage};
use lexisplat_render::{Camera, GaussianChange, Image, PictureAdjoint, PictureErrors, Renderer, Scene};

use crate::drawing::{DrawOptions, draw_views};
use crate::effort::RefineSteps;
use crate::error::Result;
use crate::interim::interim_changes;
use crate::one_step::OneStep;
use crate::refine::{Free, Refining, RestCost};
use crate::solve::{KEPT_BYTES, ROW, kinds, solve};

/// Number of conjugate-gradient steps with given cameras and with found views. Each step takes about as long as drawing all
/// views. More steps gain less on other views than the fitted ones (docs/METHOD.md).
const STEPS_GIVEN: usize = 5;
const STEPS_FOUND: usize = 3;
/// Number of these steps where all values are refined later. With cameras more steps change the refined scenes of
/// bonsai-3dgs, room and room-large by less than 0.1 dB (docs/METHOD.md, "Refining").
const STEPS_BEFORE_REFINING: usize = 2;
/// Weight of the distance to the colours and opacities before the fit, as a multiple of the sensitivity of pictures.
/// The term is there because other views than the fitted ones depend on these values too.
const RIDGE: f32 = 0.5;
/// Factor on the diagonal of the matrix in the preconditioner of opacities.
const OPACITY_DIAGONAL: f32 = 4.0;
/// Largest change of the logarithm of an opacity. Pictures are nearly linear only in small changes.
const MOST_LOG_OPACITY: f32 = 0.5;
/// Approximate gain of the judged quality by refitting, in dB, with given cameras and with found views.
const GAIN_GIVEN: f64 = 4.0;
pub(crate) const GAIN_FOUND: f64 = 0.8;

/// A packer whose files are refitted, if refitting is allowed.
pub(crate) struct Refitting<S> {
    packer: Packer<S>,
    fit: Option<Fit>,
    refining: Option<Refining>,
    /// The expected gain of the judged quality by refitting, in dB.
    pub(crate) gain: f64,
}

/// The views and pictures to which base colours and opacities are fitted.
#[derive(Clone)]
pub(crate) struct Fit {
    cameras: Vec<Camera>,
    /// The original's pictures.
    targets: Vec<Image>,
    /// Whether cameras were given.
    given: bool,
    /// Number of conjugate-gradient steps.
    steps: usize,
    /// Largest number of bytes that are kept from one step to the next.
    kept_bytes: u64,
}

impl<S: Borrow<Splats>> Refitting<S> {
    /// Returns files of `packer`. If there is a `fit`, their base colours and opacities are fitted to it; otherwise they
    /// are those of `packer`.
    pub(crate) fn new(packer: Packer<S>, fit: Option<Fit>) -> Self {
        let gain = fit.as_ref().map_or(0.0, |fit| if fit.given { GAIN_GIVEN } else { GAIN_FOUND });
        Self { packer, fit, refining: None, gain }
    }

    /// Fits files to `refining`, instead of fitting base colours and opacities alone. `gain` is the expected gain, in dB.
    pub(crate) fn refining(self, refining: Refining, gain: f64) -> Self {
        Self { refining: Some(refining), gain, ..self }
    }

    /// Returns whether files are refined. Making the same file once more then takes minutes.
    pub(crate) fn refines(&self) -> bool {
        self.refining.is_some()
    }

    /// Returns the number of Gaussians of the scene.
    pub(crate) fn len(&self) -> usize {
        self.packer.len()
    }

    /// Returns whether files are refitted.
    pub(crate) fn refits(&self) -> bool {
        self.fit.is_some()
    }

    /// Returns the overall step for pictures of about this PSNR, in dB, after refitting.
    pub(crate) fn step_for(&self, decibels: f64) -> f64 {
        self.packer.step_for(decibels - self.gain)
    }

    /// Packs at an overall `step`, without refitting. `floor` tells whether visible Gaussians keep a least precision.
    ///
    /// # Errors
    /// Errors of packing.
    pub(crate) fn quantise(
        &self,
        step: f64,
        floor: bool,
        progress: &dyn Progress,
    ) -> Result<(Quantised<'_>, (Packed, CompressReport))> {
        let quantised = self.packer.quantise(step, floor, progress)?;
        let first = quantised.finish(None, None, progress)?;
        Ok((quantised, first))
    }

    /// Refits a file of `quantised`, if refitting is allowed. The pictures of its first layer alone are not fitted yet.
    ///
    /// # Errors
    /// Errors of packing and drawing.
    pub(crate) fn refit<'a>(
        &'a self,
        step: f64,
        quantised: &Quantised<'a>,
        file: (Packed, CompressReport),
        progress: &dyn Progress,
    ) -> Result<Refitted<'a>> {
        let Some(fit) = &self.fit else { return Ok(Refitted::complete(file)) };
        let model = file.0.unpack()?;
        drop(file);
        if let Some(refining) = &self.refining {
            let cost = RestCost::new(quantised.sensitivities().iter().map(|s| s.colour), step);
            let mut again = quantised.clone();
            let shown = refined(refining, &mut again, model.into_splats(), &cost, progress)?;
            let file = again.finish(Some(&shown), None, progress)?;
            return Ok(Refitted { shown: Some(shown), again: Some(again), is_complete: false, file });
        }
        let shown = fit.appearances(Scene::from(&model), quantised.sensitivities(), progress)?;
        drop(model);
        let file = quantised.finish(Some(&shown), None, progress)?;
        Ok(Refitted { shown: Some(shown), again: None, is_complete: false, file })
    }

    /// Fits the pictures of the first layer alone of a file of `quantised`, if it has a first layer. The whole scene stays
    /// the same.
    ///
    /// # Errors
    /// Errors of packing and drawing.
    pub(crate) fn complete(
        &self,
        quantised: &Quantised<'_>,
        refitted: Refitted<'_>,
        progress: &dyn Progress,
    ) -> Result<(Packed, CompressReport)> {
        let Refitted { shown, again, is_complete, file } = refitted;
        let Some(fit) = self.fit.as_ref().filter(|_| !is_complete) else { return Ok(file) };
        let Some(first) = file.0.first_layer()? else { return Ok(file) };
        drop(file);
        let changes = interim_changes(first.into_splats(), &fit.cameras, &fit.targets, progress)?;
        Ok(again.as_ref().unwrap_or(quantised).finish(shown.as_deref(), Some(&changes), progress)?)
    }

    /// Packs at an overall `step`: calls [`Self::quantise`], [`Self::refit`] and [`Self::complete`].
    ///
    /// # Errors
    /// Errors of packing and drawing.
    pub(crate) fn pack(
        &self,
        step: f64,
        floor: bool,
        progress: &dyn Progress,
    ) -> Result<(Packed, CompressReport)> {
        let (quantised, first) = self.quantise(step, floor, progress)?;
        let refitted = self.refit(step, &quantised, first, progress)?;
        self.complete(&quantised, refitted, progress)
    }
}

/// A file with refitted base colours and opacities.
pub(crate) struct Refitted<'a> {
    /// The fitted colours and opacities; `None` if they are the scene's own.
    shown: Option<Vec<Appearance>>,
    /// The scene with fitted SH-rest, if that was fitted.
    again: Option<Quantised<'a>>,
    /// Whether nothing is left to fit.
    is_complete: bool,
    pub(crate) file: (Packed, CompressReport),
}

/// Fits the SH-rest, the base colours and the opacities of `model`, a file of `quantised`, codes the SH-rest, and then fits
/// base colours and opacities once more, which are the result.
///
/// # Errors
/// Errors of packing and drawing.
pub(crate) fn refined(
    refining: &Refining,
    quantised: &mut Quantised<'_>,
    mut model: Splats,
    cost: &RestCost,
    progress: &dyn Progress,
) -> Result<Vec<Appearance>> {
    let RefineSteps { radiance, appearance, .. } = refining.steps;
    refining.refine(&mut model, Free::Radiance, radiance, cost, None, progress)?;
    quantised.set_sh_rest(&model.sh_rest, progress)?;
    let shown = appearances(&model.geometry);
    let mut model = quantised.finish(Some(&shown), None, progress)?.0.unpack()?.into_splats();
    for (i, shown) in shown.into_iter().enumerate() {
        shown.give(&mut model.geometry, i);
    }
    refining.refine(&mut model, Free::Appearance, appearance, cost, None, progress)?;
    Ok(appearances(&model.geometry))
}

fn appearances(geometry: &Geometry) -> Vec<Appearance> {
    let shown = |i| {
        let shown = Appearance::of(geometry, i);
        Appearance { log_opacity: shown.log_opacity.min(0.0), ..shown }
    };
    (0..geometry.len()).map(shown).collect()
}

impl Refitted<'_> {
    /// Wraps a file of which nothing is left to fit.
    pub(crate) fn complete(file: (Packed, CompressReport)) -> Self {
        Self { shown: None, again: None, is_complete: true, file }
    }

    /// Wraps a file with the scene's own colours and opacities. The pictures of its first layer alone are not fitted yet.
    pub(crate) fn with_own(file: (Packed, CompressReport)) -> Self {
        Self { shown: None, again: None, is_complete: false, file }
    }
}

impl Fit {
    /// Draws pictures of `splats` from `cameras`, to fit to. `given` tells whether the cameras were given or found. The
    /// processor draws, because it also fits.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(crate) fn to(
        splats: &Splats,
        cameras: Vec<Camera>,
        given: bool,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (mut cpu, options) = (Renderer::cpu(), DrawOptions::default());
        let targets = draw_views(&mut cpu, &Scene::from(splats), &cameras, &options, progress)?;
        let steps = if given { STEPS_GIVEN } else { STEPS_FOUND };
        Ok(Self { cameras, targets, given, steps, kept_bytes: KEPT_BYTES })
    }

    /// Returns this fit with few steps, for a scene of which all values are refined later.
    pub(crate) fn before_refining(self) -> Self {
        Self { steps: STEPS_BEFORE_REFINING, ..self }
    }

    /// Returns this fit with another largest number of bytes that are kept from one step to the next. It changes no result.
    pub(crate) fn keeping(self, kept_bytes: u64) -> Self {
        Self { kept_bytes, ..self }
    }

    /// Returns the base colours and opacities of `scene` with which its pictures are nearest to the targets. `sensitivities`
    /// has the sensitivity of the pictures to the appearance of each Gaussian.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(crate) fn appearances(
        &self,
        scene: Scene<'_>,
        sensitivities: &[AppearanceSensitivity],
        progress: &dyn Progress,
    ) -> Result<Vec<Appearance>> {
        let mut adjoint = PictureAdjoint::new(scene, &self.cameras, self.kept_bytes)?;
        // The views are drawn once for the errors and once in each step.
        progress.begin(Stage::Draw, ((1 + self.steps) * self.cameras.len()) as u64);
        let rounds = &OneStep(progress);
        let PictureErrors { errors, row_sums, opacity_squares, .. } =
            adjoint.of_errors(&self.targets, rounds)?;
        // Sensitivities are means over three channels, and products with the adjoint are sums. Hence the factor 3.
        let ridge: Vec<GaussianChange<4>> =
            sensitivities.iter().map(|s| kinds([s.colour, s.opacity].map(|s| RIDGE * 3.0 * s))).collect();
        let mut diagonal = Vec::with_capacity(ridge.len());
        for (i, [colour, _, _, opacity]) in ridge.iter().enumerate() {
            let own = [ROW * row_sums[i] + colour, OPACITY_DIAGONAL * opacity_squares[i] + opacity];
            diagonal.push(kinds(own));
        }
        let found = solve(&mut adjoint, errors, &ridge, &diagonal, self.steps, rounds)?;
        progress.end();
        let geometry = scene.geometry();
        Ok(found.iter().enumerate().map(|(i, change)| changed(geometry, i, change)).collect())
    }
}

/// Returns the appearance of Gaussian `i` after a change.
fn changed(geometry: &Geometry, i: usize, change: &GaussianChange<4>) -> Appearance {
    let Appearance { dc, log_opacity } = Appearance::of(geometry, i);
    let more = change[3].clamp(-MOST_LOG_OPACITY, MOST_LOG_OPACITY);
    Appearance {
        dc: std::array::from_fn(|c| dc[c] + change[c] / C0),
        log_opacity: (log_opacity + more).min(0.0),
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat::packed::PackOptions;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::views::Viewpoints;
    use crate::{Judge, Looked};

    /// The judged quality of a file of `splats` at one step, and its scene.
    fn made(splats: &Splats, options: &PackOptions) -> (f64, Splats) {
        let mut cpu = Renderer::cpu();
        let Looked { views, sensitivity } =
            Looked::at(&mut cpu, splats, None, Viewpoints::Auto, &Silent).unwrap();
        let packer = Packer::new(splats.clone(), &sensitivity, options).unwrap();
        let fit =
            options.may_change().then(|| Fit::to(splats, views.fitting(splats), false, &Silent).unwrap());
        let refitting = Refitting::new(packer, fit);
        let step = refitting.packer.step_for(34.0);
        let (packed, _) = refitting.pack(step, true, &Silent).unwrap();
        let model = packed.unpack().unwrap();
        // None of the views that judge is fitted to.
        assert!(views.fitting(splats).iter().all(|camera| !views.judging().contains(camera)));
        let mut judge = Judge::new(cpu, splats, views.judging(), false, &Silent).unwrap();
        (judge.score(&model, &Silent).unwrap().mean, model.into_splats())
    }

    #[test]
    fn base_colours_and_opacities_make_up_for_errors() {
        let splats = scene(&SampleOptions::new(1200, 1));
        let (kept, all) = made(&splats, &PackOptions::default().with_keep_all(true));
        let (refitted, some) = made(&splats, &PackOptions::default());
        assert_eq!(all.len(), 1200);
        assert!(some.len() < all.len() && some.len() > all.len() / 4, "{}", some.len());
        assert!(refitted > kept + 0.5, "{refitted} {kept}");
        let Geometry { dc, opacities, .. } = &some.geometry;
        assert!(dc.as_flattened().iter().chain(opacities).all(|v| v.is_finite() && v.abs() < 20.0));
    }

    #[test]
    fn opacities_move_little() {
        let mut geometry = scene(&SampleOptions::new(3, 1)).geometry;
        for (opacity, change) in [(-1.0, 9.0), (-1.0, -9.0), (9.0, 0.4), (-200.0, 0.1)] {
            geometry.opacities[1] = opacity;
            let before = Appearance::of(&geometry, 1);
            let after = changed(&geometry, 1, &[C0, 0.0, -C0, change]);
            assert!((after.dc[0] - before.dc[0] - 1.0).abs() < 1e-5, "{after:?} {before:?}");
            let moved = after.log_opacity - before.log_opacity;
            assert!(moved.abs() <= MOST_LOG_OPACITY && after.log_opacity <= 0.0, "{after:?} {before:?}");
        }
    }
}
