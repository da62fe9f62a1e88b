//! The search for the smallest file of a quality, or for the best file of a size.

use std::borrow::Borrow;

use lexisplat::lexi::LexiWriter;
use lexisplat::packed::{Packed, Preset, ReachedRecord, TargetRecord};
use lexisplat::{CompressReport, Progress, Splats};

use crate::error::{Error, Result};
use crate::judge::{Judge, Score, reached};
use crate::refit::{Refitted, Refitting};

/// Largest amount by which a quality may exceed the target, in dB.
const CLOSE_DB: f64 = 0.1;
/// The same of a refined file, of which each try takes minutes.
const REFINED_CLOSE_DB: f64 = 0.2;
/// Largest share by which a size may fall short of the target.
const CLOSE_SIZE: f64 = 0.01;
/// Largest expected miss of a preset's first file, in dB, for which the file is refitted at its own step. After a larger
/// miss another step is used first.
const CLOSE_FIRST: f64 = 0.5;
/// Largest miss of a preset's aim, in dB, after which no further step is tried.
const CLOSE_PRESET: f64 = 0.5;
/// Number of steps in an octave for presets. The scores of a scene in other units differ in the last digits, and the coarse
/// grid gives the same step. At another step errors fall differently, which changes the pictures of few Gaussians by half a
/// decibel.
const STEPS_PER_OCTAVE: f64 = 16.0;
/// Largest expected miss of the target at which a file is refitted for the first time, in dB and in the binary logarithm of
/// bytes.
const NEAR_DB: f64 = 0.7;
const NEAR_LOG_BYTES: f64 = 0.1;
/// Factor on the largest expected miss once the gain of refitting has been measured.
const NEAR_AGAIN: f64 = 0.2;
/// Largest margin of the search, as a share of the amount by which a target may be exceeded.
const MOST_MARGIN: f64 = 0.75;
/// Largest number of packings tried.
const MAX_TRIES: usize = 14;
/// Largest number of packings tried if the target is the least PSNR of a view. One Gaussian changes this PSNR by up to 1.5
/// dB from one step to the next, so more steps must be tried.
const MAX_TRIES_FOR_LEAST: usize = 20;
/// First estimate of the gain when the step is halved, in dB.
pub(crate) const DB_PER_HALVING: f64 = 4.5;
/// The same of a refined file. It is less, because fits win back less at a smaller step: with cameras 2.5 dB on bonsai-3dgs and
/// room-large, 3.8 on room.
const REFINED_DB_PER_HALVING: f64 = 2.8;
/// Quality at which [`FIRST_BYTES`] is estimated, in dB.
const FIRST_DB: f64 = 40.0;
/// First estimate of the bytes for each Gaussian at [`FIRST_DB`].
const FIRST_BYTES: f64 = 8.0;
/// First estimate of the factor by which the file grows when the step is halved.
const BYTES_PER_HALVING: f64 = 1.4;
/// Quality above which 8-bit pictures are the same, in dB: their rounding alone has 59 dB. Higher targets need not be met
/// as closely, because each try at so small a step takes up to ten times as long as others.
const FINE_DB: f64 = 60.0;
/// Size above which a target need not be met as closely, in bytes for each Gaussian. It is about the size at [`FINE_DB`].
const FINE_BYTES: f64 = 30.0;
/// Value of [`CLOSE_DB`] for targets above [`FINE_DB`].
const CLOSE_FINE_DB: f64 = 1.0;
/// Value of [`CLOSE_SIZE`] for targets above [`FINE_BYTES`].
const CLOSE_FINE_SIZE: f64 = 0.06;
/// Size above which the smallest step is tried first, in bytes for each Gaussian. The smallest step gave 126 bytes on
/// fruit-drops and 142 on train-first1000.
const MOST_BYTES: f64 = 150.0;
/// Quality above which the smallest step is tried first, in dB. The smallest step reached 80 dB on fruit-drops.
const MOST_DB: f64 = 80.0;
/// Largest change of the binary logarithm of the step from one try to the next.
const MAX_MOVE: f64 = 3.0;
/// Smallest and largest step tried. Other steps give no useful file.
const STEPS: [f64; 2] = [1e-9, 1e-2];
/// Bytes reserved in the header for the records of the target and of the values reached, if the target is a size.
const RECORD_BYTES: u64 = 448;
/// Least distance of a try from the two tries around it, as a share of their distance. The interval therefore shrinks.
const LEAST_SHARE: f64 = 0.05;
/// Difference below which two binary logarithms of steps are the same.
const SAME_STEP: f64 = 1e-4;
/// Least difference of the binary logarithms of two steps that give a slope.
const SLOPE_STEP: f64 = 1e-3;
/// Largest factor between a measured slope and the slope before it.
const SLOPE_FACTOR: f64 = 3.0;

