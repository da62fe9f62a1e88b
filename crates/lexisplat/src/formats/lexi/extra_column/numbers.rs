//! Lists of whole numbers of 1, 2, 4 or 8 bytes in deflate streams, filtered so that deflate finds repetitions.

use super::deflate;

/// The way in which a list of numbers lies in its streams.
///
/// Each filter took fewest bytes on some columns: plain bytes on indices in palettes that repeat, planes on noise,
/// differences on smooth values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Filter {
    /// One stream, in which the bytes of each number follow the bytes of the number before.
    Plain = 1,
    /// A stream of the lowest bytes of all numbers, then a stream of their second bytes, and so on.
    Planes = 2,
    /// Planes of the differences from the number before. Differences are numbered by magnitude: 0, -1, 1, -2, ...
    Differences = 3,
}

impl Filter {
    const ALL: [Self; 3] = [Self::Plain, Self::Planes, Self::Differences];
}

/// Appends the filter and the streams of `numbers`, each of `width` bytes. The filter is the one with fewest bytes.
pub(super) fn put(numbers: &[u64], width: usize, out: &mut Vec<u8>) {
    // For numbers of one byte, plain bytes are the same as the one plane. For numbers of more than 2 bytes, which no index
    // in a palette has, plain bytes never took fewest bytes.
    let tries = Filter::ALL.iter().filter(|&&filter| width == 2 || filter != Filter::Plain);
    let best = tries.map(|&filter| put_with(filter, numbers, width)).min_by_key(Vec::len);
    out.extend(best.unwrap_or_default());
}

/// Takes the `count` numbers of `width` bytes that [`put`] appended from the front of `from`; `None` for all other bytes.
pub(super) fn take(from: &mut &[u8], count: usize, width: usize) -> Option<Vec<u64>> {
    let (&filter, rest) = from.split_first()?;
    *from = rest;
    take_with(Filter::ALL.into_iter().find(|&f| f as u8 == filter)?, from, count, width)
}

fn put_with(filter: Filter, numbers: &[u64], width: usize) -> Vec<u8> {
    let mut out = vec![filter as u8];
    let number_bytes = |n: &u64| n.to_le_bytes().into_iter().take(width);
    match filter {
        Filter::Plain => deflate::put(&numbers.iter().flat_map(number_bytes).collect::<Vec<_>>(), &mut out),
        Filter::Planes => put_planes(numbers, width, &mut out),
        Filter::Differences => {
            let before = std::iter::once(&0).chain(numbers);
            let differences = numbers.iter().zip(before).map(|(n, b)| zigzag(n.wrapping_sub(*b), width));
            put_planes(&differences.collect::<Vec<_>>(), width, &mut out);
        }
    }
    out
}

fn put_planes(numbers: &[u64], width: usize, out: &mut Vec<u8>) {
    for k in 0..width {
        let plane: Vec<u8> = numbers.iter().map(|n| n.to_le_bytes()[k]).collect();
        deflate::put(&plane, out);
    }
}

fn take_with(filter: Filter, from: &mut &[u8], count: usize, width: usize) -> Option<Vec<u64>> {
    let mut numbers = vec![0; count];
    if filter == Filter::Plain {
        let mut bytes = vec![0; count * width];
        deflate::take(from, &mut bytes)?;
        for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(width)) {
            *number = from_bytes(bytes);
        }
        return Some(numbers);
    }
    let mut plane = vec![0; count];
    for k in 0..width {
        deflate::take(from, &mut plane)?;
        for (number, &byte) in numbers.iter_mut().zip(&plane) {
            *number |= u64::from(byte) << (8 * k);
        }
    }
    if filter == Filter::Differences {
        let mut before = 0_u64;
        for number in &mut numbers {
            before = before.wrapping_add(unzigzag(*number)) & mask(width);
            *number = before;
        }
    }
    Some(numbers)
}

/// Returns the number in at most 8 little-endian bytes.
pub(super) fn from_bytes(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, &byte| (number << 8) | u64::from(byte))
}

fn mask(width: usize) -> u64 {
    u64::MAX >> spare_bits(width)
}

/// Returns the number of bits of a u64 that a number of `width` bytes does not need.
fn spare_bits(width: usize) -> usize {
    8 * (size_of::<u64>() - width)
}

/// Returns the low `width` bytes of `difference`, a signed number, as an unsigned number by magnitude.
fn zigzag(difference: u64, width: usize) -> u64 {
    let spare = spare_bits(width);
    let signed = (difference << spare).cast_signed() >> spare;
    ((signed << 1) ^ (signed >> 63)).cast_unsigned()
}

/// Returns the inverse of [`zigzag`] in the low bytes of the result.
fn unzigzag(number: u64) -> u64 {
    (number >> 1) ^ (number & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers_come_back_with_every_filter(
            numbers in prop::collection::vec(any::<u64>(), 1..200),
            shift in 0..64,
            width in prop::sample::select(vec![1_usize, 2, 4, 8]),
        ) {
            let numbers: Vec<u64> = numbers.iter().map(|n| (n >> shift) & mask(width)).collect();
            for filter in Filter::ALL {
                let bytes = put_with(filter, &numbers, width);
                let mut rest = bytes.as_slice();
                prop_assert_eq!(take(&mut rest, numbers.len(), width), Some(numbers.clone()));
                prop_assert!(rest.is_empty());
            }
        }
    }

    #[test]
    fn differences_go_by_magnitude_and_wrap() {
        for (difference, expected) in [(0, 0), (-1, 1), (1, 2), (-2, 3), (127, 254), (-128, 255)] {
            for width in [1, 2, 4, 8] {
                let difference = i64::from(difference).cast_unsigned();
                assert_eq!(zigzag(difference, width), expected);
                assert_eq!(unzigzag(expected) & mask(width), difference & mask(width));
            }
        }
        assert_eq!(zigzag(200, 1), zigzag((-56_i64).cast_unsigned(), 1));
    }
}
