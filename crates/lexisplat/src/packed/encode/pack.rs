//! Packing of a scene: the steps from a scene to a packed file.

use std::borrow::Borrow;

use super::coder::SAMPLE;
use super::fit::{StepSums, Steps};
use super::options::PackOptions;
use super::quantised::Quantised;
use super::removal::Influence;
use super::sample_sums::SampleSums;
use super::settled::{Begun, Settled};
use super::tiles::{Plan, surveyed};
use crate::packed::bitstream::PointsOfView;
use crate::packed::curve::{Bounds, Grid, MortonKey};
use crate::packed::scene::Packed;
use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::{Splats, all_finite};
use crate::sparse::tally::CompressReport;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_GAUSSIANS};
use crate::support::maths::Vec3;
use crate::support::progress::{Progress, Stage};
use crate::support::stopwatch::Stopwatch;

/// Expected PSNR in dB at an overall step of `EXPECTED_STEP / sqrt(gaussians)`. This constant and the next three are fitted
/// to held-out views of the models in docs/results, which they miss by up to 3 dB.
const EXPECTED_DB: f64 = 40.0;
const EXPECTED_STEP: f64 = 2.3e-3;
/// Growth of the PSNR in dB when the step halves, and the growth of that growth.
const DB_PER_OCTAVE: f64 = 4.5;
const DB_PER_OCTAVE_2: f64 = 0.15;
/// Largest PSNR that is expected, in dB.
const MOST_DB: f64 = 100.0;

/// A scene prepared for packing at any quality. `S` owns or borrows the scene.
#[derive(Debug)]
pub struct Packer<S> {
    splats: S,
    options: PackOptions,
    keys: Vec<MortonKey>,
    steps: Steps,
    /// The sums that do not depend on the overall step.
    sample: SampleSums,
    influence: Influence,
}

impl<S: Borrow<Splats>> Packer<S> {
    /// Prepares `splats`. `sensitivity` says how much pictures depend on each value of each Gaussian.
    ///
    /// # Errors
    /// [`Error::Parameter`] for options out of range, arrays of different lengths, or values or sensitivities that are
    /// not finite.
    pub fn new(splats: S, sensitivity: &Sensitivity, options: &PackOptions) -> Result<Self> {
        check(splats.borrow(), sensitivity)?;
        options.check()?;
        let g = &splats.borrow().geometry;
        let surveyed = Plan::blocks(g.len()).flat_map(|rows| surveyed(g.len(), rows, options.seed));
        let sample: Vec<Vec3> = surveyed.map(|row| g.positions[row]).collect();
        let grid = Grid::fit_sample(&sample, Bounds::of(&g.positions), g.len());
        let mut keys = grid.keys(g);
        keys.sort_unstable();
        let influence = Influence::new(g, sensitivity, &keys, options.may_change());
        let dc = PointsOfView::new(&options.points_of_view).colours(splats.borrow());
        let own = &influence.sensitivities;
        let mut sums = StepSums::default();
        sums.add(g, &dc, sensitivity, &keys, own.iter().copied());
        let steps = Steps::new(&grid, &sums);
        let mut sample = SampleSums::default();
        sample.add_values(g, &dc, &keys, own, &steps);
        Ok(Self { splats, options: options.clone(), keys, steps, sample, influence })
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Returns the overall step at which pictures are expected to have a PSNR of `decibels`, in dB. Errors of all Gaussians
    /// add up, so the step falls with the root of their number.
    #[must_use]
    pub fn step_for(&self, decibels: f64) -> f64 {
        expected_step(self.len(), decibels)
    }

    /// Packs the scene with the overall step `step`. It is about the root of the mean squared error of pictures that each
    /// value of each Gaussian may cause on its own. Half the step gives about 5 dB more. However large the step is, visible
    /// Gaussians keep a share of their own size, turn, opacity and colour (docs/METHOD.md, "The floor").
    ///
    /// # Errors
    /// As [`Self::quantise`] and [`Quantised::finish`].
    pub fn pack(&self, step: f64, progress: &dyn Progress) -> Result<(Packed, CompressReport)> {
        self.quantise(step, true, progress)?.finish(None, None, progress)
    }

    /// Settles everything that does not depend on base colours and opacities, with an overall step as in [`Self::pack`].
    /// With `floor`, the steps of visible Gaussians are limited. Without it, steps have no limit, and the file can become
    /// smaller.
    ///
    /// A Gaussian is left out if pictures change less without it than its bits are worth. It stays if the options keep all
    /// Gaussians, if its largest change of a picture is not known, or if no picture showed it and its opacity is at least
    /// 1/255.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `step` is not finite and above 0, or values are so large that sums of them
    /// leave f32; [`Error::Cancelled`].
    pub fn quantise(&self, step: f64, floor: bool, progress: &dyn Progress) -> Result<Quantised<'_>> {
        if !step.is_finite() || step <= 0.0 {
            return Err(Error::parameter("step", step, "a finite number above 0"));
        }
        let clock = Stopwatch::start();
        let Self { options, steps, influence, .. } = self;
        let splats = self.splats.borrow();
        let kept = influence.kept(step);
        let keys: Vec<MortonKey> = kept.iter().map(|&i| self.keys[i]).collect();
        let sensitivities: Vec<_> = kept.iter().map(|&i| influence.sensitivities[i]).collect();
        drop(kept);
        let energies = sensitivities.iter().map(|s| (s.opacity, 1));
        let begun = Begun::new(steps, (step, floor), options, keys.len(), energies);
        let mut sample = self.sample.clone();
        sample.add_kept(splats, &keys, &sensitivities, (steps, &begun), (SAMPLE, options.seed));
        let settled = Settled::new(begun, &sample, (splats.degree, keys.len()), options, progress)?;
        drop(sample);
        progress.check()?;
        progress.begin(Stage::Code, keys.len() as u64);
        let gaussians = (keys, sensitivities);
        let quantised = settled.quantise(splats, gaussians, steps, options, clock, progress)?;
        progress.end();
        Ok(quantised)
    }
}