/// Name of [`Target::MinPsnr`].
pub(crate) const MIN_PSNR: &str = "min-psnr";

/// The target of a packed file.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Target {
    /// The smallest file whose mean PSNR over the judging views is at least this, in dB. For generated views the mean is
    /// [`Score::judged`], over the quarter of them with the lowest PSNR.
    MeanPsnr(f64),
    /// The smallest file whose PSNR in every judging view is at least this, in dB.
    MinPsnr(f64),
    /// The best file of at most this many bytes.
    Size(u64),
    /// The best file that is at least this many times smaller than the source.
    Ratio(f64),
}

impl Target {
    /// Returns the target of the choices that programs have by name. At most one of them should be given; the first one
    /// counts.
    #[must_use]
    pub fn chosen(
        psnr: Option<f64>,
        min_psnr: Option<f64>,
        size: Option<u64>,
        ratio: Option<f64>,
    ) -> Option<Self> {
        let psnr = psnr.map(Self::MeanPsnr).or(min_psnr.map(Self::MinPsnr));
        psnr.or(size.map(Self::Size)).or(ratio.map(Self::Ratio))
    }

    /// Returns the name of the target in errors and in the file's record. A ratio is recorded as `size`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::MeanPsnr(_) => "psnr",
            Self::MinPsnr(_) => MIN_PSNR,
            Self::Size(_) => "size",
            Self::Ratio(_) => "ratio",
        }
    }

    /// Returns the number that was asked for: decibels, bytes or a ratio.
    pub(crate) fn asked(self) -> f64 {
        match self {
            Self::MeanPsnr(asked) | Self::MinPsnr(asked) | Self::Ratio(asked) => asked,
            Self::Size(bytes) => bytes as f64,
        }
    }

    pub(crate) fn check(self) -> Result<()> {
        let (least, expected) = match self {
            Self::Ratio(_) => (1.0, "a finite number above 1"),
            _ => (0.0, "a finite number above 0"),
        };
        if self.asked().is_finite() && self.asked() > least {
            return Ok(());
        }
        Err(Error::parameter(self.name(), self.asked(), expected))
    }

    /// Returns the target that the file records. A ratio becomes the size that it means.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the source's size")]
    fn recorded(self, source_bytes: u64) -> Self {
        match self {
            Self::Ratio(ratio) => Self::Size((source_bytes as f64 / ratio) as u64),
            other => other,
        }
    }

    /// Returns the bytes that a size or a ratio means.
    pub(crate) fn bytes(self, source_bytes: u64) -> f64 {
        self.recorded(source_bytes).asked()
    }

    /// Returns the error of a target that is out of reach. `best` is the value that came nearest to it.
    fn unreachable(self, best: f64, source_bytes: u64) -> Error {
        let nothing_smaller = "nothing smaller can be made of this scene";
        let smallest = libm::exp2(-best);
        let expected = match self {
            Self::MeanPsnr(_) | Self::MinPsnr(_) => {
                format!("at most {best:.1} dB: nothing better can be made of this scene")
            }
            Self::Size(_) => format!("at least {smallest:.0} bytes: {nothing_smaller}"),
            Self::Ratio(_) => format!("at most {:.1}: {nothing_smaller}", source_bytes as f64 / smallest),
        };
        Error::parameter(self.name(), self.asked(), expected)
    }
}

/// A packing that was tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Try {
    pub(crate) log_step: f64,
    /// For a quality: decibels, which fall as the step grows. For a size: minus the binary logarithm of the bytes, which
    /// rises as the step grows.
    pub(crate) value: f64,
}

