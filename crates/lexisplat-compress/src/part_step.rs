//! The quantisation step that a part of a scene needs.

use lexisplat::packed::Packer;
use lexisplat::{Progress, Splats};
use lexisplat_render::{Camera, Renderer, Scene};

use crate::error::Result;
use crate::judge::{Judge, Score};
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

/// The views that judge a part of a scene.
pub(crate) struct PartJudge {
    /// Judges by views like photographs.
    photographs: Judge,
    /// Judges by views evenly spread over the part.
    even: Option<Judge>,
}

impl PartJudge {
    /// Draws `part` from the views `judging`, which are like photographs, and from the views `even`, which are evenly spread over
    /// the part. The processor draws, also if a GPU measured the sensitivity.
    ///
    /// # Errors
    /// As [`Judge::new`].
    pub(crate) fn new(
        part: &Splats,
        [judging, even]: [&[Camera]; 2],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let of = |views: &[Camera]| Judge::of_part(Renderer::cpu(), part, views, progress);
        let even = if even.is_empty() { None } else { Some(of(even)?) };
        Ok(Self { photographs: of(judging)?, even })
    }

    /// Returns the score over views like photographs, or the one over evenly spread views plus [`EVEN_MARGIN`] if this is lower.
    ///
    /// # Errors
    /// As [`Judge::score`].
    pub(crate) fn score<'a>(
        &mut self,
        scene: impl Into<Scene<'a>>,
        progress: &dyn Progress,
    ) -> Result<Score> {
        let scene = scene.into();
        let usual = self.photographs.score(scene, progress)?;
        let Some(even) = &mut self.even else { return Ok(usual) };
        let Score { judged, mean, least } = even.score(scene, progress)?;
        let [judged, mean, least] = [judged, mean, least].map(|decibels| decibels + EVEN_MARGIN);
        Ok(if judged < usual.judged { Score { judged, mean, least } } else { usual })
    }
}

/// Returns the overall step with which a file of `packer`, which packs a part of a scene, has about `decibels` dB by `judge` before
/// it is refitted. The search begins at step `begin`.
///
/// The score at one step gives the next step, until that step was tried before. The step of the file whose score is nearest to
/// `decibels` is chosen; falling short counts [`SHORT_WEIGHT`] times. With a second file that is refitted, and steps of quarter
/// octaves, three copies of room-large in five parts had the same steps, in 27 % more time.
///
/// # Errors
/// Errors of packing and drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub(crate) fn part_step(
    packer: &Packer<&Splats>,
    judge: &mut PartJudge,
    begin: f64,
    decibels: f64,
    progress: &dyn Progress,
) -> Result<f64> {
    let mut log_step = on_grid(libm::log2(begin), STEPS_PER_OCTAVE);
    let mut tries: Vec<Try> = Vec::with_capacity(MOST_FILES);
    while tries.len() < MOST_FILES {
        let (file, _) =
            packer.quantise(libm::exp2(log_step), true, progress)?.finish(None, None, progress)?;
        let value = judge.score(&file.unpack()?, progress)?.judged;
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
    Ok(libm::exp2(nearest.map_or(log_step, |t| t.log_step)))
}

#[cfg(test)]
mod tests {
    use lexisplat::packed::PackOptions;
    use lexisplat::{Sensitivity, Silent};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::parts::Parts;

    #[test]
    fn the_step_is_smaller_where_more_is_asked_and_may_change_less() {
        let part = scene(&SampleOptions::new(1500, 3));
        let factor = |options: PackOptions, decibels: f64| {
            let parts = Parts { options: &options, decibels, refine: None, gaussians: part.len() };
            parts.observe(&mut Renderer::cpu(), &part, &Silent).unwrap().0.step_factor
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
