//! Shifts by different numbers of bits in each lane.
//!
//! WebAssembly shifts all lanes of a vector by the same number, and the compiler splits vectors for any other shift. There
//! a power of two is made as the exponent of a float, and a shift is a product with a power of two. Both ways give the same
//! bits.

use crate::packed::entropy::lanes::{Lanes, each};

/// Largest shift.
pub(in crate::packed) const MOST_SHIFT: u32 = 16;
/// 2^23. Adding it to a smaller integer, as a float, leaves the integer in the mantissa.
const WHOLE: f32 = 8_388_608.0;

const NONE_IN_VECTORS: bool = cfg!(target_arch = "wasm32");

/// Returns `2^n`, for `n` up to [`MOST_SHIFT`].
#[inline(always)]
pub(in crate::packed) fn power(n: u32) -> u32 {
    if NONE_IN_VECTORS { power_of_float(n) } else { 1 << n }
}

#[inline(always)]
fn power_of_float(n: u32) -> u32 {
    (f32::from_bits((n + 127) << 23) + WHOLE).to_bits() - WHOLE.to_bits()
}

/// Returns each number shifted right by up to [`MOST_SHIFT`], rounded down.
#[inline(always)]
pub(in crate::packed) fn right(numbers: &Lanes, n: &Lanes<u32>) -> Lanes {
    if NONE_IN_VECTORS { right_by_product(numbers, n) } else { each(|l| numbers[l] >> n[l]) }
}

#[inline(always)]
fn right_by_product(numbers: &Lanes, n: &Lanes<u32>) -> Lanes {
    let factor = each(|l| power(MOST_SHIFT - n[l]).cast_signed());
    each(|l| ((i64::from(numbers[l]) * i64::from(factor[l])) >> MOST_SHIFT) as i32)
}

/// Returns each unsigned number shifted right by up to [`MOST_SHIFT`].
#[inline(always)]
pub(in crate::packed) fn right_unsigned(numbers: &Lanes<u32>, n: &Lanes<u32>) -> Lanes<u32> {
    if NONE_IN_VECTORS { right_unsigned_by_product(numbers, n) } else { each(|l| numbers[l] >> n[l]) }
}

#[inline(always)]
fn right_unsigned_by_product(numbers: &Lanes<u32>, n: &Lanes<u32>) -> Lanes<u32> {
    let factor = each(|l| power(MOST_SHIFT - n[l]));
    each(|l| ((u64::from(numbers[l]) * u64::from(factor[l])) >> MOST_SHIFT) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::entropy::lanes::LANES;
    use crate::support::rng::SplitMix64;

    #[test]
    fn all_ways_give_the_same_bits() {
        for n in 0..=MOST_SHIFT {
            assert_eq!(power_of_float(n), 1 << n);
            assert_eq!(power(n), 1 << n);
        }
        let mut rng = SplitMix64::new(3);
        for round in 0..2000_u32 {
            let numbers: Lanes<u32> = std::array::from_fn(|l| match l {
                0 => u32::MAX,
                1 => 1 << 31,
                _ => (rng.next() >> 32) as u32 >> (round % 32),
            });
            let n: Lanes<u32> = std::array::from_fn(|l| (l as u32 + round) % (MOST_SHIFT + 1));
            let signed = numbers.map(u32::cast_signed);
            let expected: Lanes = std::array::from_fn(|l| signed[l] >> n[l]);
            assert_eq!((right(&signed, &n), right_by_product(&signed, &n)), (expected, expected));
            let expected: Lanes<u32> = std::array::from_fn(|l| numbers[l] >> n[l]);
            assert_eq!(
                (right_unsigned(&numbers, &n), right_unsigned_by_product(&numbers, &n)),
                (expected, expected)
            );
        }
        assert_eq!(right(&[-1; LANES], &[MOST_SHIFT; LANES]), [-1; LANES]);
    }
}
