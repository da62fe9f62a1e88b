//! The interface that the encoder and the decoder of a range share.

use super::lanes::{LANES, Lanes, each};
use crate::packed::bitstream::streams::Slot;

/// The encoder or the decoder of a range. The encoder calls a closure for the value of each lane, records the value, and
/// returns it. The decoder returns the values of the range and never calls the closures. So one walk serves both.
///
/// Only lanes in `set` are coded. The others get 0.
pub(in crate::packed) trait Symbols {
    /// Codes one byte of each lane, with the probabilities of `context`.
    fn symbols(
        &mut self,
        slot: Slot,
        context: Lanes<u32>,
        set: u32,
        value: impl Fn(usize) -> u32,
    ) -> Lanes<u32>;

    /// Codes `count` raw bits of each lane, at most 32.
    fn bits(&mut self, slot: Slot, count: Lanes<u32>, set: u32, value: impl Fn(usize) -> u32) -> Lanes<u32>;

    /// Codes integers: a token with the probabilities of `context`, followed by raw bits if the integer is large.
    #[inline(always)]
    fn integers(
        &mut self,
        slot: Slot,
        context: Lanes<u32>,
        set: u32,
        value: impl Fn(usize) -> u32,
    ) -> Lanes<u32> {
        let tokens = self.symbols(slot, context, set, |l| token(u64::from(value(l))));
        if tokens.iter().fold(0, |all, t| all | t) < DIRECT {
            return tokens;
        }
        let count = each(|l| low_bits(tokens[l]).min(30));
        let low =
            self.bits(slot, count, set, |l| value(l) & ((1 << low_bits(token(u64::from(value(l))))) - 1));
        each(|l| if tokens[l] < DIRECT { tokens[l] } else { (2 + (tokens[l] & 1)) << count[l] | low[l] })
    }

    /// Codes integers with a sign.
    #[inline(always)]
    fn signed(&mut self, slot: Slot, context: Lanes<u32>, set: u32, value: impl Fn(usize) -> i32) -> Lanes {
        let coded = self.integers(slot, context, set, |l| zigzag(value(l)));
        each(|l| unzigzag(coded[l]))
    }

    /// Codes integers below 2^63.
    #[inline(always)]
    fn wide(
        &mut self,
        slot: Slot,
        context: Lanes<u32>,
        set: u32,
        value: impl Fn(usize) -> u64,
    ) -> Lanes<u64> {
        let tokens = self.symbols(slot, context, set, |l| token(value(l)));
        let mut out = each(|l| u64::from(tokens[l]));
        if tokens.iter().fold(0, |all, t| all | t) < DIRECT {
            return out;
        }
        let count = each(|l| low_bits(tokens[l]).min(61));
        let rest = |l: usize| value(l) & ((1 << low_bits(token(value(l)))) - 1);
        let low = self.bits(slot, each(|l| count[l].min(32)), set, |l| low_half(rest(l)));
        let high = self.bits(slot, each(|l| count[l].saturating_sub(32)), set, |l| low_half(rest(l) >> 32));
        for l in 0..LANES {
            if tokens[l] >= DIRECT {
                out[l] =
                    u64::from(2 + (tokens[l] & 1)) << count[l] | u64::from(high[l]) << 32 | u64::from(low[l]);
            }
        }
        out
    }
}

/// Returns the low 32 bits of a number.
fn low_half(x: u64) -> u32 {
    (x & u64::from(u32::MAX)) as u32
}

/// Integers below this are their own token.
const DIRECT: u32 = 16;
/// Number of bits of the last integer that is its own token.
const DIRECT_BITS: u32 = 4;

/// Returns the token of an integer: the integer itself if it is small, otherwise its length in bits and the bit after the
/// leading one.
pub(in crate::packed) fn token(value: u64) -> u32 {
    if value < u64::from(DIRECT) {
        return low_half(value);
    }
    let length = u64::BITS - value.leading_zeros();
    DIRECT + 2 * (length - DIRECT_BITS - 1) + low_half((value >> (length - 2)) & 1)
}

/// Returns the number of raw bits that follow `token`.
#[inline(always)]
pub(in crate::packed) fn low_bits(token: u32) -> u32 {
    if token < DIRECT { 0 } else { (token - DIRECT) / 2 + DIRECT_BITS - 1 }
}

/// Maps integers with a sign to unsigned ones, by magnitude: 0, -1, 1, -2, ... become 0, 1, 2, 3, ...
#[inline(always)]
pub(in crate::packed) fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)).cast_unsigned()
}

/// Inverts [`zigzag`].
#[inline(always)]
pub(in crate::packed) fn unzigzag(value: u32) -> i32 {
    (value >> 1).cast_signed() ^ (value & 1).cast_signed().wrapping_neg()
}
