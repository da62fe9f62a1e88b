//! Codes many rows on all threads, into compressed sparse rows (CSR).

use std::ops::Range;

use super::{Coder, Encoded, ROWS_PER_TASK, Visit};
use crate::sparse::atoms::{check_finite, count_rows};
use crate::support::error::Result;
use crate::support::parallel::map_chunks;
use crate::support::progress::{Progress, Stage};

/// Rows coded before their codes are appended. It bounds the codes that are in memory twice.
const AT_ONCE: usize = 256 * ROWS_PER_TASK;

/// Sparse codes of rows.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RowCodes {
    /// Where the pairs of each row start, and where those of the last row end: one entry more than there are rows.
    pub starts: Vec<usize>,
    /// The atom of each pair. Atoms ascend within a row.
    pub atoms: Vec<u16>,
    /// The value of each pair, rounded to the coder's value type.
    pub values: Vec<f32>,
    /// The un-squared L2 norm of each row's error, computed in f64 from what
    /// [`Atoms::reconstruct`](crate::Atoms::reconstruct) makes of its pairs.
    pub errors: Vec<f64>,
    /// The numbers of the rows that no code brings within the tolerance ([`Encoded::Escape`]), ascending. They have the
    /// pairs that come nearest ([`Visit::nearest`]), which may be none. Rows that end at a cap on nonzeros are not among
    /// them; their errors tell.
    pub escapes: Vec<usize>,
}

impl Default for RowCodes {
    fn default() -> Self {
        Self {
            starts: vec![0],
            atoms: Vec::new(),
            values: Vec::new(),
            errors: Vec::new(),
            escapes: Vec::new(),
        }
    }
}

impl RowCodes {
    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.errors.len()
    }

    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.errors.is_empty()
    }

    /// The (atom, value) pairs of row `i`, by ascending atom.
    ///
    /// # Panics
    /// If `i` is not below [`Self::len`].
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f32)> {
        let pairs = self.starts[i]..self.starts[i + 1];
        self.atoms[pairs.clone()].iter().zip(&self.values[pairs]).map(|(&atom, &value)| (atom.into(), value))
    }

    /// Appends the next row.
    fn push(&mut self, visit: &Visit<'_>) {
        let (code, error) = visit.nearest();
        if visit.outcome == Encoded::Escape {
            self.escapes.push(self.len());
        }
        self.atoms.extend(code.iter().map(|&(atom, _)| atom));
        self.values.extend(code.iter().map(|&(_, value)| value));
        self.starts.push(self.atoms.len());
        self.errors.push(error);
    }

    /// Appends the rows of `part`.
    fn append(&mut self, part: Self) {
        let (rows, pairs) = (self.len(), self.atoms.len());
        self.starts.extend(part.starts[1..].iter().map(|end| pairs + end));
        self.escapes.extend(part.escapes.iter().map(|row| rows + row));
        self.atoms.extend(part.atoms);
        self.values.extend(part.values);
        self.errors.extend(part.errors);
    }
}

/// Codes `rows`, one after the other, each as long as an atom. The codes are those of [`Coder::encode`], and do not
/// depend on the number of threads. `progress` is told of [`Stage::Code`].
///
/// # Errors
/// [`Error::Parameter`](crate::Error::Parameter) if `rows` are not a whole number of finite rows, or if there are no
/// atoms (SH degree 0). [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels.
pub fn encode_rows(coder: &Coder, rows: &[f32], progress: &dyn Progress) -> Result<RowCodes> {
    let count = count_rows(coder.dim(), rows)?;
    let mut all = RowCodes::default();
    progress.begin(Stage::Code, count as u64);
    for start in (0..count).step_by(AT_ONCE) {
        let len = AT_ONCE.min(count - start);
        for part in map_chunks(len, ROWS_PER_TASK, |piece| {
            encode_piece(coder, rows, start + piece.start..start + piece.end, progress)
        }) {
            all.append(part?);
        }
    }
    progress.end();
    Ok(all)
}

/// Codes the rows of `range` on the calling thread.
fn encode_piece(
    coder: &Coder,
    rows: &[f32],
    range: Range<usize>,
    progress: &dyn Progress,
) -> Result<RowCodes> {
    progress.check()?;
    let rows = &rows[range.start * coder.dim()..range.end * coder.dim()];
    check_finite(coder.dim(), rows, range.start)?;
    let mut part = RowCodes::default();
    coder.encode(rows, |visit| part.push(&visit));
    progress.advance(range.len() as u64);
    Ok(part)
}