/// Packs to the aim of `preset`. The score of a first file, which is not refitted, gives the step. If the refitted file
/// misses the aim by more than [`CLOSE_PRESET`], the scene is packed once more at another step. Returns the file that is
/// nearest to the aim.
///
/// # Errors
/// Errors of packing and drawing.
pub(crate) fn pack_to_preset(
    packer: &Refitting<impl Borrow<Splats>>,
    judge: &mut Judge,
    preset: Preset,
    progress: &dyn Progress,
) -> Result<(Packed, CompressReport, Score)> {
    let aim = preset.decibels();
    let mut log_step = on_grid(libm::log2(packer.step_for(aim)), STEPS_PER_OCTAVE);
    // Files before and after refitting are not on one line. Each step therefore follows from the last file and the usual
    // slope.
    let after = |log_step: f64, value: f64| next_step(&[Try { log_step, value }], aim, &mut -DB_PER_HALVING);
    let (mut quantised, mut file) = packer.quantise(libm::exp2(log_step), true, progress)?;
    let first = judge.score(&file.0.unpack()?, progress)?;
    let expected = first.judged + packer.gain;
    let mut is_first = !packer.refits();
    if (expected - aim).abs() > CLOSE_FIRST
        && let Some(next) = after(log_step, expected)
    {
        is_first = false;
        log_step = on_grid(next, STEPS_PER_OCTAVE);
        drop(file);
        (quantised, file) = packer.quantise(libm::exp2(log_step), true, progress)?;
    }
    let refitted = packer.refit(libm::exp2(log_step), &quantised, file, progress)?;
    let score = if is_first { first } else { judge.score(&refitted.file.0.unpack()?, progress)? };
    let off = (score.judged - aim).abs();
    let next = if off <= CLOSE_PRESET { None } else { after(log_step, score.judged) };
    let Some(next) = next else {
        let (packed, report) = packer.complete(&quantised, refitted, progress)?;
        return Ok((packed, report, score));
    };
    let kept = match packer.refines() {
        true => Some(packer.complete(&quantised, refitted, progress)?),
        false => None,
    };
    drop(quantised);
    let (packed, report) = packer.pack(libm::exp2(on_grid(next, STEPS_PER_OCTAVE)), true, progress)?;
    let last = judge.score(&packed.unpack()?, progress)?;
    if (last.judged - aim).abs() < off {
        return Ok((packed, report, last));
    }
    let (packed, report) = match kept {
        Some(kept) => kept,
        None => packer.pack(libm::exp2(log_step), true, progress)?,
    };
    Ok((packed, report, score))
}

/// Returns the binary logarithm of the nearest step on a grid of `per_octave` steps in an octave.
pub(crate) fn on_grid(log_step: f64, per_octave: f64) -> f64 {
    (log_step * per_octave).round() / per_octave
}

/// A file that meets the target.
struct Found {
    log_step: f64,
    file_bytes: u64,
    packed: Packed,
    report: CompressReport,
    /// `None` if the target is a size.
    reached: Option<Score>,
    /// Whether the first layer alone is fitted ([`Refitting::complete`]).
    complete: bool,
}

/// The target of a search, and where the search begins.
struct Search {
    target: Target,
    is_size: bool,
    /// The target, in the units of [`Try::value`].
    wanted: f64,
    /// Largest amount by which `wanted` may be exceeded.
    close: f64,
    /// Largest difference of `wanted` and the expected value of a file that is refitted for the first time.
    near: f64,
    log_step: f64,
    slope: f64,
}

impl Search {
    fn new(packer: &Refitting<impl Borrow<Splats>>, target: Target) -> Self {
        let asked = target.asked();
        let is_size = matches!(target, Target::Size(_));
        let wanted = if is_size { -libm::log2(asked) } else { asked };
        let gaussians = packer.len().max(1) as f64;
        let close = match is_size {
            true if asked > FINE_BYTES * gaussians => -libm::log2(1.0 - CLOSE_FINE_SIZE),
            true => -libm::log2(1.0 - CLOSE_SIZE),
            false if asked > FINE_DB => CLOSE_FINE_DB,
            false if packer.refines() => REFINED_CLOSE_DB,
            false => CLOSE_DB,
        };
        let slope = if is_size { libm::log2(BYTES_PER_HALVING) } else { -DB_PER_HALVING };
        let limits = STEPS.map(libm::log2);
        let log_step = match is_size {
            true if asked > MOST_BYTES * gaussians => limits[0],
            true => {
                let first = -libm::log2(FIRST_BYTES * gaussians);
                libm::log2(packer.step_for(FIRST_DB)) + (wanted - first) / slope
            }
            false if asked > MOST_DB => limits[0],
            false => libm::log2(packer.step_for(wanted)),
        };
        let near = if is_size { NEAR_LOG_BYTES } else { NEAR_DB };
        let log_step = log_step.clamp(limits[0], limits[1]);
        Self { target, is_size, wanted, close, near, log_step, slope }
    }

