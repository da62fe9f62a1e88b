//! The integers that steer the decoder: steps, predictions and contexts.
//!
//! Integers of 32 bits hold them. Whatever a file holds, no product and no sum of them leaves the range of an `i32`, so
//! every language computes the same ones. Floats are only used to make values of decoded integers.

use crate::packed::bitstream::broken::BrokenHead;
use crate::packed::bitstream::parameters::{ColourAndShape, LAST_CLASS, Parameters, TARGETS};
use crate::packed::entropy::adaptive_bits::{BitDecoder, BitEncoder, Bits, SignedBitModel};
use crate::packed::entropy::lanes::{LANES, Lanes, each};

/// Fraction bits of values. Logarithms of scales and opacities, and coordinates of base colours, are multiples of 2^-20.
pub(in crate::packed) const VALUE_BITS: u32 = 20;
/// Fraction bits of features of predictions, and of logarithms of steps, which are in octaves: both are multiples of 2^-9.
pub(in crate::packed) const FEATURE_BITS: u32 = 9;
/// Fraction bits of coefficients, which are multiples of 2^-12.
pub(in crate::packed) const COEFFICIENT_BITS: u32 = 12;
/// Bits by which products of coefficients and features are shifted before they are summed.
const PRODUCT_SHIFT: u32 = 4;
/// Largest absolute value of a feature.
const MOST_FEATURE: i32 = (1 << 14) - 1;
/// Largest step: 1.5. With a larger step a value is as good as unknown.
const MOST_STEP: u32 = 3 << (VALUE_BITS - 1);
/// Bits of the mantissa of a step.
const MANTISSA_BITS: u32 = 16;
/// Largest logarithm of a step of a turn: that of 1.2 radians.
const MOST_TURN: i32 = 135;
/// Largest absolute value of the sum of a prediction, before it is converted to a value.
const MOST_SUM: i32 = 1 << 25;
/// 512 times two binary logarithms: of 2.5, the number of coordinates an axis has at a step of one radian, and of pi.
const DIRECTIONS: i32 = 677;
const HALF_TURN: i32 = 846;
/// Features per natural logarithm, which is 512 / ln 2, and 512 times the binary logarithm of 2. The largest step of a
/// position is 2 standard deviations along the longest axis.
const OCTAVES_PER_E: i32 = 739;
const MOST_MOVE: i32 = 512;
/// Added to 512 times the logarithm of a number of values before it is rounded down to bits. So `n` bits stand for up to
/// `2^n * sqrt(2)` values.
const HALF_BIT: i32 = 255;
/// Largest number of bits of a coordinate of the main axis, and of the turn about it.
const MOST_AXIS_BITS: i32 = 15;
/// 2.25 octaves. Contexts are half an octave wide, and all cells narrower than `2^-1.75` steps have the first one.
const FINENESS: i32 = 1152;
/// The context of the widest cells, and the last one.
const LAST_FINENESS: i32 = 23;
/// The value 1 as a feature.
pub(in crate::packed) const ONE: i32 = 1 << FEATURE_BITS;

/// Number of coefficients of a prediction: a constant, and those of the average, the two classes and the three scales.
pub(in crate::packed) const COEFFICIENTS: usize = 7;
/// Index of the last coefficient before those of scales. Scale `t` is predicted from the `t` scales before it.
const BEFORE_SCALES: usize = 3;
/// Number of coefficients of the logarithm of a step: a constant, and those of the three scales.
pub(in crate::packed) const SLOPES: usize = 4;

/// A step of class 0: `mantissa * 2^-shift`, in multiples of 2^-20. The mantissa is below 2^16.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::packed) struct Step {
    pub(in crate::packed) mantissa: u16,
    pub(in crate::packed) shift: i8,
}

/// Most bits by which a mantissa is shifted up. A mantissa of 16 bits is then above the largest step.
const MOST_SHIFT: i32 = 6;

impl Step {
    /// Smallest and largest shift.
    pub(in crate::packed) const SHIFTS: std::ops::RangeInclusive<i8> = -6..=31;

