//! Averages of the Gaussians that each lane coded last.

use crate::packed::bitstream::parameters::TARGETS;
use crate::packed::entropy::lanes::{LANES, Lanes, each};
use crate::packed::entropy::shifts::{power, right};

/// Number of Gaussians that are remembered. More gain little, since neighbours on the Morton curve are neighbours in space.
const WINDOW: usize = 16;
/// Largest distance along an axis, in cells. A larger distance counts as this one.
const FARTHEST: u32 = 1023;
/// Binary logarithm of a bound on weights: a weight is at most `2^(WEIGHT_BITS - 1)`.
const WEIGHT_BITS: u32 = 12;
/// Number of values that are averaged: the targets and the two classes.
pub(in crate::packed) const AVERAGED: usize = TARGETS + 2;

/// The last [`WINDOW`] Gaussians of each lane.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct NeighbourContext {
    cells: [[Lanes; 3]; WINDOW],
    features: [[Lanes; AVERAGED]; WINDOW],
    /// Number of Gaussians pushed.
    seen: usize,
}

impl NeighbourContext {
    /// Returns whether a Gaussian was pushed.
    pub(in crate::packed) fn is_known(&self) -> bool {
        self.seen > 0
    }

    /// Returns the averages of the remembered features, weighted by about the inverse squared distance from `cell`.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(in crate::packed) fn average(&self, cell: &[Lanes; 3]) -> [Lanes; AVERAGED] {
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
        let (mut bits, mut half, mut inverse) = ([0; LANES], [0_i32; LANES], [0_i32; LANES]);
        for l in 0..LANES {
            let total = total[l].max(1);
            bits[l] = length(total);
            half[l] = power(bits[l] - 1).cast_signed();
            inverse[l] = inverted(total);
        }
        for sum in &mut sums {
            let rounded = each(|l| sum[l].wrapping_add(half[l]));
            let scaled = right(&rounded, &bits);
            *sum = each(|l| scaled[l].wrapping_mul(inverse[l]) >> 15);
        }
        sums
    }

    #[inline(always)]
    pub(in crate::packed) fn push(&mut self, cell: [Lanes; 3], features: [Lanes; AVERAGED]) {
        let at = self.seen % WINDOW;
        (self.cells[at], self.features[at]) = (cell, features);
        self.seen += 1;
    }
}

/// Returns the weight `2^(12 - n)` for squared distances of `n` bits, and 1 for more than 12 bits.
#[inline(always)]
fn weights(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    let mut weight = [0; LANES];
    for l in 0..LANES {
        let far = |k: usize| a[k][l].abs_diff(b[k][l]).min(FARTHEST);
        let (x, y, z) = (far(0), far(1), far(2));
        let squares = 4 * (x * x + y * y + z * z) + 1;
        weight[l] = power(WEIGHT_BITS - length(squares.cast_signed()).min(WEIGHT_BITS)).cast_signed();
    }
    weight
}

/// Returns the number of bits of a positive number below 2^24.
#[inline(always)]
fn length(number: i32) -> u32 {
    // It is exactly the exponent of the number as an f32. Vector registers have no instruction that counts bits.
    ((number as f32).to_bits() >> 23) - 126
}