    /// Packs until a file meets the target closely. `floor` tells whether visible Gaussians keep a least precision. Returns
    /// the value nearest to the target as the inner error if no file meets the target.
    ///
    /// Refitting takes longer than the rest, and gains about as much at one step as at the next. Files that are not
    /// refitted therefore tell at which step to refit one. The gain of that file tells the next step. Of a refined scene the gain
    /// changes with the step, so from the first refined file on the refined files alone tell it. A file is taken without
    /// refitting where refitting makes it worse.
    fn run(
        &self,
        packer: &Refitting<impl Borrow<Splats>>,
        judge: &mut Judge,
        floor: bool,
        progress: &dyn Progress,
    ) -> Result<std::result::Result<Found, f64>> {
        let (mut log_step, mut slope) = (self.log_step, self.slope);
        let mut gain = if self.is_size { 0.0 } else { packer.gain };
        let mut is_measured = !packer.refits();
        // Unrefined files until a file is refined, and from then on refined files alone.
        let mut tries: Vec<Try> = Vec::new();
        let mut is_refined = false;
        let mut best: Option<Found> = None;
        // Number of files in a row that were too far from the target to be refitted. Values jump, so there may be no step
        // that is near enough.
        let mut passed = 0;
        let (mut nearest, mut margin) = (f64::NEG_INFINITY, 0.5 * self.close);
        let most = if matches!(self.target, Target::MinPsnr(_)) { MAX_TRIES_FOR_LEAST } else { MAX_TRIES };
        for _ in 0..most {
            progress.check()?;
            let (quantised, file) = packer.quantise(libm::exp2(log_step), floor, progress)?;
            let mut plain = None;
            if !is_refined {
                let (value, score) = self.value(&file.0, judge, progress)?;
                tries.push(Try { log_step, value });
                let off = value + gain - self.wanted;
                let (near, most_passed) =
                    if is_measured { (NEAR_AGAIN * self.near, 1) } else { (self.near, 3) };
                let is_near = off.abs() < near || passed >= most_passed;
                if let Some(next) = next_step(&tries, self.wanted - gain + margin, &mut slope)
                    && !is_near
                {
                    log_step = next;
                    passed += 1;
                    continue;
                }
                passed = 0;
                plain = Some((value, score));
            }
            let mut refitted = packer.refit(libm::exp2(log_step), &quantised, file, progress)?;
            if self.is_size {
                // The bytes of the first layer's changes count towards the size; the pictures of the first layer do not
                // count.
                refitted = Refitted::complete(packer.complete(&quantised, refitted, progress)?);
            }
            let (mut value, mut score) = match plain {
                Some(plain) if !packer.refits() => plain,
                _ => self.value(&refitted.file.0, judge, progress)?,
            };
            // A fit lessens the errors of all fitted pictures together. The least quality of a view can fall.
            let is_worse = |plain: &(f64, _)| plain.0 > value && !self.is_size && !packer.refines();
            let own = plain.filter(is_worse);
            if let Some(own) = own {
                refitted = Refitted::with_own(quantised.finish(None, None, progress)?);
                (value, score) = own;
            }
            let packed = &refitted.file.0;
            if let Some((plain, _)) = plain {
                (gain, is_measured) = (value - plain, true);
            }
            if packer.refines() && !self.is_size {
                if !is_refined {
                    tries.clear();
                    (slope, gain, is_refined) = (-REFINED_DB_PER_HALVING, 0.0, true);
                }
                tries.push(Try { log_step, value });
            }
            nearest = nearest.max(value);
            // Values do not change evenly with the step: after a narrow miss the next step may miss narrowly too.
            margin = (margin + (self.wanted - value).max(0.0)).min(MOST_MARGIN * self.close);
            let met = value >= self.wanted;
            let is_close = met && value - self.wanted <= self.close;
            let file_bytes = LexiWriter::packed(packed).file_bytes();
            // Of the files that reach a quality the smallest is the best. Of the files that reach a size the file of the
            // smallest step is the best.
            let is_better = |best: &Found| {
                if self.is_size { log_step < best.log_step } else { file_bytes < best.file_bytes }
            };
            if met && best.as_ref().is_none_or(is_better) {
                let complete = self.is_size || is_close || packer.refines() || own.is_some();
                let (packed, report) = match complete {
                    true => packer.complete(&quantised, refitted, progress)?,
                    false => refitted.file,
                };
                best = Some(Found { log_step, file_bytes, packed, report, reached: score, complete });
            }
            if is_close {
                break;
            }
            let wanted = self.wanted + margin;
            let Some(next) = next_step(&tries, wanted - gain, &mut slope) else { break };
            log_step = next;
        }
        let Some(best) = best else {
            let expected = tries.iter().map(|t| t.value + gain);
            return Ok(Err(if nearest.is_finite() { nearest } else { expected.fold(nearest, f64::max) }));
        };
        if best.complete {
            return Ok(Ok(best));
        }
        let (packed, report) = packer.pack(libm::exp2(best.log_step), floor, progress)?;
        Ok(Ok(Found { packed, report, ..best }))
    }