    /// Returns the step nearest to `x`.
    fn of(x: f64) -> Self {
        let mut scaled = x * f64::from(1_u32 << (VALUE_BITS - MOST_SHIFT.unsigned_abs()));
        let mut shift = *Self::SHIFTS.start();
        while shift < *Self::SHIFTS.end() && scaled < f64::from(1_u32 << (MANTISSA_BITS - 1)) {
            scaled *= 2.0;
            shift += 1;
        }
        Self { mantissa: rounded(scaled, 1.0, f64::from(u16::MAX)) as u16, shift }
    }

    /// Returns the step of a class, in multiples of 2^-20.
    fn at(self, class: u32) -> u32 {
        let up = class.cast_signed() - i32::from(self.shift);
        let mantissa = u32::from(self.mantissa);
        let step = if up >= 0 { mantissa << up.min(MOST_SHIFT) } else { mantissa >> -up };
        step.clamp(1, MOST_STEP)
    }
}

/// Rounds `x` to the nearest whole number, and clamps it to `least` and `most`.
#[expect(clippy::cast_possible_truncation, reason = "clamped")]
fn rounded(x: f64, least: f64, most: f64) -> i64 {
    libm::rint(x).clamp(least, most) as i64
}

/// Number of low bits that are 0: in constants, means and constants of logarithms, and in coefficients. With more precise
/// numbers, files are no smaller.
const CONSTANT_ZEROS: u32 = 2;
const COEFFICIENT_ZEROS: u32 = 4;

/// Returns the multiple of `2^zeros` that is nearest to `x`.
fn round_multiple(x: f64, zeros: u32) -> i16 {
    let most = f64::from(i16::MAX >> zeros);
    (rounded(x / f64::from(1_u32 << zeros), -most, most) << zeros) as i16
}

/// Returns a constant or a mean as a feature.
fn constant(x: f64) -> i16 {
    round_multiple(x * f64::from(1_u32 << FEATURE_BITS), CONSTANT_ZEROS)
}

/// Returns a coefficient as a multiple of 2^-12.
fn coefficient(x: f64) -> i16 {
    round_multiple(x * f64::from(1_u32 << COEFFICIENT_BITS), COEFFICIENT_ZEROS)
}

/// The integers of a file's parameters.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Integers {
    /// Binary logarithm of the side of a cell, in 512ths.
    pub(in crate::packed) cell: i16,
    /// Steps of class 0 of the three scales, the opacity and the base colour.
    pub(in crate::packed) steps: [Step; 5],
    /// Logarithms of the steps of turns and moves at shape class 0, as linear functions of the scales.
    pub(in crate::packed) turns: [[i16; SLOPES]; 3],
    pub(in crate::packed) moves: [[i16; SLOPES]; 3],
    /// Averages for Gaussians without neighbours, as features.
    pub(in crate::packed) means: [i16; TARGETS],
    pub(in crate::packed) predictors: [[i16; COEFFICIENTS]; TARGETS],
}

impl Integers {
    /// Returns the integers nearest to `p`. Base colours are in units of `dc_unit`.
    pub(in crate::packed) fn of(p: &Parameters, dc_unit: f64) -> Self {
        let octaves = |x: f32| libm::log2(f64::from(x));
        let slopes = |row: [f32; SLOPES]| -> [i16; SLOPES] {
            std::array::from_fn(|k| match k {
                0 => constant(f64::from(row[0]) + octaves(p.base.shape)),
                _ => coefficient(f64::from(row[k])),
            })
        };
        let [dc, _, opacity, s0, s1, s2] = p.factors.map(f64::from);
        let ColourAndShape { colour, shape } = p.base.map(f64::from);
        let steps = [shape * s0, shape * s1, shape * s2, shape * opacity, colour * dc / dc_unit];
        // A coefficient whose feature has another unit than the target is divided by the unit of the target.
        let unit = |t: usize| if t < 4 { 1.0 } else { dc_unit };
        let predictors = std::array::from_fn(|t| {
            std::array::from_fn(|k| {
                let own = if k == 1 { 1.0 } else { unit(t) };
                let x = f64::from(p.predictors[t][k]) / own;
                match k {
                    0 => constant(x),
                    // Scales are predicted from earlier scales only.
                    _ if k > BEFORE_SCALES + t => 0,
                    _ => coefficient(x),
                }
            })
        });
        Self {
            cell: constant(octaves(p.cell)),
            steps: steps.map(Step::of),
            turns: p.rotation.map(slopes),
            moves: p.position.map(slopes),
            means: std::array::from_fn(|t| constant(f64::from(p.means[t]) / unit(t))),
            predictors,
        }
    }
}

