//! Everything with which the chunks of a scene are coded, settled for one overall step. A scene as a whole and a scene in parts
//! take the same steps.

use serde::{Deserialize, Serialize};

use super::codebook::{Choice, Costs, StopRule};
use super::coder::{ChunkCoder, Learning, VALUES, promise, too_large};
use super::encoding::Encoding;
use super::fit::Steps;
use super::floor::Floor;
use super::layering::Layering;
use super::options::PackOptions;
use super::quantised::{Gaussians, Quantised};
use super::sample_sums::SampleSums;
use crate::packed::bitstream::{PointsOfView, WholeAtoms};
use crate::packed::curve::MortonKey;
use crate::scene::sensitivity::AppearanceSensitivity;
use crate::scene::sh::ShDegree;
use crate::scene::splats::Splats;
use crate::support::error::Result;
use crate::support::progress::Progress;
use crate::support::stopwatch::Stopwatch;

/// The choices that are made before a sample is taken.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Begun {
    /// The limits of steps, without those that depend on the shapes of Gaussians.
    pub(in crate::packed) floor: Floor,
    pub(in crate::packed) layering: Layering,
    stop: StopRule,
}

impl Begun {
    /// Begins with the overall step `step`. With `limited`, the steps of visible Gaussians are limited. A file has about
    /// `gaussians` Gaussians; `energies` is as for [`Layering::new`].
    pub(in crate::packed) fn new(
        steps: &Steps,
        (step, limited): (f64, bool),
        options: &PackOptions,
        gaussians: usize,
        energies: impl Iterator<Item = (f32, u64)>,
    ) -> Self {
        let mut parameters = steps.with_step(step);
        let stop = promise(&mut parameters, options.tolerance);
        let floor = if limited { Floor::begin(parameters) } else { Floor::none(parameters) };
        Self { floor, layering: Layering::new(gaussians, options, energies), stop }
    }
}

/// Everything with which chunks are coded.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Settled {
    begun: Begun,
    most_dc: f64,
    atoms: WholeAtoms,
    /// The costs of symbols.
    costs: Costs,
}

impl Settled {
    /// Learns the dictionary, and settles everything else. The sample is of a scene of which `kept` Gaussians stay. Reports the
    /// learning to `progress`.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if values are so large that sums of them leave f32; [`crate::Error::Cancelled`].
    pub(in crate::packed) fn new(
        mut begun: Begun,
        sample: &SampleSums,
        (degree, kept): (ShDegree, usize),
        options: &PackOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        begun.floor = begun.floor.within(sample.over);
        let parameters = &mut begun.floor.parameters;
        sample.predictors.solve(parameters);
        if !parameters.are_usable() {
            return Err(too_large());
        }
        let (rows, classes) = sample.shuffled(degree.rest(), options.seed);
        let learning = Learning { degree, total: kept, stop: begun.stop, options };
        let Choice { atoms, costs, step } = learning.dictionary(&rows, &classes, progress)?;
        parameters.factors[VALUES] *= step;
        Ok(Self { begun, most_dc: sample.most_dc(), atoms, costs })
    }

    /// Returns an encoder that has coded nothing. `clock` runs since the start of learning.
    ///
    /// # Errors
    /// Errors of the dictionary.
    pub(in crate::packed) fn encoding(&self, options: &PackOptions, clock: Stopwatch) -> Result<Encoding> {
        let Begun { floor, layering, stop } = &self.begun;
        let coder = ChunkCoder::learned(
            floor.parameters.clone(),
            PointsOfView::new(&options.points_of_view),
            &self.atoms,
            self.costs.clone(),
            *stop,
            options.tolerance,
        )?;
        Ok(Encoding::new((coder, self.atoms.clone()), layering.clone(), self.most_dc, clock))
    }

    /// Quantises the Gaussians of `keys`, which stay. `sensitivities` has the order of `keys`. Advances `progress` by their number.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if a file cannot hold a value; [`crate::Error::Cancelled`].
    pub(in crate::packed) fn quantise<'a>(
        &self,
        splats: &'a Splats,
        (keys, sensitivities): (Vec<MortonKey>, Vec<AppearanceSensitivity>),
        steps: &Steps,
        options: &'a PackOptions,
        clock: Stopwatch,
        progress: &dyn Progress,
    ) -> Result<Quantised<'a>> {
        let free = steps.classes_of(&sensitivities);
        let classes = self.begun.floor.classes(&free, &splats.geometry, &keys);
        let gaussians = Gaussians { keys, classes, sensitivities };
        Quantised::new(splats, options, gaussians, self.encoding(options, clock)?, progress)
    }
}