    /// Returns the value of a file, and its score if the target is a quality.
    fn value(
        &self,
        packed: &Packed,
        judge: &mut Judge,
        progress: &dyn Progress,
    ) -> Result<(f64, Option<Score>)> {
        if self.is_size {
            let bytes = LexiWriter::packed(packed).file_bytes() + RECORD_BYTES;
            return Ok((-libm::log2(bytes as f64), None));
        }
        let score = judge.score(&packed.unpack()?, progress)?;
        let value = if matches!(self.target, Target::MinPsnr(_)) { score.least } else { score.judged };
        Ok((value, Some(score)))
    }
}

/// Packs until a file meets `target` as closely as possible. The file records the target and the values reached. A ratio is
/// relative to `source_bytes`.
///
/// # Errors
/// [`Error::Parameter`] if the target is out of range or cannot be met. Errors of packing and drawing.
pub(crate) fn pack_to_target(
    packer: &Refitting<impl Borrow<Splats>>,
    judge: &mut Judge,
    target: Target,
    source_bytes: u64,
    progress: &dyn Progress,
) -> Result<(Packed, CompressReport, Score)> {
    target.check()?;
    let recorded = target.recorded(source_bytes);
    let search = Search::new(packer, recorded);
    let found = match search.run(packer, judge, true, progress)? {
        // A size must be reached, however bad the file is. The search is repeated without the floor.
        Err(_) if search.is_size => search.run(packer, judge, false, progress)?,
        found => found,
    };
    let Found { packed, report, reached: score, .. } =
        found.map_err(|best| target.unreachable(best, source_bytes))?;
    let score = match score {
        Some(score) => score,
        None => judge.score(&packed.unpack()?, progress)?,
    };
    let ReachedRecord { mean_psnr, min_psnr, views, cameras, .. } = reached(score, judge);
    let record = TargetRecord::new(recorded.name(), recorded.asked(), [mean_psnr, min_psnr], views, cameras);
    Ok((packed.with_target(record), report, score))
}

