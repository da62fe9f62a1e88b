//! Packing of a scene: the steps from a scene to a packed file.

use std::borrow::Borrow;

use super::fit::Fit;
use super::floor::Floor;
use super::options::PackOptions;
use super::quantised::{Fitted, Gaussians, Quantised};
use super::removal::Influence;
use crate::packed::bitstream::PointsOfView;
use crate::packed::bitstream::parameters::Parameters;
use crate::packed::curve::{Grid, MortonKey};
use crate::packed::scene::Packed;
use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::{Splats, all_finite};
use crate::sparse::tally::CompressReport;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_GAUSSIANS};
use crate::support::maths::at_share;
use crate::support::progress::Progress;

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
    fit: Fit,
    points_of_view: PointsOfView,
    /// The base colours that the file holds, by index in `splats`.
    dc: Vec<[f32; 3]>,
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
        let grid = Grid::fit(&g.positions);
        let mut keys = grid.keys(g);
        keys.sort_unstable();
        let points_of_view = PointsOfView::new(&options.points_of_view);
        let dc = points_of_view.colours(splats.borrow());
        let fit = Fit::new(g, &dc, sensitivity, &keys, &grid);
        let influence = Influence::new(g, sensitivity, &keys, options.may_change());
        Ok(Self { splats, options: options.clone(), keys, fit, points_of_view, dc, influence })
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
        let parameters = self.fit.steps.with_step(step);
        let kept = self.influence.kept(step);
        let keys: Vec<MortonKey> = kept.iter().map(|&i| self.keys[i]).collect();
        let classes: Vec<_> = kept.iter().map(|&i| self.fit.classes[i]).collect();
        let sensitivities = kept.iter().map(|&i| self.influence.sensitivities[i]).collect();
        let geometry = &self.splats.borrow().geometry;
        let floor = match floor {
            true => Floor::new(parameters, geometry, &keys),
            false => Floor::none(parameters),
        };
        let classes = floor.classes(&classes, geometry, &keys);
        let gaussians = Gaussians { keys, classes, sensitivities };
        let fitted = Fitted {
            most_dc: most_dc(&floor.parameters, &self.dc),
            points_of_view: self.points_of_view.clone(),
        };
        Quantised::new(self.splats.borrow(), &self.options, gaussians, floor.parameters, fitted, progress)
    }
}

/// Share of the Gaussians whose base colours set the unit of base colours. The rest are too few to make all others coarse.
pub(in crate::packed) const USUAL_DC: f64 = 0.999;

/// Returns the quantile [`USUAL_DC`] of the largest coordinates of the base colours.
pub(in crate::packed) fn most_dc(parameters: &Parameters, dc: &[[f32; 3]]) -> f64 {
    let largest =
        |&dc: &[f32; 3]| parameters.dc_coordinates(dc).into_iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    let mut all: Vec<f32> = dc.iter().map(largest).collect();
    all.sort_by(f32::total_cmp);
    f64::from(at_share(&all, USUAL_DC))
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
