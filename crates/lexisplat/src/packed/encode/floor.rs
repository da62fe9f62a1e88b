//! The floor: the coarsest steps that a visible Gaussian may have at any sensitivity.
//!
//! Other views may show Gaussians that the measured views hardly show. The limits are shares of a Gaussian's own size,
//! turn, opacity and colour, so that another view may look worse but not broken (docs/METHOD.md, "The floor").

use serde::{Deserialize, Serialize};

use super::canonical::canonical;
use super::fit::rounded;
use crate::packed::bitstream::parameters::{
    ColourAndShape, LAST_CLASS, Parameters, least_axis, rotation_steps,
};
use crate::packed::curve::MortonKey;
use crate::scene::sh::C0;
use crate::scene::splats::Geometry;
use crate::support::maths::{exp, exp2, log2};
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_chunks};

/// Natural logarithm of the opacity 0.2. Gaussians of smaller opacity have no limits.
const VISIBLE: f32 = -1.609_438;
/// Largest step of the logarithms of the opacity and of the two larger standard deviations.
const LOG_STEP: f32 = 0.8;
/// Largest step of a turn, in radians. It holds in a plane in which one standard deviation is at least `e` times the other.
/// In a plane with a smaller ratio the limit is `ANGLE_STEP / ln(ratio)`.
const ANGLE_STEP: f32 = 0.7;
/// Largest step of the position along each axis, in standard deviations along it. For the shortest axis, the standard
/// deviation along the middle one counts.
const POSITION_STEP: f32 = 1.5;
/// Largest step of a coordinate of the base colour. Colours of pictures range from 0 to 1.
const COLOUR_STEP: f32 = 0.28;
/// Most octaves by which turns and positions make the steps of class 0 smaller, so that a few unusual Gaussians do not make
/// the whole file larger. The models in docs/results/promise.md need at most 3.
const MOST_OCTAVES: f32 = 4.0;
/// Added to a number of octaves before it is rounded down, so that a step that exceeds its limit by a rounding error only
/// is within it.
const EXACT: f32 = 1e-3;

/// The limits of steps, and parameters with whose classes all Gaussians can keep them.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Floor {
    pub(in crate::packed) parameters: Parameters,
    /// Octaves by which the steps of class 0 were made smaller, for colour and for shape. They are added to classes.
    added: ColourAndShape<f32>,
    limited: bool,
}

impl Floor {
    /// Returns parameters without limits.
    pub(in crate::packed) fn none(parameters: Parameters) -> Self {
        Self { parameters, added: ColourAndShape::default(), limited: false }
    }

    /// Sets the limits of colours and of logarithms, which do not depend on the shapes of Gaussians. Also shifts the steps so that
    /// the steps of some class are exactly these limits.
    pub(in crate::packed) fn begin(mut parameters: Parameters) -> Self {
        // If a limit were between two classes, all Gaussians at it would change their steps at once as the overall step
        // grows.
        let over = ColourAndShape { colour: colour_over(&parameters), shape: logs_over(&parameters) };
        let added = over.map(log2).map(|over| over - over.round().min(0.0));
        rescale(&mut parameters, added);
        Self { parameters, added, limited: true }
    }

    /// Returns by how many octaves the steps of shape class 0 are too large for the Gaussians of `keys`; 0 if they are
    /// not. For several parts of a scene, the largest of their numbers counts.
    pub(in crate::packed) fn over(&self, geometry: &Geometry, keys: &[MortonKey]) -> f32 {
        if !self.limited {
            return 0.0;
        }
        let tasks = map_chunks(keys.len(), GAUSSIANS_PER_TASK, |range| {
            let coarsest = keys[range].iter().map(|&g| coarsest(&self.parameters, geometry, g).shape);
            coarsest.fold(0.0, f32::min)
        });
        -tasks.into_iter().fold(0.0, f32::min)
    }

    /// Makes the steps of shape class 0 smaller by `over` octaves, at most by [`MOST_OCTAVES`]. `over` is the largest
    /// result of [`Self::over`] over the parts of a scene.
    pub(in crate::packed) fn within(mut self, over: f32) -> Self {
        let shape = over.min(MOST_OCTAVES);
        rescale(&mut self.parameters, ColourAndShape { colour: 0.0, shape });
        self.added.shape += shape;
        self
    }

    /// Returns the class of each Gaussian: with about the steps of `classes`, or with smaller steps where a limit asks for
    /// them.
    pub(in crate::packed) fn classes(
        &self,
        classes: &[ColourAndShape<f32>],
        geometry: &Geometry,
        keys: &[MortonKey],
    ) -> Vec<ColourAndShape<u8>> {
        if !self.limited {
            return classes.iter().map(|class| class.map(rounded)).collect();
        }
        let tasks = map_chunks(keys.len(), GAUSSIANS_PER_TASK, |range| {
            let within = |(class, &placed): (&ColourAndShape<f32>, &MortonKey)| {
                let coarsest = coarsest(&self.parameters, geometry, placed);
                ColourAndShape {
                    colour: rounded((class.colour + self.added.colour).min(coarsest.colour)),
                    shape: rounded((class.shape + self.added.shape).min(coarsest.shape)),
                }
            };
            classes[range.clone()].iter().zip(&keys[range]).map(within).collect::<Vec<_>>()
        });
        tasks.concat()
    }
}

/// Divides the steps of class 0 by `2^octaves`, for colour and for shape.
fn rescale(parameters: &mut Parameters, octaves: ColourAndShape<f32>) {
    parameters.base.colour *= exp2(-octaves.colour);
    parameters.base.shape *= exp2(-octaves.shape);
}