/// Returns the binary logarithm of the next step to try, within [`STEPS`]. It lies on the line through the two tries around
/// the wanted value, or else beyond the last try. Returns `None` if that step was tried before.
fn next_step(tries: &[Try], wanted: f64, slope: &mut f64) -> Option<f64> {
    // Values need not change evenly with the step: one step may change a view by decibels. Some tries meet the wanted
    // value, and some miss it. The neighbours at the border between the two count.
    let towards_below = -slope.signum();
    let above = tries
        .iter()
        .filter(|t| t.value >= wanted)
        .max_by(|a, b| (towards_below * a.log_step).total_cmp(&(towards_below * b.log_step)));
    let is_beyond = |t: &&Try| above.is_none_or(|a| towards_below * (t.log_step - a.log_step) > 0.0);
    // If no try meets the wanted value, the search goes on beyond the last step, though an earlier step may have come
    // nearer.
    let distance = |t: &Try| above.map_or(towards_below * t.log_step, |a| (t.log_step - a.log_step).abs());
    // If all tries that miss the wanted value are on the wrong side, the search goes on beyond the try that meets it.
    let below = tries
        .iter()
        .filter(|t| t.value < wanted)
        .filter(is_beyond)
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let next = match (above, below) {
        (Some(a), Some(b)) => {
            let t = (wanted - b.value) / (a.value - b.value);
            b.log_step + (a.log_step - b.log_step) * t.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE)
        }
        (one, other) => {
            if let [.., p, q] = tries
                && (p.log_step - q.log_step).abs() > SLOPE_STEP
            {
                let measured = (q.value - p.value) / (q.log_step - p.log_step);
                *slope = slope.signum()
                    * (measured / *slope).clamp(1.0 / SLOPE_FACTOR, SLOPE_FACTOR)
                    * slope.abs();
            }
            let from = one.or(other)?;
            let limits = STEPS.map(libm::log2);
            let wanted_move = (wanted - from.value) / *slope;
            let moved = from.log_step + wanted_move.clamp(-MAX_MOVE, MAX_MOVE);
            match tries.len() {
                // Small steps take long, and steps on the way to the smallest would not be the last.
                2.. if from.log_step + wanted_move <= limits[0] => limits[0],
                _ => moved.clamp(limits[0], limits[1]),
            }
        }
    };
    tries.iter().all(|t| (t.log_step - next).abs() > SAME_STEP).then_some(next)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance from `wanted` to the nearest value that the search finds on `curve`.
    fn nearest(curve: impl Fn(f64) -> f64, wanted: f64, mut slope: f64) -> f64 {
        let mut tries = vec![Try { log_step: -17.0, value: curve(-17.0) }];
        while tries.len() < MAX_TRIES {
            let Some(next) = next_step(&tries, wanted, &mut slope) else { break };
            tries.push(Try { log_step: next, value: curve(next) });
        }
        tries.iter().map(|t| (t.value - wanted).abs()).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_search_closes_in_on_decibels() {
        // Decibels over the logarithm of the step, steeper on one side.
        let curve = |x: f64| 40.0 - 4.0 * (x + 17.0) - 0.2 * (x + 17.0).powi(2) * (x + 17.0).signum();
        for wanted in [25.0, 40.0, 47.3, 60.0] {
            assert!(nearest(curve, wanted, -DB_PER_HALVING) < 0.02, "{wanted}");
        }
    }

    #[test]
    fn the_search_goes_on_beyond_a_fall() {
        // Where a Gaussian crosses the near plane of a view, a smaller step can show less.
        let curve =
            |x: f64| 39.985 - 4.0 * (x + 16.571) - if (-16.7..-16.575).contains(&x) { 0.3 } else { 0.0 };
        let (mut tries, mut slope) = (vec![Try { log_step: -16.378, value: 39.16 }], -DB_PER_HALVING);
        while tries.len() < MAX_TRIES && tries.iter().all(|t| t.value < 40.0) {
            let next = next_step(&tries, 40.02, &mut slope).unwrap();
            tries.push(Try { log_step: next, value: curve(next) });
        }
        assert!(tries.last().unwrap().value >= 40.0, "{tries:?}");
    }

    #[test]
    fn a_step_at_the_limit_is_tried_once() {
        // Bytes that stay below the wanted number, and decibels that stay below the wanted PSNR.
        for (curve, wanted, mut slope) in [
            ((|x: f64| -(1e5 - 1e3 * x).log2()) as fn(f64) -> f64, -20.0, BYTES_PER_HALVING.log2()),
            (|x| 30.0 - x, 90.0, -DB_PER_HALVING),
        ] {
            let mut tries = vec![Try { log_step: -17.0, value: curve(-17.0) }];
            while let Some(next) = next_step(&tries, wanted, &mut slope) {
                tries.push(Try { log_step: next, value: curve(next) });
                assert!(tries.len() <= 3, "{tries:?}");
            }
            assert_eq!(tries.last().unwrap().log_step, STEPS[0].log2());
        }
    }

    #[test]
    fn the_search_closes_in_on_sizes() {
        // Minus the logarithm of the bytes: a constant part of dictionary and tables, and a part that shrinks.
        let curve = |x: f64| -(5000.0 + 90_000.0 * (-0.45 * (x + 17.0)).exp2()).log2();
        for bytes in [1e4_f64, 2e4, 1e5, 1e6] {
            let wanted = -bytes.log2();
            assert!(nearest(curve, wanted, BYTES_PER_HALVING.log2()) < 0.01, "{bytes}");
        }
    }
}
