//! CRC-32 of 16 bytes at a time, by tables that are made when the first bytes are summed. The module has the functions of
//! crc32fast that are used.

use std::sync::OnceLock;

/// The polynomial of CRC-32 (IEEE 802.3) without its highest power, the lowest power in the highest bit.
const POLYNOMIAL: u32 = 0xedb8_8320;
/// Powers 0 and 8 of x, in the same order of bits.
const ONE: u32 = 1 << 31;
const BYTE: u32 = 1 << 23;
/// Number of bytes that are looked up together.
const SLICE: usize = 16;

/// For each value of a byte, the remainder of the byte followed by 0 to 15 bytes of zeros.
type Tables = [[u32; 256]; SLICE];

static TABLES: OnceLock<Box<Tables>> = OnceLock::new();

fn tables() -> Box<Tables> {
    let mut tables = Box::new([[0; 256]; SLICE]);
    for (byte, first) in (0..).zip(&mut tables[0]) {
        *first = (0..8).fold(byte, |x, _| times_x(x));
    }
    let [first, ..] = *tables;
    for k in 1..SLICE {
        for byte in 0..256 {
            let before = tables[k - 1][byte];
            tables[k][byte] = before >> 8 ^ first[(before & 0xff) as usize];
        }
    }
    tables
}

/// Returns the product of `a` and x.
fn times_x(a: u32) -> u32 {
    a >> 1 ^ if a & 1 == 1 { POLYNOMIAL } else { 0 }
}

/// Returns the product of the polynomials `a` and `b`.
fn product(a: u32, mut b: u32) -> u32 {
    let mut sum = 0;
    for power in (0..u32::BITS).rev() {
        if a >> power & 1 == 1 {
            sum ^= b;
        }
        b = times_x(b);
    }
    sum
}

/// Returns the CRC-32 of `bytes`.
pub(crate) fn hash(bytes: &[u8]) -> u32 {
    let mut hasher = Hasher::default();
    hasher.update(bytes);
    hasher.finalize()
}

/// The CRC-32 of bytes that come piece by piece.
#[derive(Debug, Clone, Default)]
pub(crate) struct Hasher {
    sum: u32,
    bytes: u64,
}

impl Hasher {
    pub(crate) fn new() -> Self {
        Self::default()
    }

    /// Continues after bytes whose CRC-32 is `sum`.
    pub(crate) fn new_with_initial(sum: u32) -> Self {
        Self { sum, bytes: 0 }
    }

    /// Continues after `bytes` bytes whose CRC-32 is `sum`.
    pub(crate) fn new_with_initial_len(sum: u32, bytes: u64) -> Self {
        Self { sum, bytes }
    }

    #[inline(never)]
    pub(crate) fn update(&mut self, bytes: &[u8]) {
        let tables = TABLES.get_or_init(tables);
        let (slices, rest) = bytes.as_chunks::<SLICE>();
        let mut sum = !self.sum;
        for slice in slices {
            let mut next = 0;
            for (k, &byte) in slice.iter().enumerate() {
                let of_sum = if k < 4 { sum.to_le_bytes()[k] } else { 0 };
                next ^= tables[SLICE - 1 - k][usize::from(byte ^ of_sum)];
            }
            sum = next;
        }
        for &byte in rest {
            let [low, ..] = sum.to_le_bytes();
            sum = sum >> 8 ^ tables[0][usize::from(byte ^ low)];
        }
        self.sum = !sum;
        self.bytes = self.bytes.wrapping_add(bytes.len() as u64);
    }

    /// Continues with the bytes of `other`, as if they had been added here.
    pub(crate) fn combine(&mut self, other: &Self) {
        let (mut shift, mut power, mut left) = (ONE, BYTE, other.bytes);
        while left > 0 {
            if left & 1 == 1 {
                shift = product(shift, power);
            }
            power = product(power, power);
            left >>= 1;
        }
        self.sum = product(shift, self.sum) ^ other.sum;
        self.bytes = self.bytes.wrapping_add(other.bytes);
    }

    pub(crate) fn finalize(self) -> u32 {
        self.sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    #[test]
    fn sums_are_those_of_crc32fast() {
        // The check value of CRC-32.
        assert_eq!(hash(b"123456789"), 0xcbf4_3926);
        let mut rng = SplitMix64::new(4);
        let bytes: Vec<u8> = (0..5000).map(|_| rng.next().to_le_bytes()[0]).collect();
        for length in (0..70).chain([1000, 4999, 5000]) {
            assert_eq!(hash(&bytes[..length]), crc32fast::hash(&bytes[..length]), "{length}");
        }
        for _ in 0..100 {
            let (a, b) = bytes.split_at(rng.below(bytes.len()));
            let (mut one, mut other) = (Hasher::new(), Hasher::new());
            a.chunks(rng.below(40) + 1).for_each(|piece| one.update(piece));
            other.update(b);
            let mut on = Hasher::new_with_initial_len(one.clone().finalize(), a.len() as u64);
            on.update(b);
            one.combine(&other);
            let mut from = Hasher::new_with_initial(hash(a));
            from.update(b);
            let whole = crc32fast::hash(&bytes);
            assert_eq!([one.finalize(), on.finalize(), from.finalize()], [whole; 3]);
        }
    }
}
