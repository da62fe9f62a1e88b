//! Rounding to half precision with integers. WebAssembly and many CPUs have no instructions for it.

use half::f16;

/// Number of mantissa bits that an f32 has and an f16 has not.
const CUT: u32 = f32::MANTISSA_DIGITS - f16::MANTISSA_DIGITS;
/// The bits, as f32, of 2^-14 and of 65,520. Half precision has fewer digits for numbers below the first, and infinity from
/// the second on.
const LEAST: u32 = 113 << 23;
const BEYOND: u32 = 0x477f_f000;
/// Difference between the exponents of a number in both precisions, in the bits of the exponent of an f32.
const REBIAS: u32 = 112 << 23;
/// The bits of infinity in half precision, shifted to those of an f32.
const INFINITE: u32 = 0x7c00 << CUT;
const SIGN: u32 = 1 << 31;

/// Rounds `x` to half precision, and to the even number if it is in the middle between two.
#[inline(always)]
pub(in crate::packed) fn halved(x: f32) -> f16 {
    let (sign, size) = (x.to_bits() & SIGN, x.to_bits() & !SIGN);
    if !(LEAST..BEYOND).contains(&size) {
        return halved_by_library(x);
    }
    let near = size + (1 << (CUT - 1)) - 1 + (size >> CUT & 1);
    f16::from_bits((sign >> 16 | (near - REBIAS) >> CUT) as u16)
}

/// Returns a number of half precision as an f32.
#[inline(always)]
pub(in crate::packed) fn doubled(x: f16) -> f32 {
    let bits = u32::from(x.to_bits());
    let (sign, size) = (bits << 16 & SIGN, (bits & 0x7fff) << CUT);
    if !(LEAST - REBIAS..INFINITE).contains(&size) {
        return doubled_by_library(x);
    }
    f32::from_bits(sign | (size + REBIAS))
}

/// Computes [`halved`] for numbers that hardly occur.
#[cold]
#[inline(never)]
fn halved_by_library(x: f32) -> f16 {
    f16::from_f32(x)
}

/// Computes [`doubled`] for numbers that hardly occur.
#[cold]
#[inline(never)]
fn doubled_by_library(x: f16) -> f32 {
    x.to_f32()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_same(x: f32) {
        assert_eq!(halved(x).to_bits(), f16::from_f32(x).to_bits(), "{x:e}");
    }

    /// Tests all numbers of half precision, the middles between them, and the numbers next to both.
    #[test]
    fn numbers_are_rounded_as_the_library_does() {
        for bits in 0..=u16::MAX {
            let exact = f16::from_bits(bits).to_f32().to_bits();
            assert_eq!(doubled(f16::from_bits(bits)).to_bits(), exact);
            for middle in [exact, exact.wrapping_add(1 << (CUT - 1)), exact.wrapping_sub(1 << (CUT - 1))] {
                for off in -1..=1_i32 {
                    assert_same(f32::from_bits(middle.wrapping_add_signed(off)));
                }
            }
        }
        for x in [0.0, f32::MIN_POSITIVE, 65_519.996, 65_520.0, f32::MAX, f32::INFINITY, f32::NAN] {
            assert_same(x);
            assert_same(-x);
        }
    }

    #[test]
    #[ignore = "takes half a minute"]
    fn all_numbers_are_rounded_as_the_library_does() {
        (0..=u32::MAX).for_each(|bits| assert_same(f32::from_bits(bits)));
    }
}
