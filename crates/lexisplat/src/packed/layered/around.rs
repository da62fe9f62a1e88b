//! Averages of the Gaussians that a lane decoded last.

use super::symbols::{LANES, Lanes};
use crate::packed::parameters::TARGETS;

/// Gaussians that are remembered. More of them gain little, since neighbours on the Morton curve are neighbours in
/// space.
const WINDOW: usize = 16;
/// Largest distance along an axis, in cells. Farther neighbours count as this far.
const FARTHEST: u32 = 1023;
/// Bits of the largest weight, and one.
const WEIGHT_BITS: u32 = 12;
/// Values that are averaged: those that are predicted, and the two classes.
pub(super) const AVERAGED: usize = TARGETS + 2;

/// The Gaussians that each lane decoded last.
#[derive(Debug, Clone, Default)]
pub(super) struct Around {
    cells: [[Lanes; 3]; WINDOW],
    features: [[Lanes; AVERAGED]; WINDOW],
    /// Number seen so far.
    seen: usize,
}

impl Around {
    /// Whether there are any.
    pub(super) fn is_known(&self) -> bool {
        self.seen > 0
    }

    /// Averages of the features of the neighbours of `cell`, weighted by about the inverse squared distance.
    #[inline(always)]
    pub(super) fn average(&self, cell: &[Lanes; 3]) -> [Lanes; AVERAGED] {
        let mut total = [0_i32; LANES];
        let mut sums = [[0_i32; LANES]; AVERAGED];
        for (other, features) in self.cells.iter().zip(&self.features).take(self.seen.min(WINDOW)) {
            let weight = weights(other, cell);
            for l in 0..LANES {
                total[l] += weight[l];
            }
            for (sum, feature) in sums.iter_mut().zip(features) {
                for l in 0..LANES {
                    sum[l] = sum[l].wrapping_add(weight[l].wrapping_mul(feature[l]));
                }
            }
        }
        let (mut bits, mut inverse) = ([0; LANES], [0_i32; LANES]);
        for l in 0..LANES {
            let total = total[l].max(1).cast_unsigned();
            bits[l] = u32::BITS - total.leading_zeros();
            inverse[l] = ((1_u32 << 31) / (total << (16 - bits[l].min(16)))).cast_signed();
        }
        for sum in &mut sums {
            for l in 0..LANES {
                let scaled = sum[l].wrapping_add(1 << (bits[l] - 1)) >> bits[l];
                sum[l] = scaled.wrapping_mul(inverse[l]) >> 15;
            }
        }
        sums
    }

    #[inline(always)]
    pub(super) fn push(&mut self, cell: [Lanes; 3], features: [Lanes; AVERAGED]) {
        let at = self.seen % WINDOW;
        (self.cells[at], self.features[at]) = (cell, features);
        self.seen += 1;
    }
}

/// 2^(12 - n) for squared distances of n bits, 1 for more than 12.
#[inline(always)]
fn weights(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    let mut weight = [0; LANES];
    for l in 0..LANES {
        let far = |k: usize| a[k][l].abs_diff(b[k][l]).min(FARTHEST);
        let (x, y, z) = (far(0), far(1), far(2));
        let squares = 4 * (x * x + y * y + z * z) + 1;
        // The exponent of a number below 2^24 as an f32 is its bit length, exactly. Vector registers count no bits.
        let length = ((squares.cast_signed() as f32).to_bits() >> 23) - 126;
        weight[l] = 1 << (WEIGHT_BITS - length.min(WEIGHT_BITS));
    }
    weight
}