impl Integers {
    /// Returns the groups of numbers that share adaptive probabilities, and for each the number of low bits that are 0.
    fn groups(&mut self) -> Vec<(Vec<&mut i16>, u32)> {
        let mut groups = vec![(vec![&mut self.cell], CONSTANT_ZEROS)];
        for rows in [&mut self.turns, &mut self.moves] {
            let (mut constants, mut slopes) = (Vec::new(), Vec::new());
            for [constant, of_scales @ ..] in rows {
                constants.push(constant);
                slopes.extend(of_scales);
            }
            groups.extend([(constants, CONSTANT_ZEROS), (slopes, COEFFICIENT_ZEROS)]);
        }
        groups.push((self.means.iter_mut().collect(), CONSTANT_ZEROS));
        let mut columns: [Vec<&mut i16>; COEFFICIENTS] = Default::default();
        for (t, row) in self.predictors.iter_mut().enumerate() {
            for (k, (column, number)) in columns.iter_mut().zip(row).enumerate() {
                if k <= BEFORE_SCALES + t {
                    column.push(number);
                }
            }
        }
        let zeros = |k: usize| if k == 0 { CONSTANT_ZEROS } else { COEFFICIENT_ZEROS };
        groups.extend(columns.into_iter().enumerate().map(|(k, column)| (column, zeros(k))));
        groups
    }

    /// Codes all integers but the steps. A decoder gets the decoded ones in place of its own.
    fn code(&mut self, bits: &mut dyn Bits) -> Result<(), BrokenHead> {
        for (group, zeros) in self.groups() {
            let mut model = SignedBitModel::default();
            for number in group {
                let coded = bits.signed(&mut model, i32::from(*number >> zeros)) << zeros;
                *number = i16::try_from(coded)
                    .map_err(|_| BrokenHead(format!("the integers: {coded} is not from -32768 to 32767")))?;
            }
        }
        Ok(())
    }

    /// Returns the bytes of all integers but the steps.
    pub(in crate::packed) fn write(&self) -> Vec<u8> {
        let mut encoder = BitEncoder::default();
        // An encoder returns the integers that it is given.
        let _ = self.clone().code(&mut encoder);
        encoder.finish()
    }

    /// Reads the bytes that [`Self::write`] wrote.
    ///
    /// # Errors
    /// The broken rule for all other bytes.
    pub(in crate::packed) fn read(&mut self, bytes: &[u8]) -> Result<(), BrokenHead> {
        let mut decoder = BitDecoder::new(bytes);
        self.code(&mut decoder)?;
        decoder.finish("the integers")
    }
}

/// The integers of a file's parameters, prepared for the walk over a chunk.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Steering {
    cell: i32,
    /// Steps of the scales, the opacity and the base colour, at each class.
    steps: [[u32; LAST_CLASS as usize + 1]; 5],
    turns: [[i32; SLOPES]; 3],
    moves: [[i32; SLOPES]; 3],
    pub(in crate::packed) means: [i32; TARGETS],
    predictors: [[i32; COEFFICIENTS]; TARGETS],
}

impl Steering {
    pub(in crate::packed) fn new(p: &Integers) -> Self {
        Self {
            cell: p.cell.into(),
            steps: p.steps.map(|step| std::array::from_fn(|class| step.at(class as u32))),
            turns: p.turns.map(|row| row.map(i32::from)),
            moves: p.moves.map(|row| row.map(i32::from)),
            means: p.means.map(i32::from),
            predictors: p.predictors.map(|row| row.map(i32::from)),
        }
    }

    /// Returns the step of target `t` in each lane, by its class from 0 to 15.
    #[inline(always)]
    pub(in crate::packed) fn step(&self, t: usize, class: &Lanes<u32>) -> Lanes {
        let steps = &self.steps[t.min(4)];
        each(|l| steps[(class[l] & u32::from(LAST_CLASS)) as usize].cast_signed())
    }

