//! The step of a scene that is packed in parts, found on some of its parts.

use lexisplat::packed::{PackOptions, Packer};
use lexisplat::stream::Observed;
use lexisplat::{Progress, Splats};
use lexisplat_render::Renderer;

use super::judge::Judge;
use super::memo::views_of;
use super::only_cancels::OnlyCancels;
use super::refit::{Fit, Refitting};
use super::target::{DB_PER_HALVING, on_grid};
use crate::error::Result;

/// Views that judge a part.
const JUDGES: usize = 24;
/// Steps in an octave. Scores of one scene in two units differ by 0.1 dB, and finer ones would often give them different steps.
const STEPS_PER_OCTAVE: f64 = 4.0;
/// Largest change of the step's binary logarithm by one file.
const MOST_MOVE: f64 = 2.0;

/// The factor of the usual step with which pictures of `part`, packed as a scene of its own, have about `decibels`. A first file
/// that is not refitted says where a second is, and the second says by how much to correct. The factor of a part without Gaussians is 1.
///
/// # Errors
/// Errors of packing and drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub(super) fn step_factor(
    part: &Splats,
    observed: &Observed,
    options: &PackOptions,
    decibels: f64,
    progress: &dyn Progress,
) -> Result<f64> {
    if part.is_empty() {
        return Ok(1.0);
    }
    // The work around it counts Gaussians.
    let progress = &OnlyCancels(progress);
    let views = views_of(&observed.memo)?;
    let packer = Packer::new(part, &observed.sensitivity, options)?;
    let usual = libm::log2(packer.step_for(decibels));
    let fit = if options.may_change() {
        Some(Fit::to(part, views.fitting_part(part), false, progress)?)
    } else {
        None
    };
    let refitting = Refitting::new(packer, fit);
    // A GPU that looks need not judge too.
    let mut judge = Judge::of_part(Renderer::cpu(), part, &views.some_judging(JUDGES), progress)?;
    let mut log_step = on_grid(usual, STEPS_PER_OCTAVE);
    for is_last in [false, true] {
        let (quantised, file) = refitting.quantise(libm::exp2(log_step), true, progress)?;
        let (file, gain) = match is_last {
            true => (refitting.refit(&quantised, file, progress)?.file, 0.0),
            false => (file, refitting.gain()),
        };
        let reached = judge.score(&file.0.unpack()?, progress)?.judged + gain;
        let by = ((reached - decibels) / DB_PER_HALVING).clamp(-MOST_MOVE, MOST_MOVE);
        log_step = on_grid(log_step + by, STEPS_PER_OCTAVE);
    }
    Ok(libm::exp2(log_step - usual))
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::compression::parts::observe;

    #[test]
    fn the_step_is_smaller_where_more_is_asked_and_may_change_less() {
        let part = scene(&SampleOptions::new(1500, 3));
        let observed = observe(&mut Renderer::cpu(), &part, &Silent).unwrap();
        let factor = |options: PackOptions, decibels: f64| {
            step_factor(&part, &observed, &options, decibels, &Silent).unwrap()
        };
        let usual = factor(PackOptions::default(), 40.0);
        assert!(usual > 0.02 && usual < 50.0, "{usual}");
        // The same file is found from another expectation.
        let packed = |decibels: f64, factor: f64| {
            let sensitivity = lexisplat::Sensitivity::heuristic(&part.geometry);
            factor * Packer::new(&part, &sensitivity, &PackOptions::default()).unwrap().step_for(decibels)
        };
        assert!(packed(36.0, factor(PackOptions::default(), 36.0)) > 1.2 * packed(40.0, usual));
    }
}
