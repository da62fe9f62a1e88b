//! The layout of a part of a scene in memory: a header, then its arrays one after the other.
//!
//! The header has [`HEADER_WORDS`] little-endian words: [`MAGIC`], [`VERSION`], the kind of SH, the degree, the number of
//! Gaussians, the bytes of an atom number, the bytes of a value, the number of atoms of the dictionary, the number of
//! escapes and the number of words of nonzeros. The other words are 0. Each array begins at a multiple of [`ALIGNMENT`]
//! bytes.

use std::ops::Range;

use lexisplat::ShDegree;

use super::constants::{COLUMN_GROUP, COLUMN_WORDS, vectors};

/// First word of a part: `LXPT`.
const MAGIC: u32 = u32::from_le_bytes(*b"LXPT");
/// Second word of a part. A program reads only the version that it writes.
const VERSION: u32 = 1;
/// Number of words of the header.
pub(super) const HEADER_WORDS: usize = 16;
/// Alignment of arrays, in bytes: the size of the largest element.
const ALIGNMENT: u64 = 16;
/// Number of arrays of a part.
const SECTIONS: usize = 7;

/// The layout of SH. It is the same in all parts of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ShLayout {
    pub(super) degree: ShDegree,
    pub(super) kind: ShKind,
}

/// The kind of SH: dense rows or sparse codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ShKind {
    /// Every coefficient, in 32 or 16 bits.
    Dense { half: bool },
    /// Sparse codes. `index` and `value` are the bytes of an atom number and of a value.
    Codes { index: u32, value: u32, atoms: u32 },
}

/// The arrays of a part, in order.
#[derive(Debug, Clone, Copy)]
pub(super) enum Section {
    /// Positions and largest standard deviations: four floats for each Gaussian.
    Bodies,
    /// Log scales, opacity logits and quaternions: eight floats for each Gaussian.
    Shapes,
    /// Dense rows; or base colours, of three floats each.
    Colours,
    /// Offsets and counts of codes, as described in [`super::columns`].
    Columns,
    /// Numbers of the escaped Gaussians within the part.
    Escaped,
    /// Atom numbers and values.
    Nonzeros,
    /// Exact rows of the escaped Gaussians. Coefficients are in order, with the three channels of a coefficient side by
    /// side.
    Exact,
}

/// The contents of the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Outline {
    pub(super) layout: ShLayout,
    /// Number of Gaussians.
    pub(super) len: u32,
    /// Number of escaped Gaussians.
    pub(super) escapes: u32,
    /// Number of words of nonzeros.
    pub(super) words: u32,
}

impl ShLayout {
    /// Returns the layout as words: kind, degree, bytes of an atom number, bytes of a value, number of atoms.
    pub(super) fn to_words(self) -> [u32; 5] {
        let degree = u32::from(self.degree.get());
        match self.kind {
            ShKind::Dense { half } => [u32::from(half), degree, 0, 0, 0],
            ShKind::Codes { index, value, atoms } => [2, degree, index, value, atoms],
        }
    }

    /// Returns the layout from the words of [`Self::to_words`]. The error tells what is wrong with other words.
    pub(super) fn from_words([kind, degree, index, value, atoms]: [u32; 5]) -> Result<Self, String> {
        let known = u8::try_from(degree).ok().and_then(|degree| ShDegree::new(degree).ok());
        let degree = known.ok_or_else(|| format!("SH degree {degree}"))?;
        let kind = match (kind, [index, value, atoms]) {
            (0 | 1, [0, 0, 0]) => ShKind::Dense { half: kind == 1 },
            (2, [1 | 2, 2 | 4, _]) => ShKind::Codes { index, value, atoms },
            _ => return Err(format!("SH of kind {kind} with widths {index} and {value}")),
        };
        Ok(Self { degree, kind })
    }

    /// Returns the number of bytes of the dense row of a Gaussian, or of its base colour.
    pub(super) fn colour_bytes(self) -> u64 {
        match self.kind {
            ShKind::Dense { half } => {
                let vector = if half { 8 } else { 16 };
                vectors(self.degree.coefficients()) as u64 * vector
            }
            ShKind::Codes { .. } => 12,
        }
    }

    /// Returns the number of bytes of an exact row.
    pub(super) fn exact_bytes(self) -> u64 {
        4 * self.degree.rest() as u64
    }
}

impl Outline {
    /// Returns the number of bytes of each array.
    fn sizes(&self) -> [u64; SECTIONS] {
        let [n, escapes, words] = [self.len, self.escapes, self.words].map(u64::from);
        let groups = match self.layout.kind {
            ShKind::Dense { .. } => 0,
            ShKind::Codes { .. } => n.div_ceil(COLUMN_GROUP.into()),
        };
        let columns = 4 * u64::from(COLUMN_WORDS) * groups;
        let exact = escapes * self.layout.exact_bytes();
        [16 * n, 32 * n, self.layout.colour_bytes() * n, columns, 4 * escapes, 4 * words, exact]
    }

    /// Returns the number of bytes of the header and all arrays.
    pub(super) fn bytes(&self) -> u64 {
        let arrays: u64 = self.sizes().iter().map(|size| size.next_multiple_of(ALIGNMENT)).sum();
        4 * HEADER_WORDS as u64 + arrays
    }

    /// Returns the offset of an array, in bytes. [`Self::bytes`] must fit in memory.
    pub(super) fn section(&self, section: Section) -> Range<usize> {
        let sizes = self.sizes();
        let before = sizes[..section as usize].iter().map(|size| size.next_multiple_of(ALIGNMENT));
        let start = 4 * HEADER_WORDS as u64 + before.sum::<u64>();
        let in_memory = |at: u64| usize::try_from(at).unwrap_or(usize::MAX);
        in_memory(start)..in_memory(start + sizes[section as usize])
    }

    /// Returns the header.
    pub(super) fn to_words(self) -> [u32; HEADER_WORDS] {
        let [kind, degree, index, value, atoms] = self.layout.to_words();
        let mut words = [0; HEADER_WORDS];
        let used = [MAGIC, VERSION, kind, degree, self.len, index, value, atoms, self.escapes, self.words];
        words[..used.len()].copy_from_slice(&used);
        words
    }

    /// Reads a header. The error tells what is wrong with it.
    pub(super) fn from_words(words: [u32; HEADER_WORDS]) -> Result<Self, String> {
        let [magic, version, kind, degree, len, index, value, atoms, escapes, nonzeros, rest @ ..] = words;
        if magic != MAGIC || version != VERSION {
            return Err(format!("magic {magic:#x}, version {version}"));
        }
        let layout = ShLayout::from_words([kind, degree, index, value, atoms])?;
        let dense = matches!(layout.kind, ShKind::Dense { .. });
        if rest != [0; 6] || (dense && (escapes, nonzeros) != (0, 0)) || escapes > len || len == u32::MAX {
            return Err(format!("{len} Gaussians, {escapes} escapes, {nonzeros} words of nonzeros"));
        }
        Ok(Self { layout, len, escapes, words: nonzeros })
    }
}
