//! One column of a per-Gaussian property that 3DGS does not define, coded without loss (docs/FORMAT.md).

mod block;
mod deflate;
mod numbers;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::scene::extra::{ExtraValues, ScalarType, for_extra, with_scalar};
use crate::support::parallel::{map_chunks, map_vec};

/// Number of rows of a block. The last block has the rows that are left. [`LexiReader`](super::LexiReader) reads the rows
/// of several chunks together, so each block is decoded once, or twice if such a group of chunks ends within it. Blocks
/// half as long took 0.4 % more bytes on the columns measured.
pub(super) const BLOCK: usize = 1 << 16;
/// The types of columns in the order of their numbers in files.
const TYPES: [ScalarType; 8] = [
    ScalarType::I8,
    ScalarType::U8,
    ScalarType::I16,
    ScalarType::U16,
    ScalarType::I32,
    ScalarType::U32,
    ScalarType::F32,
    ScalarType::F64,
];

/// An encoder of a column whose values are pushed in pieces. The bytes do not depend on the sizes of the pieces.
#[derive(Debug)]
pub(super) struct ColumnEncoder {
    ty: ScalarType,
    /// The bits of the values that do not fill a block yet.
    held: Vec<u64>,
    /// Bytes that were not returned yet.
    out: Vec<u8>,
}

impl ColumnEncoder {
    /// Creates an encoder of a column of type `ty`.
    pub(super) fn new(ty: ScalarType) -> Self {
        let number = (0..).zip(TYPES).find(|t| t.1 == ty).map(|t| t.0);
        Self { ty, held: Vec::new(), out: number.into_iter().collect() }
    }

    /// Takes the next values, which must be of the column's type. Returns the bytes that follow the bytes returned before.
    pub(super) fn push(&mut self, values: &ExtraValues) -> Vec<u8> {
        debug_assert_eq!(values.scalar_type(), self.ty, "values of another type");
        let (len, width) = (values.len(), self.ty.bytes());
        // The number of values that go into the block that was begun.
        let first = if self.held.is_empty() { 0 } else { len.min(BLOCK - self.held.len()) };
        self.held.extend(bits(values, 0..first));
        if self.held.len() == BLOCK {
            block::put(&std::mem::take(&mut self.held), width, &mut self.out);
        }
        let whole = (len - first) / BLOCK * BLOCK;
        let blocks = map_chunks(whole, BLOCK, |range| {
            let mut out = Vec::new();
            block::put(&bits(values, first + range.start..first + range.end), width, &mut out);
            out
        });
        self.out.extend(blocks.into_iter().flatten());
        self.held.extend(bits(values, first + whole..len));
        std::mem::take(&mut self.out)
    }

    /// Returns the bytes that end the column.
    pub(super) fn finish(mut self) -> Vec<u8> {
        if !self.held.is_empty() {
            block::put(&self.held, self.ty.bytes(), &mut self.out);
        }
        self.out
    }
}

/// Returns the bits of the values of `range`, which must all exist.
fn bits(values: &ExtraValues, range: Range<usize>) -> Vec<u64> {
    for_extra!(values, v => v[range].iter().map(|value| numbers::from_bytes(&value.to_le_bytes())).collect())
}

/// Damage of the bytes of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum ColumnError {
    /// There is no byte for the type.
    #[error("it has no type")]
    NoType,
    /// No type has this number.
    #[error("type {0} is not known")]
    Type(u8),
    /// The bytes end within a block, or where a block should be.
    #[error("block {0} is cut off")]
    Truncated(usize),
    /// Bytes follow the last block.
    #[error("{0} bytes follow the last block")]
    Trailing(usize),
    /// A block does not decode to as many values as it has rows.
    #[error("block {0} is damaged")]
    Block(usize),
}

/// A column in the bytes of a file. Its blocks are counted and found, but not decoded.
#[derive(Debug)]
pub(super) struct Column<'a> {
    ty: ScalarType,
    rows: usize,
    blocks: Vec<&'a [u8]>,
}

impl<'a> Column<'a> {
    /// Finds the column of `rows` values in `bytes`. Nothing is allocated for blocks that are not there.
    pub(super) fn new(bytes: &'a [u8], rows: usize) -> Result<Self, ColumnError> {
        let (&number, mut rest) = bytes.split_first().ok_or(ColumnError::NoType)?;
        let ty = *TYPES.get(usize::from(number)).ok_or(ColumnError::Type(number))?;
        let mut blocks = Vec::new();
        for k in 0..rows.div_ceil(BLOCK) {
            blocks.push(deflate::take_part(&mut rest).ok_or(ColumnError::Truncated(k))?);
        }
        if !rest.is_empty() {
            return Err(ColumnError::Trailing(rest.len()));
        }
        Ok(Self { ty, rows, blocks })
    }

    /// Returns the type of the values.
    #[cfg(test)]
    fn scalar_type(&self) -> ScalarType {
        self.ty
    }

    /// Returns the values of rows `range`, as far as the column has them. Only blocks with such rows are decoded. A byte of
    /// a block may stand for thousands of rows, so the caller must have checked that there may be so many values. Besides,
    /// each thread needs memory for the words of one block.
    pub(super) fn values(&self, range: Range<usize>) -> Result<ExtraValues, ColumnError> {
        let end = range.end.min(self.rows);
        let start = range.start.min(end);
        with_scalar!(self.ty, T => {
            let mut values = vec![T::default(); end - start];
            let mut pieces = Vec::new();
            let (mut rest, mut at) = (values.as_mut_slice(), start);
            while !rest.is_empty() {
                let len = (BLOCK - at % BLOCK).min(rest.len());
                let (piece, later) = rest.split_at_mut(len);
                pieces.push((at, piece));
                (rest, at) = (later, at + len);
            }
            let decoded = map_vec(pieces, |(at, piece)| {
                let found = self.block(at / BLOCK)?;
                for (value, number) in piece.iter_mut().zip(found.iter().skip(at % BLOCK)) {
                    if let Some(bytes) = number.to_le_bytes().first_chunk() {
                        *value = T::from_le_bytes(*bytes);
                    }
                }
                Ok(())
            });
            decoded.into_iter().collect::<Result<(), _>>()?;
            Ok(values.into())
        })
    }

    /// Returns the bits of all values of block `k`.
    fn block(&self, k: usize) -> Result<Vec<u64>, ColumnError> {
        let rows = self.rows.saturating_sub(k * BLOCK).min(BLOCK);
        let bytes = self.blocks.get(k).ok_or(ColumnError::Truncated(k))?;
        block::take(bytes, rows, self.ty.bytes()).ok_or(ColumnError::Block(k))
    }
}
