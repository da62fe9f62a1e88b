//! Fits the base colours of a packed scene to the pictures of the original.
//!
//! Pictures are linear in base colours. So what removal and quantisation do to pictures is made up for by a linear
//! least-squares problem, which the method of conjugate gradients solves through the renderer and its adjoint
//! (docs/METHOD.md, "Refitting").

use std::borrow::Borrow;

use lexisplat::packed::{Packed, Packer, Quantised};
use lexisplat::sh::C0;
use lexisplat::{CompressReport, Model, Progress, Splats};
use lexisplat_render::{Camera, ColourAdjoint, ColourErrors, Image, Renderer, Scene};

use super::only_cancels::OnlyCancels;
use super::views::PackingViews;
use crate::drawing::{DrawOptions, draw_views};
use crate::error::Result;

/// Steps of the method of conjugate gradients. Each takes about as long as drawing all views.
const STEPS: usize = 3;
/// Weight of the distance to the colours before, as a share of a Gaussian's weight in pictures. Other views than those
/// that are fitted to depend on them too.
const RIDGE: f32 = 0.5;
/// Share of the sums of rows in the preconditioner. The diagonal of the matrix is smaller than those.
const ROW: f32 = 0.3;
/// By how much refitting raises the judged quality, in dB, about: with given cameras and with views that were found.
const GAIN_GIVEN: f64 = 1.8;
const GAIN_FOUND: f64 = 0.5;

/// A packer whose files are refitted, if that is allowed.
pub(super) struct Refitting<S> {
    packer: Packer<S>,
    fit: Option<Fit>,
}

/// What base colours are fitted to.
pub(super) struct Fit {
    cameras: Vec<Camera>,
    /// The original's pictures.
    targets: Vec<Image>,
    /// Whether cameras were given.
    given: bool,
}

impl<S: Borrow<Splats>> Refitting<S> {
    /// Files of `packer`, with base colours as `fit` says or as `packer` makes them.
    pub(super) fn new(packer: Packer<S>, fit: Option<Fit>) -> Self {
        Self { packer, fit }
    }

    /// Number of Gaussians of the scene.
    pub(super) fn len(&self) -> usize {
        self.packer.len()
    }

    /// Whether files are refitted.
    pub(super) fn refits(&self) -> bool {
        self.fit.is_some()
    }

    /// By how much files are expected to be better than they are before they are refitted, in dB.
    pub(super) fn gain(&self) -> f64 {
        self.fit.as_ref().map_or(0.0, |fit| if fit.given { GAIN_GIVEN } else { GAIN_FOUND })
    }

    /// The overall step for pictures of about this PSNR, in dB.
    pub(super) fn step_for(&self, decibels: f64) -> f64 {
        self.packer.step_for(decibels - self.gain())
    }

    /// Packs with an overall step, with or without a `floor` under what is visible.
    ///
    /// # Errors
    /// Errors of packing and drawing.
    pub(super) fn pack(
        &self,
        step: f64,
        floor: bool,
        progress: &dyn Progress,
    ) -> Result<(Packed, CompressReport)> {
        let (quantised, first) = self.quantise(step, floor, progress)?;
        self.refit(&quantised, first, progress)
    }

    /// Packs as [`Self::pack`] does, and does not refit.
    ///
    /// # Errors
    /// Errors of packing.
    pub(super) fn quantise(
        &self,
        step: f64,
        floor: bool,
        progress: &dyn Progress,
    ) -> Result<(Quantised<'_>, (Packed, CompressReport))> {
        let quantised = self.packer.quantise(step, floor, progress)?;
        let first = quantised.finish(None, progress)?;
        Ok((quantised, first))
    }

    /// Refits a file of `quantised`, if that is allowed.
    ///
    /// # Errors
    /// Errors of packing and drawing.
    pub(super) fn refit(
        &self,
        quantised: &Quantised<'_>,
        file: (Packed, CompressReport),
        progress: &dyn Progress,
    ) -> Result<(Packed, CompressReport)> {
        let Some(fit) = &self.fit else { return Ok(file) };
        let model = file.0.unpack()?;
        let dc = &model.geometry().dc;
        let colours = fit.base_colours(Scene::from(&model), dc, quantised.colour_weights(), progress)?;
        drop(model);
        drop(file);
        Ok(quantised.finish(Some(&colours), progress)?)
    }
}

/// Base colours of `model`, which is what a file has of `part`, fitted to pictures of the part alone.
///
/// # Errors
/// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub(super) fn base_colours_of_part(
    part: &Splats,
    model: &Model,
    colour_weights: &[f32],
    progress: &dyn Progress,
) -> Result<Vec<[f32; 3]>> {
    let fit = Fit::to(part, &PackingViews::of_part(part), progress)?;
    fit.base_colours(Scene::from(model), &model.geometry().dc, colour_weights, progress)
}

