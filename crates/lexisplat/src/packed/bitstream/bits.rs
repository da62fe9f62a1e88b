//! Writing and reading of bits.

/// A writer that collects bits in bytes, least significant bit first.
#[derive(Debug, Default, Clone)]
pub(in crate::packed) struct BitWriter {
    bytes: Vec<u8>,
    held: u128,
    count: u32,
}

impl BitWriter {
    /// Appends the low `count` bits of `value`; `count` is at most 64.
    pub(in crate::packed) fn put(&mut self, count: u32, value: u64) {
        self.held |= u128::from(value) << self.count;
        self.count += count;
        while self.count >= 8 {
            self.bytes.push(self.held.to_le_bytes()[0]);
            self.held >>= 8;
            self.count -= 8;
        }
    }

    /// Returns the bytes. The last one is filled up with zeros.
    pub(in crate::packed) fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.held.to_le_bytes()[0]);
        }
        self.bytes
    }
}

/// A reader of the bits of a [`BitWriter`]. Bits beyond the end are 0; a reader that took one is not [`Self::exhausted`].
#[derive(Debug, Clone)]
pub(in crate::packed) struct BitReader<'a> {
    bytes: &'a [u8],
    /// Index of the next byte to take.
    at: usize,
    held: u64,
    count: u32,
    /// Whether bits beyond the end were taken.
    missing: bool,
}

impl<'a> BitReader<'a> {
    pub(in crate::packed) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, held: 0, count: 0, missing: false }
    }

    /// Returns the next `count` bits, at most 64.
    #[inline]
    pub(in crate::packed) fn take(&mut self, count: u32) -> u64 {
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

    /// Returns whether all bits were taken, except less than a byte of zeros, and none beyond the end.
    pub(in crate::packed) fn exhausted(&self) -> bool {
        !self.missing && self.at == self.bytes.len() && self.held == 0
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn bits_come_back(values in prop::collection::vec((any::<u64>(), 0_u32..=64), 0..200)) {
            let low = |value: u64, count: u32| value & 1_u64.checked_shl(count).map_or(u64::MAX, |bit| bit - 1);
            let mut writer = BitWriter::default();
            values.iter().for_each(|&(value, count)| writer.put(count, low(value, count)));
            let bytes = writer.finish();
            prop_assert_eq!(bytes.len(), values.iter().map(|v| v.1 as usize).sum::<usize>().div_ceil(8));
            let mut reader = BitReader::new(&bytes);
            for (value, count) in values {
                prop_assert_eq!(reader.take(count), low(value, count));
            }
            prop_assert!(reader.exhausted());
            reader.take(9);
            prop_assert!(!reader.exhausted());
        }
    }
}
