//! The parameters of a file as they are fitted, in f32: steps, predictors and the grid.

use serde::{Deserialize, Serialize};

use crate::support::maths::{Vec3, exp2};

/// Number of values of a Gaussian that are predicted from its neighbours and from its own earlier values: three scales, the
/// opacity, and three coordinates of the base colour.
pub(in crate::packed) const TARGETS: usize = 7;
/// Indices of the opacity and of the first coordinate of the base colour among the targets.
pub(in crate::packed) const OPACITY: usize = 3;
pub(in crate::packed) const DC: usize = 4;
/// Number of values with an interim change: one for all three scales, the opacity, and the coordinates of the base colour.
pub(in crate::packed) const CHANGES: usize = 5;
/// Number of kinds of interim changes, each with a step of its own: of scales, of opacities and of base colours.
pub(in crate::packed) const KINDS: usize = 3;
/// Number of features of a prediction: 1, the average of the same value over neighbours, the two classes, and three scales,
/// as far as they are known.
pub(in crate::packed) const FEATURES: usize = 7;
/// Number of features of the logarithm of a step: 1 and the three scales.
const STEP_FEATURES: usize = 4;
/// Number of the coarsest class of steps.
pub(in crate::packed) const LAST_CLASS: u8 = 15;

/// The step with which a dictionary is learned is rounded to a quarter of an octave, which changes it by at most 9 %.
const PER_OCTAVE: f64 = 4.0;

/// A value for colour and a value for shape: a class, or the steps of class 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::packed) struct ColourAndShape<T> {
    pub(in crate::packed) colour: T,
    pub(in crate::packed) shape: T,
}

impl<T> ColourAndShape<T> {
    pub(in crate::packed) fn map<U>(self, f: impl Fn(T) -> U) -> ColourAndShape<U> {
        ColourAndShape { colour: f(self.colour), shape: f(self.shape) }
    }
}

/// Steps and predictors of a file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::packed) struct Parameters {
    /// Corner of the grid, in world units.
    pub(in crate::packed) origin: Vec3,
    /// Side of a cell of the grid, in world units.
    pub(in crate::packed) cell: f32,
    /// Steps of class 0. The step doubles from class to class.
    pub(in crate::packed) base: ColourAndShape<f32>,
    /// Factors on the steps of base colour, SH values, opacity and the three scales.
    pub(in crate::packed) factors: [f32; 6],
    /// Step of all SH values if a tolerance is promised; otherwise 0.
    pub(in crate::packed) promised: f32,
    /// Binary logarithm of the factor on the step of a turn about each axis, as a linear function of 1 and the scales.
    pub(in crate::packed) rotation: [[f32; STEP_FEATURES]; 3],
    /// Binary logarithm of the factor on the step of a move along each axis, in the same form.
    pub(in crate::packed) position: [[f32; STEP_FEATURES]; 3],
    /// Mean base colour, and the orthonormal axes along which differences from it are coded.
    pub(in crate::packed) dc_mean: Vec3,
    pub(in crate::packed) dc_axes: [Vec3; 3],
    /// Averages for Gaussians without neighbours.
    pub(in crate::packed) means: [f32; TARGETS],
    /// Coefficients of the predictions.
    pub(in crate::packed) predictors: [[f32; FEATURES]; TARGETS],
}

impl Parameters {
    /// Returns whether all values are finite, and steps and their factors above 0.
    pub(in crate::packed) fn are_usable(&self) -> bool {
        let steps = [&[self.cell, self.base.colour, self.base.shape][..], &self.factors];
        let others = [
            &self.origin[..],
            &[self.promised],
            self.rotation.as_flattened(),
            self.position.as_flattened(),
            &self.dc_mean,
            self.dc_axes.as_flattened(),
            &self.means,
            self.predictors.as_flattened(),
        ];
        let is_finite = |values: &&[f32]| values.iter().all(|v| v.is_finite());
        steps.iter().chain(&others).all(is_finite)
            && steps.concat().iter().all(|&v| v > 0.0)
            && self.promised >= 0.0
    }

    fn colour_step(&self, class: u8) -> f32 {
        // The factor is 2 to the power of the class, which is at most 15.
        self.base.colour * f32::from_bits((127 + u32::from(class)) << 23)
    }

    /// Returns the step of the three coordinates of the base colour at a colour class.
    pub(in crate::packed) fn dc_step(&self, colour: u8) -> f32 {
        self.colour_step(colour) * self.factors[0]
    }

