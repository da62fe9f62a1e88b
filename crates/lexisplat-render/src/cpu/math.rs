//! Mathematical functions that give the same bits on every machine. Those of the system do not.

/// Below this `exp` is 0, and above [`EXP_MAX`] it is infinite: there the result leaves the normal f32 range.
const EXP_MIN: f32 = -87.0;
/// See [`EXP_MIN`].
const EXP_MAX: f32 = 88.0;
/// 1.5 * 2^23: adding and subtracting it rounds to the nearest integer.
const ROUND: f32 = 12_582_912.0;
/// ln 2 in two parts. The first has so few bits that its multiples are exact (Cephes `expf`).
const LN2_HIGH: f32 = 0.693_359_4;
const LN2_LOW: f32 = -2.121_944_4e-4;
/// exp(r) = 1 + r + r^2 P(r) on [-ln 2 / 2, ln 2 / 2], highest power first (Cephes `expf`).
const POLYNOMIAL: [f32; 6] = [1.987_569_2e-4, 1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5];
/// Exponent bias and position in an f32.
const BIAS: u32 = 127;
const MANTISSA_BITS: u32 = 23;

/// Returns e to the power `x`, with a relative error of at most 2e-7.
#[inline]
pub(super) fn exp(x: f32) -> f32 {
    match x {
        x if x < EXP_MIN => 0.0,
        x if x > EXP_MAX => f32::INFINITY,
        x => exp_in_range(x),
    }
}

/// [`exp`] for `x` from [`EXP_MIN`] to [`EXP_MAX`]; any number for other `x`.
///
/// It has no branches and no calls, so that loops over it become vector instructions.
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

/// 1 / (1 + e^-x).
#[inline]
pub(super) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
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
    fn exp_leaves_the_range_gracefully() {
        assert_eq!(exp(-1000.0).to_bits(), 0);
        assert_eq!(exp(f32::NEG_INFINITY).to_bits(), 0);
        assert!(exp(1000.0).is_infinite() && exp(f32::INFINITY).is_infinite());
        assert!((sigmoid(-100.0), sigmoid(100.0)) == (0.0, 1.0));
    }
}
