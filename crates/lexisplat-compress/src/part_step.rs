//! The quantisation step that a part of a scene needs.

use lexisplat::packed::{PackOptions, Packer};
use lexisplat::{Progress, Sensitivity, Splats};
use lexisplat_render::{Camera, Renderer};

use crate::error::Result;
use crate::judge::Judge;
use crate::refit::GAIN_FOUND;
use crate::target::{DB_PER_HALVING, Try, on_grid};

/// Number of steps in an octave. Scores of one small scene in two units differ by up to 1 dB, which is a fifth of an
/// octave. Finer steps would therefore often differ too.
const STEPS_PER_OCTAVE: f64 = 2.0;
/// Largest number of files made.
const MOST_FILES: usize = 4;
/// Views that are evenly spread over a part may show less than views like photographs by this many decibels.
const EVEN_MARGIN: f64 = 1.0;
/// Factor on the amount by which a file falls short of the quality, beside the amount by which another one exceeds it. A loss that
/// nobody asked for is worse than bytes that nobody needs.
const SHORT_WEIGHT: f64 = 2.0;
/// Largest change of the binary logarithm of the step after one file.
const MOST_MOVE: f64 = 2.0;

/// Returns the factor on the usual step with which pictures of `part` have a PSNR of about `decibels`.
///
/// The part is packed as a scene of its own, with its `sensitivity`. The views `judging`, which are like photographs, and the
/// views `even`, which are evenly spread over the part, score a file. The score at one step gives the next step, until that step
/// was tried before. The step of the file whose score is nearest to `decibels` is chosen; falling short counts [`SHORT_WEIGHT`]
/// times. No file is refitted: [`GAIN_FOUND`] stands for the gain of refitting. With a second file that is refitted, and steps of
/// quarter octaves, three copies of room-large in five parts had the same steps, in 27 % more time.
///
/// # Errors
/// Errors of packing and drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub(crate) fn step_factor(
    part: &Splats,
    [judging, even]: [&[Camera]; 2],
    sensitivity: &Sensitivity,
    options: &PackOptions,
    decibels: f64,
    progress: &dyn Progress,
) -> Result<f64> {
    let packer = Packer::new(part, sensitivity, options)?;
    let usual = libm::log2(packer.step_for(decibels));
    let gain = if options.may_change() { GAIN_FOUND } else { 0.0 };
    // The processor judges, also if a GPU measured the sensitivity.
    let judge_of = |views: &[Camera]| Judge::of_part(Renderer::cpu(), part, views, progress);
    let mut judges = vec![(judge_of(judging)?, 0.0)];
    if !even.is_empty() {
        judges.push((judge_of(even)?, EVEN_MARGIN));
    }
    let mut log_step = on_grid(usual, STEPS_PER_OCTAVE);
    let mut tries: Vec<Try> = Vec::with_capacity(MOST_FILES);
    while tries.len() < MOST_FILES {
        let (file, _) =
            packer.quantise(libm::exp2(log_step), true, progress)?.finish(None, None, progress)?;
        let unpacked = file.unpack()?;
        let mut least = f64::NAN;
        for (judge, margin) in &mut judges {
            least = least.min(judge.score(&unpacked, progress)?.judged + *margin);
        }
        let value = least + gain;
        tries.push(Try { log_step, value });
        let by = ((value - decibels) / DB_PER_HALVING).clamp(-MOST_MOVE, MOST_MOVE);
        let next = on_grid(log_step + by, STEPS_PER_OCTAVE);
        if tries.iter().any(|t| t.log_step == next) {
            break;
        }
        log_step = next;
    }
    let off = |t: &Try| (t.value - decibels).max(SHORT_WEIGHT * (decibels - t.value));
    let nearest = tries.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
    let log_step = nearest.map_or(log_step, |t| t.log_step);
    Ok(libm::exp2(log_step - usual))
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::parts::observe;

    #[test]
    fn the_step_is_smaller_where_more_is_asked_and_may_change_less() {
        let part = scene(&SampleOptions::new(1500, 3));
        let factor = |options: PackOptions, decibels: f64| {
            observe(&mut Renderer::cpu(), &part, &options, decibels, &Silent).unwrap().step_factor
        };
        let usual = factor(PackOptions::default(), 40.0);
        assert!(usual > 0.02 && usual < 50.0, "{usual}");
        // The same file is found from another expectation.
        let packed = |decibels: f64, factor: f64| {
            let sensitivity = Sensitivity::guess(&part.geometry);
            factor * Packer::new(&part, &sensitivity, &PackOptions::default()).unwrap().step_for(decibels)
        };
        assert!(packed(36.0, factor(PackOptions::default(), 36.0)) > 1.2 * packed(40.0, usual));
    }
}
