//! Bits with adaptive probabilities: a range coder for the parts of a file that are written once.
//!
//! The decoder's state is a code and a range, of 32 bits each. All of its products are below 2^32.

/// Number of bits of a probability.
const PRECISION: u32 = 12;
/// Smallest probability of either bit, in units of 2^-12.
const LEAST: u16 = 48;
/// Shifts of the distance from certainty: after each of the first bits, and after all later bits.
const RATES: [u32; 6] = [1, 2, 3, 4, 4, 5];
/// The range is kept at or above this.
const LEAST_RANGE: u32 = 1 << 24;

/// The probability one half.
const HALF: u16 = 1 << (PRECISION - 1);

/// The adaptive probability that a bit is 0, and the number of bits it has learned from.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::packed) struct BitModel {
    /// Difference of the probability from one half.
    above: i16,
    /// Number of bits seen, at most 255. It is as wide as the other field, so there is no padding, and many models are
    /// cleared at once.
    seen: u16,
}

impl BitModel {
    fn zero(self) -> u16 {
        HALF.wrapping_add_signed(self.above)
    }

    fn learn(&mut self, bit: bool) {
        let rate = RATES[usize::from(self.seen).min(RATES.len() - 1)];
        self.seen = (self.seen + 1).min(u8::MAX.into());
        let zero = self.zero();
        let zero = if bit { zero - (zero >> rate) } else { zero + (((1 << PRECISION) - zero) >> rate) };
        self.above = zero.clamp(LEAST, (1 << PRECISION) - LEAST).wrapping_sub(HALF).cast_signed();
    }
}

/// An encoder or a decoder of bits. An encoder writes the bit that it is given. A decoder ignores it. Both return the bit.
pub(in crate::packed) trait Bits {
    /// Codes a bit that is 0 with the probability `zero`.
    fn split(&mut self, zero: u16, bit: bool) -> bool;

    fn bit(&mut self, odds: &mut BitModel, bit: bool) -> bool {
        let bit = self.split(odds.zero(), bit);
        odds.learn(bit);
        bit
    }

    /// Codes `count` bits of `value`, highest first. Both values of a bit have the same probability.
    fn even(&mut self, count: u32, value: u32) -> u32 {
        (0..count).rev().fold(0, |all, k| all << 1 | u32::from(self.split(HALF, value >> k & 1 == 1)))
    }

    /// Codes a number from 1 to less than `2^odds.len()`. Its length in bits is coded in unary with adaptive probabilities.
    /// The bits after the leading one follow with even probabilities.
    fn positive(&mut self, odds: &mut [BitModel], value: u32) -> u32 {
        let wanted = u32::BITS - value.max(1).leading_zeros();
        let mut length = 1;
        for odds in odds.iter_mut().skip(1) {
            if !self.bit(odds, length < wanted) {
                break;
            }
            length += 1;
        }
        1 << (length - 1) | self.even(length - 1, value & !(1 << (length - 1)))
    }

    /// Codes a number with a sign.
    fn signed(&mut self, odds: &mut SignedBitModel, value: i32) -> i32 {
        if !self.bit(&mut odds.nonzero, value != 0) {
            return 0;
        }
        let negative = self.bit(&mut odds.negative, value < 0);
        let size = self.positive(&mut odds.size, value.unsigned_abs()).cast_signed();
        if negative { -size } else { size }
    }
}

/// Largest number of bits of the magnitude of a number with a sign, plus 1.
const SIZE_BITS: usize = 16;

/// The adaptive probabilities of numbers with a sign.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::packed) struct SignedBitModel {
    nonzero: BitModel,
    negative: BitModel,
    size: [BitModel; SIZE_BITS],
}

/// An encoder that writes bits.
#[derive(Debug)]
pub(in crate::packed) struct BitEncoder {
    bytes: Vec<u8>,
    low: u64,
    range: u32,
    /// Bytes that a carry may still change: one byte, followed by a number of bytes of 255.
    held: u8,
    waiting: usize,
    started: bool,
}

impl Default for BitEncoder {
    fn default() -> Self {
        Self { bytes: Vec::new(), low: 0, range: u32::MAX, held: 0, waiting: 0, started: false }
    }
}