impl Fit {
    /// Pictures of `splats` to fit to. The processor draws them, for it fits too.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(super) fn to(splats: &Splats, views: &PackingViews, progress: &dyn Progress) -> Result<Self> {
        let cameras = views.fitting(splats);
        let (mut cpu, options) = (Renderer::cpu(), DrawOptions::default());
        let targets = draw_views(&mut cpu, &Scene::from(splats), &cameras, &options, &OnlyCancels(progress))?;
        Ok(Self { cameras, targets, given: views.are_given() })
    }

    /// Base colours of `scene` with which its pictures are nearest to the targets. `dc` are those it has, and
    /// `colour_weights` the sensitivities of its Gaussians to colour.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(super) fn base_colours(
        &self,
        scene: Scene<'_>,
        dc: &[[f32; 3]],
        colour_weights: &[f32],
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; 3]>> {
        let mut adjoint = ColourAdjoint::new(scene, &self.cameras)?;
        let progress = &OnlyCancels(progress);
        let ColourErrors { mut errors, row_sums, .. } = adjoint.of_errors(&self.targets, progress)?;
        // Sensitivities are averaged over three channels, and products with the adjoint are not.
        let ridge: Vec<f32> = colour_weights.iter().map(|w| RIDGE * 3.0 * w).collect();
        let diagonal: Vec<f32> = row_sums
            .iter()
            .zip(&ridge)
            .map(|(row, ridge)| (ROW * row + ridge).max(f32::MIN_POSITIVE))
            .collect();
        let scaled = |rows: &[[f32; 3]]| -> Vec<[f32; 3]> {
            rows.iter().zip(&diagonal).map(|(row, d)| row.map(|v| v / d)).collect()
        };
        let mut found = vec![[0.0_f32; 3]; ridge.len()];
        let mut direction = scaled(&errors);
        let mut norm = dot(&errors, &direction);
        for _ in 0..STEPS {
            let mut product = adjoint.of_pictures(&direction, progress)?;
            for ((product, direction), ridge) in product.iter_mut().zip(&direction).zip(&ridge) {
                add(product, *ridge, direction);
            }
            let along = dot(&direction, &product);
            if along <= 0.0 {
                break;
            }
            let length = single(norm / along);
            for i in 0..found.len() {
                add(&mut found[i], length, &direction[i]);
                add(&mut errors[i], -length, &product[i]);
            }
            let next = scaled(&errors);
            let before = std::mem::replace(&mut norm, dot(&errors, &next));
            let share = single(norm / before);
            for (direction, next) in direction.iter_mut().zip(next) {
                let old = std::mem::replace(direction, next);
                add(direction, share, &old);
            }
        }
        let fitted = |(dc, found): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| dc[c] + found[c] / C0);
        Ok(dc.iter().zip(&found).map(fitted).collect())
    }
}

/// Adds `factor` times `row` to `sum`.
fn add(sum: &mut [f32; 3], factor: f32, row: &[f32; 3]) {
    sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += factor * value);
}

fn dot(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

#[expect(clippy::cast_possible_truncation, reason = "a factor, to single precision")]
fn single(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat::packed::PackOptions;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::compression::{Judge, Looked};
    use crate::views::SceneKind;

    /// The judged quality and the base colours of a file of `splats` at one step.
    fn made(splats: &Splats, options: &PackOptions) -> (f64, Vec<[f32; 3]>, usize) {
        let mut cpu = Renderer::cpu();
        let Looked { views, sensitivity } =
            Looked::at(&mut cpu, splats, None, SceneKind::Auto, &Silent).unwrap();
        let packer = Packer::new(splats.clone(), &sensitivity, options).unwrap();
        let fit = options.may_change().then(|| Fit::to(splats, &views, &Silent).unwrap());
        let refitting = Refitting::new(packer, fit);
        let step = refitting.packer.step_for(34.0);
        let (packed, _) = refitting.pack(step, true, &Silent).unwrap();
        let model = packed.unpack().unwrap();
        // None of the views that judge is fitted to.
        assert!(views.fitting(splats).iter().all(|camera| !views.judging().contains(camera)));
        let mut judge = Judge::new(cpu, splats, &views.some_judging(12), false, &Silent).unwrap();
        (judge.score(&model, &Silent).unwrap().mean, model.geometry().dc.clone(), model.len())
    }

    #[test]
    fn base_colours_make_up_for_errors() {
        let splats = scene(&SampleOptions::new(800, 1));
        let (kept, _, all) = made(&splats, &PackOptions::default().with_keep_all(true));
        let (refitted, colours, some) = made(&splats, &PackOptions::default());
        assert_eq!(all, 800);
        assert!(some < all && some > all / 4, "{some}");
        assert!(refitted > kept + 0.5, "{refitted} {kept}");
        assert!(colours.as_flattened().iter().all(|v| v.is_finite() && v.abs() < 20.0));
    }
}
