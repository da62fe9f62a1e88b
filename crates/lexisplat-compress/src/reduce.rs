//! The scene that a refined file is packed from: fewer Gaussians, fitted to the pictures of all.

use lexisplat::packed::Packer;
use lexisplat::{Sensitivity, Splats};

use crate::effort::RefineSteps;
use crate::error::{Error, Result};
use crate::fewer::Removal;
use crate::judge::Score;
use crate::packing::{Packing, Quality};
use crate::refine::{Free, Refining, RestCost};
use crate::report::RefineReport;
use crate::target::Target;

/// Amounts by which the quality of the Gaussians that stay may fall short of the quality asked for before they are refined,
/// in dB: with given cameras after [`RefineSteps::below`], and with found views. After a fit that gains too little more Gaussians
/// stay, by the next amount. Fits gain less in found views, which show more.
const NEXT_BELOW_GIVEN: [f64; 2] = [-1.5, -6.0];
const BELOW_FOUND: f64 = -5.0;
/// Least amount by which the quality exceeds the quality asked for after the fit, in dB. Quantisation uses it up. With less
/// it needs so fine steps that the file becomes larger. lego with 1.1 and 1.5 takes 0.94 of the bytes of the next try, in which
/// more Gaussians stay (docs/METHOD.md, appendix, "After the last removal").
const ABOVE: f64 = 1.0;
/// Approximate gain by fits to the quantised scene, as a share of the amount by which the quality exceeds the quality asked for
/// before quantisation: with given cameras, which have 0.1 (lego) to 0.7 (room), and with found views.
const GAIN_GIVEN: f64 = 0.55;
const GAIN_FOUND: f64 = 0.03;
/// Bytes of a Gaussian in a refined file, from which a size gives the number of Gaussians.
const BYTES_EACH: f64 = 10.5;
/// Quality at which short rows of SH-rest pay if the target is a size, in dB.
const SIZE_DB: f64 = 40.0;

/// A scene of fewer Gaussians, fitted to the pictures of all.
pub(crate) struct Reduced {
    pub(crate) splats: Splats,
    pub(crate) sensitivity: Sensitivity,
    pub(crate) report: RefineReport,
    /// Score before quantisation.
    score: Score,
    /// Expected gain by fits to the quantised scene, in dB.
    pub(crate) gain: f64,
}

impl Packing {
    /// Removes and merges Gaussians of `splats` until the rest shows about the quality asked for, or can have about the size
    /// asked for. Then fits the rest to `refining`. `sensitivity` is the sensitivity of `splats`, `score` scores scenes over the
    /// views that judge, and `source_bytes` is the size of the source.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(crate) fn reduced(
        &self,
        splats: &Splats,
        sensitivity: Sensitivity,
        removal: &mut Removal<'_>,
        refining: &Refining,
        score: &mut dyn FnMut(&Splats) -> Result<Score>,
        source_bytes: u64,
    ) -> Result<Reduced> {
        let given = removal.views.are_given();
        let (decibels, least) = match self.quality {
            Quality::Target(target @ (Target::Size(_) | Target::Ratio(_))) => {
                let bytes = target.bytes(source_bytes);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a number of Gaussians"
                )]
                let most = (bytes / BYTES_EACH).ceil() as usize;
                let made = removal.at_most(most.max(1), splats, sensitivity)?;
                return self.fitted(made, removal, refining, score, SIZE_DB);
            }
            Quality::Target(Target::MinPsnr(decibels)) => (decibels, true),
            Quality::Target(target) => (target.asked(), false),
            Quality::Preset(preset) => (preset.decibels(), false),
        };
        let value = |score: Score| if least { score.least } else { score.judged };
        let (first, more) = match given {
            true => (refining.steps.below(), &NEXT_BELOW_GIVEN[..]),
            false => (BELOW_FOUND, &[][..]),
        };
        let mut tries = std::iter::once(first).chain(more.iter().copied());
        loop {
            let below = tries.next();
            let made = match below {
                Some(below) => {
                    let quality = &mut |splats: &Splats| Ok::<_, Error>(value(score(splats)?));
                    removal.down_to(decibels - below, splats, sensitivity.clone(), quality)?
                }
                None => (splats.clone(), sensitivity.clone()),
            };
            let fitted = self.fitted(made, removal, refining, score, decibels)?;
            let reached = value(fitted.score);
            if below.is_none() || reached >= decibels + ABOVE {
                let share = match self.quality {
                    // The file is judged beside the reduced scene, and fitted to the pictures of the original.
                    Quality::Preset(_) if self.max_gaussians.is_some() => 0.0,
                    _ if given => GAIN_GIVEN,
                    _ => GAIN_FOUND,
                };
                return Ok(Reduced { gain: share * (reached - decibels), ..fitted });
            }
        }
    }

    /// Fits a scene to `refining`, and measures its sensitivity again. `decibels` is the quality asked for.
    fn fitted(
        &self,
        (mut splats, sensitivity): (Splats, Sensitivity),
        removal: &mut Removal<'_>,
        refining: &Refining,
        score: &mut dyn FnMut(&Splats) -> Result<Score>,
        decibels: f64,
    ) -> Result<Reduced> {
        let progress = removal.progress;
        let RefineSteps { all, .. } = refining.steps;
        let before = score(&splats)?;
        // The step is that of all pictures, and with found views only the hardest of them judge.
        let all_pictures = decibels + before.mean - before.judged;
        let step = Packer::new(&splats, &sensitivity, &self.options)?.step_for(all_pictures);
        let cost = RestCost::new(sensitivity.colour.iter().copied(), step);
        let shares = refining.shares(&splats, &sensitivity, before.mean);
        refining.refine(&mut splats, Free::All, all, &cost, Some(&shares), progress)?;
        let score = score(&splats)?;
        let report = RefineReport {
            steps: all,
            gaussians: splats.len(),
            before_psnr: before.judged,
            after_psnr: score.judged,
        };
        let sensitivity = removal.views.sensitivity(removal.renderer, &splats, progress)?;
        Ok(Reduced { splats, sensitivity, report, score, gain: 0.0 })
    }
}