impl BitEncoder {
    /// Moves byte 3 of `low` to the held bytes, and adds the carry above it to them.
    fn shift(&mut self) {
        let [_, _, _, byte, carry, ..] = self.low.to_le_bytes();
        if carry == 1 || self.low < 0xff00_0000 {
            if self.started {
                self.bytes.push(self.held.wrapping_add(carry));
            }
            self.bytes.extend(std::iter::repeat_n(0xff_u8.wrapping_add(carry), self.waiting));
            (self.held, self.waiting, self.started) = (byte, 0, true);
        } else {
            self.waiting += 1;
        }
        self.low = (self.low & 0x00ff_ffff) << 8;
    }

    /// Returns the bytes, without zeros at the end.
    pub(in crate::packed) fn finish(mut self) -> Vec<u8> {
        // The number within the final range that has the most zero bits at its end.
        let end = self.low + u64::from(self.range);
        let zeros =
            (0..32).rev().find(|&zeros| ((self.low + (1 << zeros) - 1) >> zeros << zeros) < end).unwrap_or(0);
        self.low = (self.low + (1 << zeros) - 1) >> zeros << zeros;
        (0..5).for_each(|_| self.shift());
        while self.bytes.last() == Some(&0) {
            self.bytes.pop();
        }
        self.bytes
    }
}

impl Bits for BitEncoder {
    fn split(&mut self, zero: u16, bit: bool) -> bool {
        let bound = (self.range >> PRECISION) * u32::from(zero);
        if bit {
            self.low += u64::from(bound);
            self.range -= bound;
        } else {
            self.range = bound;
        }
        while self.range < LEAST_RANGE {
            self.range <<= 8;
            self.shift();
        }
        bit
    }
}

/// A decoder of the bits of a [`BitEncoder`]. Beyond the end all bytes are zeros.
#[derive(Debug)]
pub(in crate::packed) struct BitDecoder<'a> {
    bytes: &'a [u8],
    next: usize,
    code: u32,
    range: u32,
}

impl<'a> BitDecoder<'a> {
    pub(in crate::packed) fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { bytes, next: 0, code: 0, range: u32::MAX };
        (0..4).for_each(|_| decoder.shift());
        decoder
    }

    fn shift(&mut self) {
        self.code = self.code << 8 | u32::from(self.bytes.get(self.next).copied().unwrap_or(0));
        self.next += 1;
    }
}

impl Bits for BitDecoder<'_> {
    fn split(&mut self, zero: u16, _: bool) -> bool {
        let bound = (self.range >> PRECISION) * u32::from(zero);
        let bit = self.code >= bound;
        if bit {
            self.code -= bound;
            self.range -= bound;
        } else {
            self.range = bound;
        }
        while self.range < LEAST_RANGE {
            self.range <<= 8;
            self.shift();
        }
        bit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    /// A function that codes a number in two ways: with a sign, and as a positive number.
    type Coder<'c> = dyn FnMut(&mut SignedBitModel, &mut [BitModel], i32) -> (i32, u32) + 'c;

    #[test]
    fn numbers_come_back() {
        let mut rng = SplitMix64::new(3);
        for count in [0, 1, 2, 7, 300, 5000] {
            let values: Vec<i32> =
                (0..count).map(|_| (rng.next() as i32 >> 17) >> (rng.next() % 15)).collect();
            let walk = |bits: &mut Coder<'_>| {
                let (mut odds, mut lengths) = (SignedBitModel::default(), [BitModel::default(); 15]);
                values.iter().map(|&v| bits(&mut odds, &mut lengths, v)).collect::<Vec<_>>()
            };
            let mut encoder = BitEncoder::default();
            let written = walk(&mut |odds, lengths, v| {
                (encoder.signed(odds, v), encoder.positive(lengths, v.unsigned_abs().clamp(1, 0x7fff)))
            });
            let bytes = encoder.finish();
            let mut decoder = BitDecoder::new(&bytes);
            let read = walk(&mut |odds, lengths, _| (decoder.signed(odds, 0), decoder.positive(lengths, 0)));
            assert_eq!(written, read);
            assert!(written.iter().zip(&values).all(|(w, v)| w.0 == *v));
            assert!(decoder.next <= bytes.len() + 4);
        }
    }

    #[test]
    fn runs_of_likely_bits_take_few_bytes() {
        let mut encoder = BitEncoder::default();
        let mut odds = BitModel::default();
        (0..4000).for_each(|k| {
            encoder.bit(&mut odds, k % 500 == 499);
        });
        assert!(encoder.finish().len() < 40);
    }
}