/// Returns the coarsest classes that a Gaussian may have. A class is below 0 if class 0 is too coarse.
fn coarsest(parameters: &Parameters, geometry: &Geometry, placed: MortonKey) -> ColourAndShape<f32> {
    let g = canonical(geometry, placed.index());
    if g.log_opacity < VISIBLE {
        let last = f32::from(LAST_CLASS);
        return ColourAndShape { colour: last, shape: last };
    }
    let steps = rotation_steps(parameters.rotation_steps(g.scales), g.scales);
    let [a, b] = if least_axis(g.scales) == 0 { [1, 2] } else { [0, 1] };
    let longness = [g.scales[0] - g.scales[2], g.scales[a] - g.scales[b]];
    let turns = (0..2).map(|k| steps[k] * longness[k].min(1.0)).fold(0.0, f32::max) / ANGLE_STEP;
    let steps = parameters.position_steps(g.scales);
    let positions = (0..3).map(|k| steps[k] / exp(g.scales[k.min(1)])).fold(0.0, f32::max) / POSITION_STEP;
    let shape = logs_over(parameters).max(turns).max(positions);
    ColourAndShape { colour: colour_over(parameters), shape }.map(|over| (EXACT - log2(over)).floor())
}

/// Returns the step of the base colour at colour class 0 over its limit.
fn colour_over(parameters: &Parameters) -> f32 {
    parameters.dc_step(0) * C0 / COLOUR_STEP
}

/// Returns the largest of the steps of the opacity and the two larger scales at shape class 0, over the limit.
fn logs_over(parameters: &Parameters) -> f32 {
    let [_, _, opacity, first, second, _] = parameters.factors;
    parameters.base.shape * opacity.max(first).max(second) / LOG_STEP
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::{PackOptions, Packer};
    use crate::scene::sensitivity::Sensitivity;
    use crate::support::maths::{dot, log_sigmoid};
    use crate::{Silent, Splats};

    /// Packs and unpacks `splats` with the overall step `step`.
    fn packed(splats: &Splats, sensitivity: &Sensitivity, step: f64, limited: bool) -> Splats {
        let options = PackOptions::default().with_keep_order(true);
        let packer = Packer::new(splats, sensitivity, &options).unwrap();
        let (packed, _) =
            packer.quantise(step, limited, &Silent).unwrap().finish(None, None, &Silent).unwrap();
        packed.unpack().unwrap().into_splats()
    }

    /// Returns the sensitivity of views that saw every fifth Gaussian. Moving and turning a Gaussian hardly shows in them.
    fn misleading(splats: &Splats) -> Sensitivity {
        let mut s = Sensitivity::guess(&splats.geometry);
        for i in 0..splats.len() {
            let seen = if i % 5 == 0 { 1.0 } else { 1e-12 };
            s.colour[i] *= seen;
            s.opacity[i] *= seen;
            s.scale[i].iter_mut().for_each(|v| *v *= seen);
            s.position[i].iter_mut().chain(&mut s.rotation[i]).for_each(|v| *v *= 0.01 * seen);
        }
        s
    }

    /// Returns the largest error of a visible Gaussian of `found`: of the logarithms of the opacity and the larger scales,
    /// of the colour, of the position in standard deviations, and of the turn of a long longest axis.
    fn most_off(splats: &Splats, found: &Splats) -> [f32; 4] {
        let (a, b) = (&splats.geometry, &found.geometry);
        let mut most = [0.0_f32; 4];
        let visible = (0..splats.len()).filter(|&i| log_sigmoid(a.opacities[i]) >= VISIBLE);
        for i in visible {
            let (mine, theirs) = (canonical(a, i), canonical(b, i));
            let difference = |a: f32, b: f32| (a - b).abs();
            let logs = (0..2).map(|k| difference(mine.scales[k], theirs.scales[k]));
            let colour: f32 = (0..3).map(|c| ((a.dc[i][c] - b.dc[i][c]) * C0).powi(2)).sum();
            let moved: [f32; 3] = std::array::from_fn(|k| b.positions[i][k] - a.positions[i][k]);
            let along = |k: usize| dot(mine.axes[k], moved).abs() / exp(mine.scales[k.min(1)]);
            let is_long = mine.scales[0] - mine.scales[1] >= 1.0;
            let turn = if is_long { dot(mine.axes[0], theirs.axes[0]).abs().min(1.0).acos() } else { 0.0 };
            let off = [
                logs.fold(difference(mine.log_opacity, theirs.log_opacity), f32::max),
                colour.sqrt(),
                (0..3).map(along).fold(0.0, f32::max),
                turn,
            ];
            most = std::array::from_fn(|k| most[k].max(off[k]));
        }
        most
    }

    #[test]
    fn what_no_view_saw_keeps_a_share_of_its_own_values() {
        let splats = crate::support::testing::scene(3000, 11);
        let misleading = misleading(&splats);
        for step in [1e-4, 1e-3, 1e-2] {
            let most = most_off(&splats, &packed(&splats, &misleading, step, true));
            // docs/METHOD.md states these limits.
            let limits = [0.47, 0.29, 1.0, 0.7];
            assert!(std::iter::zip(most, limits).all(|(most, limit)| most <= limit), "{step}: {most:?}");
            // Under the limits the errors are not much smaller than they may be.
            assert!(most[0] > 0.2 && most[2] > 0.5, "{step}: {most:?}");
            let without = most_off(&splats, &packed(&splats, &misleading, step, false));
            assert!([0, 1, 3].iter().all(|&k| without[k] > limits[k]), "{step}: {without:?}");
        }
    }
}
