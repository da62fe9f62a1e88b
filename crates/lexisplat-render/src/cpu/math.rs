//! Mathematical functions that give the same bits on every machine. The operating system's functions do not.

/// Bounds of the range of `exp`. Below `EXP_MIN` the result is 0, and above [`EXP_MAX`] it is infinite, because it leaves
/// the normal `f32` range.
const EXP_MIN: f32 = -87.0;
/// See [`EXP_MIN`].
const EXP_MAX: f32 = 88.0;
/// 1.5 * 2^23: adding and subtracting it rounds to the nearest integer.
const ROUND: f32 = 12_582_912.0;
/// ln 2 as a sum of two terms. The first has so few bits that its multiples are exact (Cephes `expf`).
const LN2_HIGH: f32 = 0.693_359_4;
const LN2_LOW: f32 = -2.121_944_4e-4;
/// exp(r) = 1 + r + r^2 P(r) on [-ln 2 / 2, ln 2 / 2], highest power first (Cephes `expf`).
const POLYNOMIAL: [f32; 6] = [1.987_569_2e-4, 1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5];
/// Exponent bias and position of an `f32`.
const BIAS: u32 = 127;
const MANTISSA_BITS: u32 = 23;

/// Returns e to the power `x`, with a relative error of at most 2e-7.
///
/// Like all functions of this module it has no branches and no calls, so that loops over it become vector instructions.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    let value = exp_in_range(x);
    let value = if x < EXP_MIN { 0.0 } else { value };
    if x > EXP_MAX { f32::INFINITY } else { value }
}

/// Returns the same as [`exp`] for `x` from [`EXP_MIN`] to [`EXP_MAX`], and any number for other `x`.
#[inline(always)]
pub(super) fn exp_in_range(x: f32) -> f32 {
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = x - n * LN2_HIGH;
    let r = r - n * LN2_LOW;
    let mut p = POLYNOMIAL[0];
    p = p * r + POLYNOMIAL[1];
    p = p * r + POLYNOMIAL[2];
    p = p * r + POLYNOMIAL[3];
    p = p * r + POLYNOMIAL[4];
    p = p * r + POLYNOMIAL[5];
    let fraction = p * (r * r) + r + 1.0;
    // The low bits of `shifted` hold the integer n, in two's complement.
    let power = f32::from_bits(shifted.to_bits().wrapping_add(BIAS) << MANTISSA_BITS);
    fraction * power
}

/// Returns `1 / (1 + e^-x)`.
#[inline(always)]
pub(super) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// Bits of the square root of one half, where the range of the logarithm's polynomial begins.
const SQRT_HALF: u32 = 0x3f35_04f3;
const MANTISSA: u32 = (1 << MANTISSA_BITS) - 1;
/// `ln(1 + f) = f - f^2 / 2 + f^3 P(f)` for `1 + f` from the square root of one half to the square root of 2, highest
/// power first (Cephes `logf`).
const LOGARITHM: [f32; 9] = [
    7.037_683_6e-2,
    -1.151_461e-1,
    1.167_699_9e-1,
    -1.242_014_1e-1,
    1.424_932_3e-1,
    -1.666_805_8e-1,
    2.000_071_5e-1,
    -2.499_999_4e-1,
    3.333_333e-1,
];

/// Returns the natural logarithm of a positive normal `x`, with an error of at most 2e-7 times the larger of 1 and the
/// result. Returns any number for other `x`.
#[inline(always)]
#[expect(clippy::cast_possible_wrap, clippy::cast_precision_loss, reason = "an exponent has 8 bits")]
pub(super) fn ln(x: f32) -> f32 {
    let bits = x.to_bits().wrapping_sub(SQRT_HALF);
    let n = ((bits as i32) >> MANTISSA_BITS) as f32;
    let f = f32::from_bits((bits & MANTISSA).wrapping_add(SQRT_HALF)) - 1.0;
    let mut p = LOGARITHM[0];
    p = p * f + LOGARITHM[1];
    p = p * f + LOGARITHM[2];
    p = p * f + LOGARITHM[3];
    p = p * f + LOGARITHM[4];
    p = p * f + LOGARITHM[5];
    p = p * f + LOGARITHM[6];
    p = p * f + LOGARITHM[7];
    p = p * f + LOGARITHM[8];
    let z = f * f;
    let low = f * z * p + n * LN2_LOW - 0.5 * z;
    f + low + n * LN2_HIGH
}

/// Returns a word with all bits set if `condition` holds, otherwise 0.
#[inline(always)]
pub(super) fn mask(condition: bool) -> u32 {
    if condition { u32::MAX } else { 0 }
}

/// Converts a whole number from 0 to 65535 to an integer.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range; else it saturates")]
pub(super) fn whole(x: f32) -> u16 {
    x as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_accurate() {
        let mut worst = 0.0_f64;
        for i in -8_699_i16..8_799 {
            for j in 0..16_u8 {
                let x = f32::from(i) / 100.0 + f32::from(j) * 0.000_617;
                let expected = f64::from(x).exp();
                worst = worst.max((f64::from(exp(x)) / expected - 1.0).abs());
            }
        }
        assert!(worst < 2e-7, "{worst}");
        assert_eq!(exp(0.0).to_bits(), 1.0_f32.to_bits());
    }

    #[test]
    fn ln_is_accurate() {
        let mut x = 1e-37_f32;
        while x < 1e37 {
            let expected = f64::from(x).ln();
            let error = (f64::from(ln(x)) - expected).abs();
            assert!(error < 2e-7 * expected.abs().max(1.0), "{x}: {error}");
            x *= 1.000_37;
        }
        assert_eq!(ln(1.0).to_bits(), 0);
    }

    #[test]
    fn exp_leaves_the_range_gracefully() {
        assert_eq!(exp(-1000.0).to_bits(), 0);
        assert_eq!(exp(f32::NEG_INFINITY).to_bits(), 0);
        assert!(exp(1000.0).is_infinite() && exp(f32::INFINITY).is_infinite());
        assert!((sigmoid(-100.0), sigmoid(100.0)) == (0.0, 1.0));
    }
}
