//! How a part of a scene lies in memory: a header, then its arrays one after the other.
//!
//! The header has [`HEADER_WORDS`] little-endian words: [`MAGIC`], [`VERSION`], the kind of SH, the degree, the
//! number of Gaussians, the bytes of an atom number and of a value, the atoms of the dictionary, the escapes and the
//! words of nonzeros; the rest is 0. Each array begins at a multiple of [`ALIGNMENT`] bytes.

use std::ops::Range;

use lexisplat::ShDegree;

use super::constants::{COLUMN_GROUP, COLUMN_WORDS, vectors};

/// The first word of a part: `LXPT`.
const MAGIC: u32 = u32::from_le_bytes(*b"LXPT");
/// The second. A program reads only the layout that it writes.
const VERSION: u32 = 1;
/// Words of the header.
pub(super) const HEADER_WORDS: usize = 16;
/// Arrays begin at multiples of this many bytes, those of the largest element.
const ALIGNMENT: u64 = 16;
/// Arrays of a part.
const SECTIONS: usize = 7;

/// How SH is laid out. It is the same in all parts of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ShLayout {
    pub(super) degree: ShDegree,
    pub(super) kind: ShKind,
}

/// Rows or codes.
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
    /// Positions and largest standard deviations: four floats.
    Bodies,
    /// Log scales, opacity logits, quaternions: eight floats.
    Shapes,
    /// Dense rows; or base colours, of three floats.
    Colours,
    /// Places and counts of codes: see [`super::columns`].
    Columns,
    /// The numbers of the escaped Gaussians within the part.
    Escaped,
    /// Atom numbers and values.
    Nonzeros,
    /// The exact rows of the escaped Gaussians: coefficients in order, with the three channels side by side.
    Exact,
}

/// What the header tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Outline {
    pub(super) layout: ShLayout,
    /// Number of Gaussians.
    pub(super) len: u32,
    /// Number of escaped ones.
    pub(super) escapes: u32,
    /// Words of nonzeros.
    pub(super) words: u32,
}

impl ShLayout {
    /// The layout as words: kind, degree, bytes of an atom number, bytes of a value, atoms.
    pub(super) fn to_words(self) -> [u32; 5] {
        let degree = u32::from(self.degree.get());
        match self.kind {
            ShKind::Dense { half } => [u32::from(half), degree, 0, 0, 0],
            ShKind::Codes { index, value, atoms } => [2, degree, index, value, atoms],
        }
    }

    /// The layout of words made by [`Self::to_words`]; what is wrong with others.
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

    /// Bytes of the dense row of a Gaussian, or of its base colour.
    pub(super) fn colour_bytes(self) -> u64 {
        match self.kind {
            ShKind::Dense { half } => {
                let vector = if half { 8 } else { 16 };
                vectors(self.degree.coefficients()) as u64 * vector
            }
            ShKind::Codes { .. } => 12,
        }
    }

    /// Bytes of an exact row.
    pub(super) fn exact_bytes(self) -> u64 {
        4 * self.degree.rest() as u64
    }
}

impl Outline {
    /// Bytes of each array.
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

    /// Bytes of header and arrays together.
    pub(super) fn bytes(&self) -> u64 {
        let arrays: u64 = self.sizes().iter().map(|size| size.next_multiple_of(ALIGNMENT)).sum();
        4 * HEADER_WORDS as u64 + arrays
    }

    /// Where an array lies, in bytes. [`Self::bytes`] must fit in memory.
    pub(super) fn section(&self, section: Section) -> Range<usize> {
        let sizes = self.sizes();
        let before = sizes[..section as usize].iter().map(|size| size.next_multiple_of(ALIGNMENT));
        let start = 4 * HEADER_WORDS as u64 + before.sum::<u64>();
        let in_memory = |at: u64| usize::try_from(at).unwrap_or(usize::MAX);
        in_memory(start)..in_memory(start + sizes[section as usize])
    }

    /// The header.
    pub(super) fn to_words(self) -> [u32; HEADER_WORDS] {
        let [kind, degree, index, value, atoms] = self.layout.to_words();
        let mut words = [0; HEADER_WORDS];
        let used = [MAGIC, VERSION, kind, degree, self.len, index, value, atoms, self.escapes, self.words];
        words[..used.len()].copy_from_slice(&used);
        words
    }

    /// Reads a header; tells what is wrong with it.
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
