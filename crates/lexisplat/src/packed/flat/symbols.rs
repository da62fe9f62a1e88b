//! The decoder of a chunk's symbols and raw bits.

use super::streams::Stream;
use super::tables::{CONTEXTS, SymbolReader, Tables};
use crate::packed::bits::BitReader;
use crate::packed::stream::BitCounts;

/// Integers below this are their own token.
const DIRECT: u64 = 16;
/// Length of the last direct integers in bits.
const DIRECT_BITS: u32 = 4;

/// Number of low bits that belong to `token`. At most 62.
pub(super) fn extra_bits(token: u16) -> u32 {
    match u32::from(token).checked_sub(16) {
        None => 0,
        Some(k) => (k / 2 + DIRECT_BITS - 1).min(62),
    }
}

/// The integer of `token` and its low bits.
pub(super) fn join(token: u16, extra: u64) -> u64 {
    let token = u64::from(token);
    if token < DIRECT {
        return token;
    }
    let shift = extra_bits(u16::try_from(token).unwrap_or(u16::MAX));
    ((2 + ((token - DIRECT) & 1)) << shift) | extra
}

/// The signed integer of an unsigned one: 0, -1, 1, -2, ...
pub(super) fn unzigzag(value: u64) -> i64 {
    (value >> 1).cast_signed() ^ -(value & 1).cast_signed()
}

/// The decoder of a chunk.
#[derive(Debug)]
pub(in crate::packed) struct SymbolDecoder<'a> {
    tables: &'a Tables,
    symbols: SymbolReader,
    raw: BitReader<'a>,
    /// Bits of each stream, if they are counted.
    pub(in crate::packed) bit_counts: Option<BitCounts>,
    missing: bool,
}

impl<'a> SymbolDecoder<'a> {
    /// `None` if the parts cannot be those of a chunk.
    pub(in crate::packed) fn new(tables: &'a Tables, symbols: &[u8], raw: &'a [u8]) -> Option<Self> {
        let symbols = SymbolReader::new(symbols)?;
        Some(Self { tables, symbols, raw: BitReader::new(raw), bit_counts: None, missing: false })
    }

    /// Whether bits beyond the end were read.
    pub(in crate::packed) fn overrun(&self) -> bool {
        self.raw.overrun() || self.missing
    }

    /// Whether both parts were read to their end, and not beyond.
    pub(in crate::packed) fn exhausted(&self) -> bool {
        self.symbols.exhausted() && self.raw.exhausted() && !self.missing
    }

    /// The next symbol of a context below [`CONTEXTS`].
    #[inline]
    fn take(&mut self, stream: Stream, context: usize) -> u16 {
        let Some(table) = self.tables.table(stream as usize, context.min(CONTEXTS - 1)) else {
            self.missing = true;
            return 0;
        };
        let symbol = self.symbols.take(table);
        if let Some(bit_counts) = &mut self.bit_counts {
            bit_counts.0[stream as usize] += table.bits(symbol);
        }
        symbol
    }

    /// The next integer. Its token is modelled in `context`; low bits of large ones are not.
    #[inline]
    pub(in crate::packed) fn integer(&mut self, stream: Stream, context: usize) -> u64 {
        let token = self.take(stream, context);
        let count = extra_bits(token);
        let extra = if count == 0 { 0 } else { self.bits(stream, count) };
        join(token, extra)
    }

    /// The next symbol that is modelled whole.
    #[inline]
    pub(in crate::packed) fn symbol(&mut self, stream: Stream, context: usize) -> u16 {
        self.take(stream, context)
    }

    /// The next `count` bits, at most 64, that are not modelled.
    #[inline]
    pub(in crate::packed) fn bits(&mut self, stream: Stream, count: u32) -> u64 {
        if let Some(bit_counts) = &mut self.bit_counts {
            bit_counts.0[stream as usize] += f64::from(count);
        }
        self.raw.take(count)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// A token is the bit length and the bit after the leading one, and the other bits follow.
        #[test]
        fn integers_of_tokens_and_low_bits(value in any::<u64>(), shift in 0_u32..64) {
            let value = value >> shift;
            let (token, low) = match u64::BITS - value.leading_zeros() {
                0..=DIRECT_BITS => (value, 0),
                length => {
                    let token = DIRECT + 2 * u64::from(length - DIRECT_BITS - 1) + (value >> (length - 2) & 1);
                    (token, value & ((1 << (length - 2)) - 1))
                }
            };
            let token = u16::try_from(token).unwrap();
            prop_assert!(low >> extra_bits(token) == 0);
            prop_assert_eq!(join(token, low), value);
        }
    }

    #[test]
    fn signs_alternate() {
        assert_eq!([0, 1, 2, 3, 4].map(unzigzag), [0, -1, 1, -2, 2]);
        assert_eq!((unzigzag(u64::MAX), unzigzag(u64::MAX - 1)), (i64::MIN, i64::MAX));
    }
}
