//! Codes many rows on all threads, into compressed sparse rows (CSR).

use std::ops::Range;

use super::careful::{Careful, Work};
use super::engine::MIN_ENERGY;
use super::{Coder, Encoded, ROWS_PER_TASK, Visit};
use crate::sparse::atoms::{check_finite, count_rows};
use crate::sparse::row_value::RowValue;
use crate::support::error::Result;
use crate::support::parallel::map_chunks;
use crate::support::progress::{Progress, Stage};

/// Number of rows that are coded before their codes are appended. It bounds the codes that are in memory twice.
const AT_ONCE: usize = 256 * ROWS_PER_TASK;

/// Sparse codes of rows. Values have the type of the rows.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RowCodes<V = f32> {
    /// Start of the pairs of each row, followed by the end of the last row's pairs. There is one entry more than there are
    /// rows.
    pub starts: Vec<usize>,
    /// The atom of each pair. Atoms ascend within a row.
    pub atoms: Vec<u16>,
    /// The value of each pair. A coder of 16-bit values rounds them to 16 bits. Other coders do not round values that they
    /// compute in f64 for rows of `f64`.
    pub values: Vec<V>,
    /// The un-squared L2 norm of each row's error, which is the row minus the sum of its values times atoms, taken in f64.
    pub errors: Vec<f64>,
    /// Numbers of the rows that no code brings within the tolerance, ascending. Such a row has the pairs of the nearest
    /// code, which may be none. Its error is the norm of its part outside the span of all atoms, or the error that rounding
    /// of values leaves. If the coder has a cap on nonzeros, no rows are listed here; `errors` tells which rows are over
    /// the tolerance.
    pub escapes: Vec<usize>,
}

impl<V> Default for RowCodes<V> {
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

impl<V: RowValue> RowCodes<V> {
    /// Returns the number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.errors.len()
    }

    /// Returns whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.errors.is_empty()
    }

    /// Returns the pairs (atom, value) of row `i`, by ascending atom.
    ///
    /// # Panics
    /// If `i` is not below [`Self::len`].
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, V)> {
        let pairs = self.starts[i]..self.starts[i + 1];
        self.atoms[pairs.clone()].iter().zip(&self.values[pairs]).map(|(&atom, &value)| (atom.into(), value))
    }

    /// Appends the next row.
    fn push(&mut self, coded: &Coded<'_, V>) {
        if coded.is_escape {
            self.escapes.push(self.len());
        }
        self.atoms.extend(coded.code.iter().map(|&(atom, _)| atom));
        self.values.extend(coded.code.iter().map(|&(_, value)| value));
        self.starts.push(self.atoms.len());
        self.errors.push(coded.error);
    }

    /// Appends the rows of `more`.
    fn append(&mut self, more: Self) {
        let (rows, pairs) = (self.len(), self.atoms.len());
        self.starts.extend(more.starts[1..].iter().map(|end| pairs + end));
        self.escapes.extend(more.escapes.iter().map(|row| rows + row));
        self.atoms.extend(more.atoms);
        self.values.extend(more.values);
        self.errors.extend(more.errors);
    }
}

/// The code of one row.
#[derive(Debug)]
pub(crate) struct Coded<'a, V> {
    pub(crate) row: &'a [V],
    /// Pairs (atom, value), by ascending atom.
    pub(crate) code: &'a [(u16, V)],
    /// The un-squared L2 norm of the error, in f64.
    pub(crate) error: f64,
    /// Whether no code brings the row within the tolerance.
    is_escape: bool,
}

/// A coder of rows of any size. It uses a pursuit in f32 where f32 is enough, and a pursuit in f64 elsewhere.
#[derive(Debug)]
pub(crate) struct RowCoder<'a> {
    coder: &'a Coder,
    careful: Careful<'a>,
}

impl<'a> RowCoder<'a> {
    pub(crate) fn new(coder: &'a Coder) -> Self {
        Self { coder, careful: Careful::new(coder) }
    }

    /// Codes `rows` one after the other on the calling thread, and passes each code to `sink`. Rows must be finite.
    pub(crate) fn each<V: RowValue>(&self, rows: &[V], mut sink: impl FnMut(&Coded<'_, V>)) {
        let (mut work, mut own) = (Work::default(), Vec::new());
        let mut wide = rows.chunks_exact(self.coder.dim());
        self.coder.encode(&V::narrow(rows), |visit| {
            let Some(row) = wide.next() else { return };
            own.clear();
            own.extend(visit.code.iter().map(|&(atom, value)| (atom, V::nearest(value.into()))));
            let mut error = self.careful.error(row, &own, &mut work);
            // The squares of a tiny row's error may underflow to 0, so `error` says nothing about a tiny row.
            let is_tiny = is_tiny(row, visit.signal);
            if is_tiny || !self.is_enough(&visit, error) {
                let found = self.careful.code(row, visit.chosen, &mut work);
                if is_tiny || error.is_nan() || found.error < error {
                    (own, error) = (found.code, found.error);
                }
            }
            let is_escape = self.coder.max_nonzeros().is_none() && error > self.coder.promise();
            sink(&Coded { row, code: &own, error, is_escape });
        });
    }

    /// Returns whether the code of `visit`, whose error in f64 is `error`, needs no search in f64.
    fn is_enough(&self, visit: &Visit<'_>, error: f64) -> bool {
        let is_capped = visit.outcome != Encoded::Escape && self.coder.tolerance().is_none();
        is_capped || error <= self.coder.promise()
    }
}

/// Returns whether `row`, which is `narrow` in f32, is not zero but too small for a pursuit in f32.
fn is_tiny<V: RowValue>(row: &[V], narrow: &[f32]) -> bool {
    let energy: f64 = narrow.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
    energy < MIN_ENERGY && row.iter().any(|&x| x != V::default())
}

/// Codes `rows`, which lie one after the other and are each as long as an atom. `progress` is told of [`Stage::Code`].
///
/// The codes are those of [`Coder::encode`] where these are within the tolerance. Other rows, and rows too large or too
/// small for f32, are coded anew in f64. A row stays over the tolerance only if no code is within it, or if the coder has a
/// cap on nonzeros. The codes do not depend on the number of threads.
///
/// # Errors
/// [`Error::Parameter`](crate::Error::Parameter) if `rows` are not a whole number of finite rows, or if there are no
/// atoms (SH degree 0). [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels.
pub fn encode_rows<V: RowValue>(coder: &Coder, rows: &[V], progress: &dyn Progress) -> Result<RowCodes<V>> {
    let count = count_rows(coder.dim(), rows)?;
    let row_coder = RowCoder::new(coder);
    let mut all = RowCodes::default();
    progress.begin(Stage::Code, count as u64);
    for start in (0..count).step_by(AT_ONCE) {
        let len = AT_ONCE.min(count - start);
        for codes in map_chunks(len, ROWS_PER_TASK, |piece| {
            encode_piece(&row_coder, rows, start + piece.start..start + piece.end, progress)
        }) {
            all.append(codes?);
        }
    }
    progress.end();
    Ok(all)
}

/// Codes the rows of `range` on the calling thread.
fn encode_piece<V: RowValue>(
    coder: &RowCoder<'_>,
    rows: &[V],
    range: Range<usize>,
    progress: &dyn Progress,
) -> Result<RowCodes<V>> {
    progress.check()?;
    let dim = coder.coder.dim();
    let rows = &rows[range.start * dim..range.end * dim];
    check_finite(dim, rows, range.start)?;
    let mut codes = RowCodes::default();
    coder.each(rows, |coded| codes.push(coded));
    progress.advance(range.len() as u64);
    Ok(codes)
}
