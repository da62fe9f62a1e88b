//! Bits with adaptive probabilities, for data that a file has once: the integers of its head, tables and
//! dictionary.
//!
//! They are coded by rANS, as the symbols of a lane are ([`crate::packed::entropy::rans_decoder`]), with tables of two
//! symbols that change after every bit. All products are below 2^32.

use crate::packed::bitstream::broken::{BrokenHead, must};
use crate::packed::entropy::rans_state::{Interval, LEAST as LEAST_STATE, Stack};

/// Number of bits of a probability.
const PRECISION: u32 = 12;
/// Smallest probability of either bit, in units of 2^-12.
const LEAST: u16 = 48;
/// Shifts of the distance from certainty: after each of the first bits, and after all later bits.
const RATES: [u32; 6] = [1, 2, 3, 4, 4, 5];
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

    fn bit(&mut self, model: &mut BitModel, bit: bool) -> bool {
        let bit = self.split(model.zero(), bit);
        model.learn(bit);
        bit
    }

    /// Codes `count` bits of `value`, highest first. Both values of a bit have the same probability.
    fn even(&mut self, count: u32, value: u32) -> u32 {
        (0..count).rev().fold(0, |all, k| all << 1 | u32::from(self.split(HALF, value >> k & 1 == 1)))
    }

    /// Codes a number from 1 to less than `2^models.len()`. Its length in bits is coded in unary with adaptive probabilities.
    /// The bits after the leading one follow with even probabilities.
    fn positive(&mut self, models: &mut [BitModel], value: u32) -> u32 {
        let wanted = u32::BITS - value.max(1).leading_zeros();
        let mut length = 1;
        for model in models.iter_mut().skip(1) {
            if !self.bit(model, length < wanted) {
                break;
            }
            length += 1;
        }
        1 << (length - 1) | self.even(length - 1, value & !(1 << (length - 1)))
    }

    /// Codes a number with a sign.
    fn signed(&mut self, model: &mut SignedBitModel, value: i32) -> i32 {
        if !self.bit(&mut model.nonzero, value != 0) {
            return 0;
        }
        let negative = self.bit(&mut model.negative, value < 0);
        let size = self.positive(&mut model.size, value.unsigned_abs()).cast_signed();
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
#[derive(Debug, Default)]
pub(in crate::packed) struct BitEncoder {
    /// The probability of 0, and the bit. rANS codes the last bit first, so they wait for the end.
    steps: Vec<(u16, bool)>,
}

impl BitEncoder {
    /// Returns the bytes: words of 16 bits, the first two of which are the state that a decoder starts with.
    pub(in crate::packed) fn finish(self) -> Vec<u8> {
        let mut stack = Stack::new();
        self.steps.iter().rev().for_each(|&(zero, bit)| stack.symbol(interval(zero, bit), PRECISION));
        stack.finish().iter().flat_map(|word| word.to_le_bytes()).collect()
    }
}

/// Returns the interval of the low bits of a state that stands for `bit` where 0 has the probability `zero`.
fn interval(zero: u16, bit: bool) -> Interval {
    let zero = u32::from(zero);
    match bit {
        false => Interval { start: 0, share: zero },
        true => Interval { start: zero, share: (1 << PRECISION) - zero },
    }
}

impl Bits for BitEncoder {
    fn split(&mut self, zero: u16, bit: bool) -> bool {
        self.steps.push((zero, bit));
        bit
    }
}

/// A decoder of the bits of a [`BitEncoder`]. Words beyond the end are zeros.
#[derive(Debug)]
pub(in crate::packed) struct BitDecoder<'a> {
    words: std::slice::Iter<'a, [u8; 2]>,
    state: u32,
    /// The first rule that the bytes break.
    broken: Option<&'static str>,
}

impl<'a> BitDecoder<'a> {
    pub(in crate::packed) fn new(bytes: &'a [u8]) -> Self {
        let (words, rest) = bytes.as_chunks();
        let mut decoder = Self { words: words.iter(), state: 0, broken: None };
        let [high, low] = [decoder.word(), decoder.word()];
        decoder.state = high << 16 | low;
        if !rest.is_empty() {
            decoder.broken = Some("half a word is at the end");
        } else if decoder.state < LEAST_STATE {
            decoder.broken.get_or_insert("the first state is below 2^16");
        }
        decoder
    }

    fn word(&mut self) -> u32 {
        let Some(&word) = self.words.next() else {
            self.broken.get_or_insert("the words end too early");
            return 0;
        };
        u16::from_le_bytes(word).into()
    }

    /// Returns a broken rule of the block `name` of the head unless an encoder may have written the bytes, and wrote no more
    /// bits than were taken.
    pub(in crate::packed) fn finish(&self, name: &str) -> Result<(), BrokenHead> {
        if let Some(broken) = self.broken {
            return Err(BrokenHead(format!("{name}: {broken}")));
        }
        must(self.words.len() == 0, || format!("{name}: {} words are left", self.words.len()))?;
        must(self.state == LEAST_STATE, || format!("{name}: the last state is {}, not 2^16", self.state))
    }
}

impl Bits for BitDecoder<'_> {
    fn split(&mut self, zero: u16, _: bool) -> bool {
        let low = self.state & ((1 << PRECISION) - 1);
        let bit = low >= u32::from(zero);
        let Interval { start, share } = interval(zero, bit);
        self.state = (self.state >> PRECISION) * share + low - start;
        if self.state < LEAST_STATE {
            self.state = self.state << 16 | self.word();
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
                let (mut model, mut lengths) = (SignedBitModel::default(), [BitModel::default(); 15]);
                values.iter().map(|&v| bits(&mut model, &mut lengths, v)).collect::<Vec<_>>()
            };
            let mut encoder = BitEncoder::default();
            let written = walk(&mut |model, lengths, v| {
                (encoder.signed(model, v), encoder.positive(lengths, v.unsigned_abs().clamp(1, 0x7fff)))
            });
            let bytes = encoder.finish();
            let mut decoder = BitDecoder::new(&bytes);
            let read =
                walk(&mut |model, lengths, _| (decoder.signed(model, 0), decoder.positive(lengths, 0)));
            assert_eq!(written, read);
            assert!(written.iter().zip(&values).all(|(w, v)| w.0 == *v));
            assert_eq!(decoder.finish("bits"), Ok(()));
            assert!(count == 0 || BitDecoder::new(&bytes).finish("bits").is_err());
        }
    }

    #[test]
    fn runs_of_likely_bits_take_few_bytes() {
        let mut encoder = BitEncoder::default();
        let mut model = BitModel::default();
        (0..4000).for_each(|k| {
            encoder.bit(&mut model, k % 500 == 499);
        });
        assert!(encoder.finish().len() < 40);
    }
}