/// Returns [`Packer::step_for`] of a scene of `gaussians` Gaussians.
pub(crate) fn expected_step(gaussians: usize, decibels: f64) -> f64 {
    // `decibels = EXPECTED_DB + DB_PER_OCTAVE * x + DB_PER_OCTAVE_2 * x^2`, where `x` is the number of octaves below the
    // expected step.
    let over = decibels.clamp(0.0, MOST_DB) - EXPECTED_DB;
    let root = (DB_PER_OCTAVE * DB_PER_OCTAVE + 4.0 * DB_PER_OCTAVE_2 * over).max(0.0).sqrt();
    let octaves = (root - DB_PER_OCTAVE) / (2.0 * DB_PER_OCTAVE_2);
    EXPECTED_STEP * libm::exp2(-octaves) / (gaussians.max(1) as f64).sqrt()
}

/// Refuses a scene and a sensitivity that have different lengths, or values that are not finite.
pub(crate) fn check(splats: &Splats, sensitivity: &Sensitivity) -> Result<()> {
    splats.validate()?;
    Limits::check("Gaussians", splats.len() as u64, MAX_GAUSSIANS)?;
    let all = [
        (sensitivity.colour.len(), sensitivity.colour.as_slice()),
        (sensitivity.opacity.len(), &sensitivity.opacity),
        (sensitivity.position.len(), sensitivity.position.as_flattened()),
        (sensitivity.scale.len(), sensitivity.scale.as_flattened()),
        (sensitivity.rotation.len(), sensitivity.rotation.as_flattened()),
    ];
    for (len, values) in all {
        if len != splats.len() {
            let expected = format!("{} entries, one a Gaussian", splats.len());
            return Err(Error::parameter("sensitivity", len, expected));
        }
        all_finite([("sensitivity", values)])?;
    }
    let g = &splats.geometry;
    all_finite([
        ("positions", g.positions.as_flattened()),
        ("dc", g.dc.as_flattened()),
        ("opacities", &g.opacities),
        ("scales", g.scales.as_flattened()),
        ("rotations", g.rotations.as_flattened()),
        ("sh_rest", splats.sh_rest.as_slice()),
    ])
}
