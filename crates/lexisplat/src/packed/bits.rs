//! Writing and reading bits, and splitting integers into a token that is modelled and low bits that are not.

/// Integers below this are their own token.
const DIRECT: u64 = 16;
/// Bits of [`DIRECT`] minus one: the length of the last direct integers.
const DIRECT_BITS: u32 = 4;

/// Splits `value` into a token, and the number and value of its low bits.
///
/// From 16 on the token holds the bit length and the bit after the leading one.
pub(super) fn split(value: u64) -> (u16, u32, u64) {
    if value < DIRECT {
        #[expect(clippy::cast_possible_truncation, reason = "below 16")]
        return (value as u16, 0, 0);
    }
    let length = u64::BITS - value.leading_zeros();
    let extra = length - 2;
    let second = (value >> extra) & 1;
    #[expect(clippy::cast_possible_truncation, reason = "at most 135")]
    let token = (DIRECT + 2 * u64::from(length - DIRECT_BITS - 1) + second) as u16;
    (token, extra, value & ((1 << extra) - 1))
}

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

/// Maps signed integers to unsigned ones by magnitude: 0, -1, 1, -2, ...
pub(super) fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)).cast_unsigned()
}

/// Inverse of [`zigzag`].
pub(super) fn unzigzag(value: u64) -> i64 {
    (value >> 1).cast_signed() ^ -(value & 1).cast_signed()
}

/// Collects bits, least significant first.
#[derive(Debug, Default, Clone)]
pub(super) struct BitWriter {
    bytes: Vec<u8>,
    held: u128,
    count: u32,
}

impl BitWriter {
    /// Appends the low `count` bits of `value`; `count` is at most 64.
    pub(super) fn put(&mut self, count: u32, value: u64) {
        self.held |= u128::from(value) << self.count;
        self.count += count;
        while self.count >= 8 {
            self.bytes.push(self.held.to_le_bytes()[0]);
            self.held >>= 8;
            self.count -= 8;
        }
    }

    /// Returns the bytes. The last one is filled up with zeros.
    pub(super) fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.held.to_le_bytes()[0]);
        }
        self.bytes
    }
}

/// Reads what a [`BitWriter`] wrote. Bits beyond the end are 0, and [`Self::overrun`] reports them.
#[derive(Debug, Clone)]
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    /// Next byte to take.
    at: usize,
    held: u64,
    count: u32,
    missing: bool,
}

impl<'a> BitReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, held: 0, count: 0, missing: false }
    }

    /// The next `count` bits, at most 64.
    #[inline]
    pub(super) fn take(&mut self, count: u32) -> u64 {
        if count > 32 {
            let low = self.take(32);
            return low | (self.take(count - 32) << 32);
        }
        while self.count < count {
            let byte = self.bytes.get(self.at).copied();
            self.missing |= byte.is_none();
            self.held |= u64::from(byte.unwrap_or(0)) << self.count;
            self.count += 8;
            self.at += 1;
        }
        let value = self.held & ((1 << count) - 1);
        self.held >>= count;
        self.count -= count;
        value
    }

    /// Whether bits beyond the end were taken.
    pub(super) fn overrun(&self) -> bool {
        self.missing
    }

    /// Whether all bits were taken, except less than a byte of zeros.
    pub(super) fn exhausted(&self) -> bool {
        !self.missing && self.at == self.bytes.len() && self.held == 0
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Tokens there are: 16 direct ones and two for each length from 5 to 64 bits.
    const TOKENS: usize = 16 + 2 * 60;

    proptest! {
        #[test]
        fn integers_come_back(values in prop::collection::vec((any::<u64>(), 0_u32..64), 0..200)) {
            let values: Vec<u64> = values.into_iter().map(|(v, shift)| v >> shift).collect();
            let mut writer = BitWriter::default();
            let mut tokens = Vec::new();
            for &value in &values {
                let (token, count, extra) = split(value);
                prop_assert!(usize::from(token) < TOKENS && count == extra_bits(token));
                writer.put(count, extra);
                tokens.push(token);
                prop_assert_eq!(zigzag(unzigzag(value)), value);
            }
            let bytes = writer.finish();
            let mut reader = BitReader::new(&bytes);
            for (&value, &token) in values.iter().zip(&tokens) {
                let extra = reader.take(extra_bits(token));
                prop_assert_eq!(join(token, extra), value);
            }
            prop_assert!(reader.exhausted());
            reader.take(9);
            prop_assert!(reader.overrun());
        }
    }
}
