//! The values that are drawn, from decoded integers.

use super::coarseness::{Refinements, dropped, factor};
use super::geometry_syntax::Group;
use super::integer_model::VALUE_BITS;
use super::interim::change;
use super::parameters::{DC, KINDS, LAST_CLASS, OPACITY, TARGETS};
use super::values::{logits, numbers, powers, rotations};
use crate::packed::bitstream::broken::Broken;
use crate::packed::entropy::lanes::{LANES, Lanes, each, has};
use crate::support::maths::Vec3;

/// Bound of the absolute values of decoded values. All values that encoders accept are below it, even with the largest
/// steps.
const VALUE_LIMIT: i32 = 1 << (VALUE_BITS + 7);

/// The parameters with which integers become values.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Frame {
    /// Corner of the grid, and side of a cell, in world units.
    pub(in crate::packed) origin: Vec3,
    pub(in crate::packed) cell: f32,
    /// Mean base colour, the axes along which differences from it are coded, and the unit of these coordinates.
    pub(in crate::packed) dc_mean: Vec3,
    pub(in crate::packed) dc_axes: [Vec3; 3],
    pub(in crate::packed) dc_unit: f32,
    /// Steps of the interim changes of scales, opacities and base colours; 0 if there are none.
    pub(in crate::packed) interim: [u32; KINDS],
    /// Steps of SH values, by colour class.
    pub(in crate::packed) value_steps: [f32; LAST_CLASS as usize + 1],
}

/// One Gaussian of each lane, as the values that are drawn.
pub(in crate::packed) struct Drawn {
    pub(in crate::packed) position: [Lanes<f32>; 3],
    pub(in crate::packed) scales: [Lanes<f32>; 3],
    pub(in crate::packed) opacity: Lanes<f32>,
    pub(in crate::packed) rotation: [Lanes<f32>; 4],
    pub(in crate::packed) dc: [Lanes<f32>; 3],
    /// Whether all values of a lane are within [`VALUE_LIMIT`].
    within: Lanes<bool>,
}

impl Drawn {
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(in crate::packed) fn new(
        frame: &Frame,
        group: &Group,
        Refinements { all, missing }: Refinements,
        interim: &Lanes<bool>,
    ) -> Self {
        let (coarse, finer) = (factor(all), factor(missing));
        let mut values = group.coarse;
        // Scales and opacities have no coarse steps.
        for t in DC..TARGETS {
            for l in 0..LANES {
                let over = group.counts[t][l]
                    .wrapping_mul(finer)
                    .wrapping_sub(group.base[t][l].wrapping_mul(coarse));
                values[t][l] = values[t][l].wrapping_add(over.wrapping_mul(group.steps[t][l]));
            }
        }
        if interim.iter().any(|&interim| interim) {
            change(&mut values, &group.interim, &frame.interim, interim);
        }
        // The limit is a power of two. If a number is within it, `number ^ sign` has no bits at or above it.
        let mut beyond = [0; LANES];
        for values in &values {
            for l in 0..LANES {
                beyond[l] |= values[l] ^ values[l] >> 31;
            }
        }
        let within = each(|l| beyond[l] < VALUE_LIMIT);
        let [directions, turns] = &group.axis_bits;
        let left = |bits: &Lanes<u32>| each(|l| bits[l] - dropped(bits[l], missing));
        let bits = [left(directions), left(turns)];
        let turned = rotations(&group.rotation, &bits, &group.needle);
        let centre = |k: usize| {
            let origin = f64::from(frame.origin[k]);
            each(|l| origin + (f64::from(group.cell[k][l]) + 0.5) * f64::from(frame.cell))
        };
        let mut position: [Lanes<f64>; 3] = [centre(0), centre(1), centre(2)];
        for k in 0..3 {
            let step = powers(&group.moves[k]);
            for j in 0..3 {
                for l in 0..LANES {
                    let along = f64::from(group.counts[TARGETS + k][l].wrapping_mul(finer)) * step[l];
                    position[j][l] += along * f64::from(turned.axes[k][j][l]);
                }
            }
        }
        let coordinates = [numbers(&values[DC]), numbers(&values[DC + 1]), numbers(&values[DC + 2])];
        let channel = |c: usize| {
            let [a, b, d] = frame.dc_axes.map(|axis| axis[c] * frame.dc_unit);
            each(|l| frame.dc_mean[c] + coordinates[0][l] * a + coordinates[1][l] * b + coordinates[2][l] * d)
        };
        Self {
            position: [
                each(|l| position[0][l] as f32),
                each(|l| position[1][l] as f32),
                each(|l| position[2][l] as f32),
            ],
            scales: [numbers(&values[0]), numbers(&values[1]), numbers(&values[2])],
            opacity: logits(&values[OPACITY]),
            rotation: turned.quaternions,
            dc: [channel(0), channel(1), channel(2)],
            within,
        }
    }

    /// Returns the rule that the values of the lanes in `set` break: they must be within limits and finite.
    #[inline(always)]
    pub(in crate::packed) fn check(&self, set: u32) -> Result<(), Broken> {
        let all = self.position.iter().chain(&self.dc);
        let mut good = self.within;
        for values in all {
            for l in 0..LANES {
                good[l] &= values[l].is_finite();
            }
        }
        if (0..LANES).all(|l| good[l] || !has(set, l)) {
            return Ok(());
        }
        let are_within = (0..LANES).all(|l| self.within[l] || !has(set, l));
        Err(Broken(match are_within {
            true => "has a position or a base colour that is not finite",
            false => "has a scale, an opacity or a base colour that is not from -2^27 to below 2^27",
        }))
    }
}
