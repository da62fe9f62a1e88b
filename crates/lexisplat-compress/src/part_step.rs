//! The quantisation step that a part of a scene needs.

use lexisplat::packed::{PackOptions, Packer};
use lexisplat::{Progress, Sensitivity, Splats};
use lexisplat_render::Renderer;

use crate::error::Result;
use crate::judge::Judge;
use crate::packing_views::PackingViews;
use crate::refit::GAIN_FOUND;
use crate::target::{DB_PER_HALVING, on_grid};

/// Number of steps in an octave. Scores of one small scene in two units differ by up to 1 dB, which is a fifth of an
/// octave. Finer steps would therefore often differ too.
const STEPS_PER_OCTAVE: f64 = 2.0;
/// Largest number of files made.
const MOST_FILES: usize = 4;
/// Views that are evenly spread over a part may show less than views like photographs by this many decibels.
const EVEN_MARGIN: f64 = 1.0;
/// Largest change of the binary logarithm of the step after one file.
const MOST_MOVE: f64 = 2.0;

/// Returns the factor on the usual step with which pictures of `part` have a PSNR of about `decibels`.
///
/// The part is packed as a scene of its own, with `views` and their `sensitivity`. The score of a file at one step gives
/// the next step, until that step was tried before. The step of the file whose score is nearest to `decibels` is chosen. No
/// file is refitted: [`GAIN_FOUND`] stands for the gain of refitting. With a second file that is refitted, and steps of
/// quarter octaves, three copies of room-large in five parts had the same steps, in 27 % more time.
///
/// # Errors
/// Errors of packing and drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub(crate) fn step_factor(
    part: &Splats,
    views: &PackingViews,
    sensitivity: &Sensitivity,
    options: &PackOptions,
    decibels: f64,
    progress: &dyn Progress,
) -> Result<f64> {
    let packer = Packer::new(part, sensitivity, options)?;
    let usual = libm::log2(packer.step_for(decibels));
    let gain = if options.may_change() { GAIN_FOUND } else { 0.0 };
    // The processor judges, also if a GPU measured the sensitivity.
    let mut judge = Judge::of_part(Renderer::cpu(), part, &views.judging_part(), progress)?;
    let even = views.judging_evenly();
    let mut evenly =
        (!even.is_empty()).then(|| Judge::of_part(Renderer::cpu(), part, &even, progress)).transpose()?;
    let mut log_step = on_grid(usual, STEPS_PER_OCTAVE);
    // Each step that was tried, and by how many decibels its file misses.
    let mut tried: Vec<(f64, f64)> = Vec::with_capacity(MOST_FILES);
    while tried.len() < MOST_FILES {
        let (file, _) =
            packer.quantise(libm::exp2(log_step), true, progress)?.finish(None, None, progress)?;
        let unpacked = file.unpack()?;
        let mut reached = judge.score(&unpacked, progress)?.judged;
        if let Some(evenly) = &mut evenly {
            reached = reached.min(evenly.score(&unpacked, progress)?.judged + EVEN_MARGIN);
        }
        let off = reached + gain - decibels;
        tried.push((log_step, off.abs()));
        let by = (off / DB_PER_HALVING).clamp(-MOST_MOVE, MOST_MOVE);
        let next = on_grid(log_step + by, STEPS_PER_OCTAVE);
        if tried.iter().any(|(step, _)| *step == next) {
            break;
        }
        log_step = next;
    }
    let nearest = tried.into_iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let log_step = nearest.map_or(log_step, |(step, _)| step);
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