    /// Returns the step of SH values at a colour class.
    pub(in crate::packed) fn value_step(&self, colour: u8) -> f32 {
        if self.promised > 0.0 { self.promised } else { self.colour_step(colour) * self.factors[1] }
    }

    /// Returns the step of SH values at colour class 0 if no error is promised.
    pub(in crate::packed) fn free_value_step(&self) -> f32 {
        self.colour_step(0) * self.factors[1]
    }

    /// Returns the parameters with which a dictionary is learned. The step of SH values is rounded; see
    /// [`PER_OCTAVE`]. A promised step stays as it is. Learning depends on the last bits of its rows, and these differ
    /// if a scene is in other units or if a step differs slightly.
    pub(in crate::packed) fn for_learning(&self) -> Self {
        let mut other = self.clone();
        let octaves = libm::rint(libm::log2(f64::from(self.free_value_step())) * PER_OCTAVE) / PER_OCTAVE;
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let step = libm::exp2(octaves) as f32;
        (other.base.colour, other.factors[1]) = (step, 1.0);
        other
    }

    /// Returns the steps of turns about each of the Gaussian's axes, in radians, at shape class 0.
    pub(in crate::packed) fn rotation_steps(&self, scales: Vec3) -> Vec3 {
        self.rotation.map(|row| self.base.shape * exp2(linear(row, scales)))
    }

    /// Returns the steps of the position along each of the Gaussian's axes, in world units, at shape class 0.
    pub(in crate::packed) fn position_steps(&self, scales: Vec3) -> Vec3 {
        self.position.map(|row| self.base.shape * exp2(linear(row, scales)))
    }

    /// Returns the coordinates of a base colour along the axes.
    pub(in crate::packed) fn dc_coordinates(&self, dc: Vec3) -> Vec3 {
        self.dc_turned(std::array::from_fn(|c| dc[c] - self.dc_mean[c]))
    }

    /// Returns the coordinates of a difference between two base colours along the axes.
    pub(in crate::packed) fn dc_turned(&self, d: Vec3) -> Vec3 {
        self.dc_axes.map(|axis| axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2])
    }

    /// Returns the world coordinates of the centre of the cell `(x, y, z)`.
    pub(in crate::packed) fn centre(&self, cell: [u32; 3]) -> [f64; 3] {
        std::array::from_fn(|k| f64::from(self.origin[k]) + (f64::from(cell[k]) + 0.5) * f64::from(self.cell))
    }
}

fn linear(row: [f32; STEP_FEATURES], scales: Vec3) -> f32 {
    row[0] + row[1] * scales[0] + row[2] * scales[1] + row[3] * scales[2]
}

/// Returns the axis about which a turn matters least: the longest one of a needle, and the shortest one of a disc.
pub(in crate::packed) fn least_axis(scales: Vec3) -> usize {
    if scales[0] - scales[1] >= scales[1] - scales[2] { 0 } else { 2 }
}

/// Returns the steps of a rotation as it is coded, in radians: of the direction of [`least_axis`], and of the turn about
/// it. `steps` are the steps of turns about each axis.
pub(in crate::packed) fn rotation_steps(steps: Vec3, scales: Vec3) -> [f32; 2] {
    match least_axis(scales) {
        0 => [(steps[1] * steps[2]).sqrt(), steps[0]],
        _ => [(steps[0] * steps[1]).sqrt(), steps[2]],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hair_in_a_step_changes_nothing_that_is_learned() {
        let of = |base: f32| Parameters {
            base: ColourAndShape { colour: base, shape: 1.0 },
            factors: [1.0, 1.3, 1.0, 1.0, 1.0, 1.0],
            ..Parameters::default()
        };
        for base in [3e-4_f32, 0.7, 12.0] {
            let (one, other) = (of(base), of(base * 1.00001));
            assert_ne!(one.value_step(0).to_bits(), other.value_step(0).to_bits());
            for class in 0..=LAST_CLASS {
                let step = one.for_learning().value_step(class);
                assert_eq!(step.to_bits(), other.for_learning().value_step(class).to_bits());
                assert!((0.91..1.1).contains(&(step / one.value_step(class))), "{base}, {class}: {step}");
            }
        }
        let promised = Parameters { promised: 0.02, ..of(0.7) };
        assert_eq!(promised.for_learning().value_step(3), promised.value_step(3));
    }
}