/// Returns 2^31, divided by the number after it is shifted up to 16 bits, and rounded down. The number must be positive and
/// below 2^16.
#[inline(always)]
fn inverted(number: i32) -> i32 {
    // The mantissa of an f32 with its leading one holds the shifted number.
    let shifted = (((number as f32).to_bits() & 0x007f_ffff) | 0x0080_0000) >> 8;
    // Vector registers divide only floats. Adding 2^23 rounds to a whole number, which is this quotient or one more.
    const WHOLE: f32 = 8_388_608.0;
    let near = (2_147_483_648.0 / (shifted.cast_signed() as f32) + WHOLE).to_bits() - WHOLE.to_bits();
    let rest = (1_u32 << 31).wrapping_sub(near * shifted).cast_signed();
    near.cast_signed() + (rest >> 31)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A Gaussian of one lane: its cell, and a feature.
    type Seen = ([u32; 3], i32);

    fn gaussians() -> impl Strategy<Value = Vec<Seen>> {
        let cell = prop_oneof![
            prop::array::uniform3(0_u32..20),
            prop::array::uniform3(0_u32..1 << 21),
            Just([1000, 1000, 1000])
        ];
        let feature = prop_oneof![-600..600_i32, -(1 << 14) + 1..1 << 14];
        prop::collection::vec((cell, feature), 2..60)
    }

    fn is_even(number: usize) -> bool {
        number.is_multiple_of(2)
    }

    /// Returns the average feature of the last 16 of `seen`, for a Gaussian in `cell`.
    fn average(seen: &[Seen], cell: [u32; 3]) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for (other, feature) in seen.iter().rev().take(16) {
            let far = |k: usize| f64::from(other[k].abs_diff(cell[k]).min(1023));
            let squares = 4.0 * (far(0).powi(2) + far(1).powi(2) + far(2).powi(2)) + 1.0;
            // The weight is 2^12, divided by the power of two above the number.
            let weight = (4096.0 / 2.0_f64.powf(squares.log2().floor() + 1.0)).max(1.0);
            sum += weight * f64::from(*feature);
            total += weight;
        }
        sum / total
    }

    proptest! {
        #[test]
        fn averages_are_weighted_means(lanes in prop::array::uniform4(gaussians())) {
            let of = |l: usize, i: usize| lanes[l % 4][i % lanes[l % 4].len()];
            let mut around = NeighbourContext::default();
            for i in 0..60 {
                let cell = std::array::from_fn(|k| std::array::from_fn(|l| of(l, i).0[k].cast_signed()));
                prop_assert_eq!(around.is_known(), i > 0);
                if i > 0 {
                    let found = around.average(&cell);
                    for l in 0..LANES {
                        let seen: Vec<Seen> = (0..i).map(|i| of(l, i)).collect();
                        let expected = average(&seen, of(l, i).0);
                        for (a, values) in (0..).zip(&found) {
                            // Half a unit each is lost in the sum and in the inverse of the weights, and one unit in the
                            // last shift.
                            let own = if is_even(a) { expected } else { -expected };
                            prop_assert!((f64::from(values[l]) - own).abs() <= 3.0, "{} {own}", values[l]);
                        }
                    }
                }
                let features = |a: usize| {
                    let feature = |l: usize| if is_even(a) { of(l, i).1 } else { -of(l, i).1 };
                    std::array::from_fn(feature)
                };
                around.push(cell, std::array::from_fn(features));
            }
        }
    }

    #[test]
    fn inverses_are_quotients() {
        for number in 1..1_u32 << 16 {
            let bits = u32::BITS - number.leading_zeros();
            let quotient = (1_u32 << 31) / (number << (16 - bits));
            assert_eq!(
                (length(number.cast_signed()), inverted(number.cast_signed())),
                (bits, quotient.cast_signed())
            );
        }
    }

    /// Neighbours in the same cell have the largest weights.
    #[test]
    fn weights_sum_up_to_less_than_2_to_the_16() {
        let cell = [[5; LANES]; 3];
        assert!(weights(&cell, &cell)[0] * i32::try_from(WINDOW).unwrap() < 1 << 16);
    }

    /// In damaged files a feature is any number, and a cell has any number of 21 bits.
    #[test]
    fn wild_features_are_averaged_somehow() {
        let mut around = NeighbourContext::default();
        for wild in [i32::MIN, i32::MAX, -1, 1 << 30].into_iter().cycle().take(40) {
            let cell = [[wild & 0x1f_ffff; LANES]; 3];
            around.average(&cell);
            around.push(cell, [[wild; LANES]; AVERAGED]);
        }
    }
}