    /// Returns predictions of target `t`, as values. The features are the average, the two classes and the three scales.
    #[inline(always)]
    pub(in crate::packed) fn predict(&self, t: usize, features: &[Lanes; COEFFICIENTS - 1]) -> Lanes {
        let row = &self.predictors[t];
        let mut sums = [row[0] << (COEFFICIENT_BITS - PRODUCT_SHIFT); LANES];
        for (p, feature) in row[1..].iter().zip(features) {
            for l in 0..LANES {
                sums[l] = sums[l].wrapping_add(p.wrapping_mul(feature[l]) >> PRODUCT_SHIFT);
            }
        }
        const SHIFT: u32 = VALUE_BITS + PRODUCT_SHIFT - FEATURE_BITS - COEFFICIENT_BITS;
        each(|l| sums[l].clamp(-MOST_SUM, MOST_SUM) << SHIFT)
    }

    /// Returns the logarithms of steps for a row of coefficients.
    #[inline(always)]
    fn logarithms(row: &[i32; SLOPES], class: &Lanes<u32>, scales: &[Lanes; 3]) -> Lanes {
        let mut logs = [0; LANES];
        for l in 0..LANES {
            let slopes = ((row[1] * scales[0][l]) >> COEFFICIENT_BITS)
                + ((row[2] * scales[1][l]) >> COEFFICIENT_BITS)
                + ((row[3] * scales[2][l]) >> COEFFICIENT_BITS);
            logs[l] = row[0] + (class[l].cast_signed() << FEATURE_BITS) + slopes;
        }
        logs
    }

    /// Returns the number of bits of each coordinate of the main axis and of the turn about it, and whether the main axis
    /// is the longest.
    #[inline(always)]
    pub(in crate::packed) fn axis_bits(
        &self,
        class: &Lanes<u32>,
        scales: &[Lanes; 3],
    ) -> ([Lanes<u32>; 2], Lanes<bool>) {
        let [a, b, c] = &self.turns;
        let log = |row: &[i32; SLOPES]| {
            let logs = Self::logarithms(row, class, scales);
            each(|l| logs[l].min(MOST_TURN))
        };
        let logs = [log(a), log(b), log(c)];
        let (mut bits, mut needle) = ([[0; LANES]; 2], [false; LANES]);
        for l in 0..LANES {
            needle[l] = scales[0][l] - scales[1][l] >= scales[1][l] - scales[2][l];
            let (turn, other) = if needle[l] { (logs[0][l], logs[2][l]) } else { (logs[2][l], logs[0][l]) };
            let pair = (logs[1][l] + other) >> 1;
            bits[0][l] = bits_for(DIRECTIONS - pair);
            bits[1][l] = bits_for(HALF_TURN - turn);
        }
        (bits, needle)
    }

    /// Returns the logarithms of the steps of the position along each axis.
    #[inline(always)]
    pub(in crate::packed) fn move_logs(&self, class: &Lanes<u32>, scales: &[Lanes; 3]) -> [Lanes; 3] {
        let most = each(|l| MOST_MOVE + ((scales[0][l] * OCTAVES_PER_E) >> FEATURE_BITS));
        let log = |row: &[i32; SLOPES]| {
            let logs = Self::logarithms(row, class, scales);
            each(|l| logs[l].min(most[l]))
        };
        let [a, b, c] = &self.moves;
        [log(a), log(b), log(c)]
    }

    /// Returns the context of a position. `log` is the logarithm of its step.
    #[inline(always)]
    pub(in crate::packed) fn fineness(&self, log: i32) -> u32 {
        ((self.cell - log + FINENESS) >> (FEATURE_BITS - 1)).clamp(0, LAST_FINENESS).cast_unsigned()
    }
}

/// Returns the number of bits for `2^(log / 512)` values.
#[inline(always)]
fn bits_for(log: i32) -> u32 {
    ((log + HALF_BIT) >> FEATURE_BITS).clamp(0, MOST_AXIS_BITS).cast_unsigned()
}

/// Returns a value as a feature.
#[inline(always)]
pub(in crate::packed) fn feature(value: i32) -> i32 {
    (value >> (VALUE_BITS - FEATURE_BITS)).clamp(-MOST_FEATURE, MOST_FEATURE)
}

#[cfg(test)]
mod tests;
