//! Sparse codes in the layout that kernels read.
//!
//! For every group of [`COLUMN_GROUP`] Gaussians, `columns` holds the word of `nonzeros` at which the codes of the group
//! begin, and a byte for each Gaussian: its number of nonzeros, or [`ESCAPED`]. From that word on, `nonzeros` holds the
//! atom numbers of the group, of one or two bytes each, then its values, of two or four bytes each. Both are padded to
//! whole words. Neighbouring Gaussians therefore share cache lines, and offsets cost a quarter of a byte for each
//! Gaussian.

use std::ops::Range;

use lexisplat::{Indices, SparseCodes, Values};

use super::constants::{COLUMN_GROUP, ESCAPED};

/// The codes of a run of Gaussians.
#[derive(Debug, Default)]
pub(super) struct Columns {
    /// Offsets and counts of the groups.
    pub(super) columns: Vec<u32>,
    /// The numbers of the escaped Gaussians within the run.
    pub(super) escaped: Vec<u32>,
    pub(super) nonzeros: Vec<u32>,
}

/// Returns the range of the escapes that belong to Gaussians in `range`.
pub(super) fn escapes_in(codes: &SparseCodes, range: &Range<usize>) -> Range<usize> {
    let before = |end: usize| codes.escapes().gaussians.partition_point(|&g| (g as usize) < end);
    before(range.start)..before(range.end)
}

impl Columns {
    /// Lays out the codes of the Gaussians in `range`, which begin at nonzero `first`.
    pub(super) fn new(codes: &SparseCodes, range: Range<usize>, first: usize) -> Self {
        // Chunks have fewer than 2^32 Gaussians.
        let first_gaussian = u32::try_from(range.start).unwrap_or(u32::MAX);
        let escapes: Vec<u32> =
            codes.escapes().gaussians[escapes_in(codes, &range)].iter().map(|g| g - first_gaussian).collect();
        let mut out = Self::default();
        let group = COLUMN_GROUP as usize;
        let mut at = first;
        for (counts, start) in codes.counts()[range].chunks(group).zip((0_u32..).step_by(group)) {
            out.columns.push(u32::try_from(out.nonzeros.len()).unwrap_or(u32::MAX));
            let mut bytes = [0_u8; COLUMN_GROUP as usize];
            bytes[..counts.len()].copy_from_slice(counts);
            let first_escape = escapes.partition_point(|&g| g < start);
            for &g in escapes[first_escape..].iter().take_while(|&&g| g < start + COLUMN_GROUP) {
                #[expect(clippy::cast_possible_truncation, reason = "0x80")]
                let escaped = ESCAPED as u8;
                bytes[(g - start) as usize] = escaped;
            }
            out.columns.extend(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])));
            let total: usize = counts.iter().map(|&c| usize::from(c)).sum();
            match codes.indices() {
                Indices::U8(v) => pack(&mut out.nonzeros, v[at..at + total].iter().map(|v| v.to_le_bytes())),
                Indices::U16(v) => pack(&mut out.nonzeros, v[at..at + total].iter().map(|v| v.to_le_bytes())),
            }
            match codes.values() {
                Values::F16(v) => pack(&mut out.nonzeros, v[at..at + total].iter().map(|v| v.to_le_bytes())),
                Values::F32(v) => pack(&mut out.nonzeros, v[at..at + total].iter().map(|v| v.to_le_bytes())),
            }
            at += total;
        }
        out.escaped = escapes;
        out
    }
}

/// Appends elements to `words`, and pads the last word with zeros.
fn pack<const N: usize>(words: &mut Vec<u32>, elements: impl Iterator<Item = [u8; N]>) {
    let mut word = 0;
    let mut filled = 0;
    for element in elements {
        for byte in element {
            word |= u32::from(byte) << (8 * filled);
            filled += 1;
            if filled == 4 {
                words.push(word);
                (word, filled) = (0, 0);
            }
        }
    }
    if filled > 0 {
        words.push(word);
    }
}
