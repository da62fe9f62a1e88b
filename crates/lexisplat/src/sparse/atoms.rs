//! Unit-norm atoms of any length. A [`Dictionary`](crate::Dictionary) has atoms of the length of the SH-rest of its degree.

use crate::sparse::row_value::RowValue;
use crate::support::error::{Error, Result};
use crate::support::limits::MAX_ATOMS;

/// Largest length of an atom. Learning starts with the principal axes of a sample, whose cost grows with the cube of the
/// length. At this length they take about half a minute, and the working memory of a pursuit is 8 MiB a thread.
pub const MAX_DIM: usize = 1024;
/// Largest difference of an atom's norm from 1. It is large enough for the f32 rounding of [`MAX_DIM`] values.
const NORM_TOLERANCE: f64 = 1e-5;

/// A list of atoms of unit norm with `dim` values each.
///
/// Only a dictionary of SH degree 0, whose rows have no values, has no atoms.
#[derive(Debug, Clone, PartialEq)]
pub struct Atoms {
    dim: usize,
    values: Vec<f32>,
}

impl Atoms {
    /// Creates atoms from `values`, which has the atoms one after the other, each of `dim` values.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `dim` is not from 1 to [`MAX_DIM`], if `values` is not a whole number of atoms, if there are
    /// no atoms or more than [`MAX_ATOMS`], or if an atom does not have unit norm (to within 1e-5).
    pub fn new(dim: usize, values: Vec<f32>) -> Result<Self> {
        check_dim(dim)?;
        Self::checked(dim, values)
    }

    /// Creates atoms as [`Self::new`] does, for a `dim` that is known to be in range.
    pub(super) fn checked(dim: usize, values: Vec<f32>) -> Result<Self> {
        if values.is_empty() || !values.len().is_multiple_of(dim) || values.len() / dim > MAX_ATOMS {
            let expected = format!("1 to {MAX_ATOMS} atoms of {dim} values");
            return Err(Error::parameter("atoms", format!("{} values", values.len()), expected));
        }
        let atoms = Self { dim, values };
        match atoms.odd_norm() {
            Some((j, norm)) => {
                Err(Error::parameter("atoms", format!("norm {norm} of atom {j}"), "a unit norm"))
            }
            None => Ok(atoms),
        }
    }

    /// Creates atoms that were decoded. `None` if [`Self::new`] would refuse them; the decoder reports the error.
    pub(super) fn decoded(dim: usize, values: Vec<f32>) -> Option<Self> {
        let atoms = Self { dim, values };
        let len = atoms.len();
        let fits = (1..=MAX_ATOMS).contains(&len) && len * dim == atoms.values.len();
        (fits && atoms.odd_norm().is_none()).then_some(atoms)
    }

    /// Creates an empty list, for rows without values.
    pub(super) fn none() -> Self {
        Self { dim: 0, values: Vec::new() }
    }

    /// Returns the number and the norm of the first atom whose norm is not 1.
    fn odd_norm(&self) -> Option<(usize, f64)> {
        let norm = |atom: &[f32]| atom.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>().sqrt();
        let norms = self.values.chunks_exact(self.dim.max(1)).map(norm).enumerate();
        let is_odd = |norm: f64| norm.is_nan() || (norm - 1.0).abs() > NORM_TOLERANCE;
        norms.into_iter().find(|&(_, norm)| is_odd(norm))
    }

    /// Returns the number of values of an atom, and of the rows that the atoms code.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Returns the number of atoms.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len().checked_div(self.dim).unwrap_or(0)
    }

    /// Returns whether there are no atoms (SH degree 0).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns atom `j`.
    ///
    /// # Panics
    /// If `j` is not below [`Self::len`].
    #[must_use]
    #[inline]
    pub fn atom(&self, j: usize) -> &[f32] {
        &self.values[j * self.dim..(j + 1) * self.dim]
    }

    /// Returns all atoms, one after the other.
    #[must_use]
    pub fn as_slice(&self) -> &[f32] {
        &self.values
    }

    /// Sums `value * atom` into `out`, in the order of `code`, with one f32 multiplication and one f32 addition at a time.
    /// The result is exactly the row whose error a [`Coder`](crate::pursuit::Coder) reports.
    ///
    /// # Panics
    /// If an atom's number is not below [`Self::len`].
    #[inline]
    pub fn reconstruct(&self, code: impl Iterator<Item = (usize, f32)>, out: &mut [f32]) {
        out.fill(0.0);
        for (atom, value) in code {
            for (o, a) in out.iter_mut().zip(self.atom(atom)) {
                *o += value * a;
            }
        }
    }
}

/// Refuses a length of rows that atoms cannot have.
pub(super) fn check_dim(dim: usize) -> Result<()> {
    match dim {
        1..=MAX_DIM => Ok(()),
        _ => Err(Error::parameter("dim", dim, format!("1 to {MAX_DIM} values"))),
    }
}

/// Returns the number of rows in `rows`, each of `dim` values.
pub(super) fn count_rows<V>(dim: usize, rows: &[V]) -> Result<usize> {
    if dim == 0 || !rows.len().is_multiple_of(dim) {
        let expected = format!("a whole number of rows of {dim} values");
        return Err(Error::parameter("rows", format!("{} values", rows.len()), expected));
    }
    Ok(rows.len() / dim)
}

/// Refuses `rows`, each of `dim` values, if one holds NaN or infinity. Errors call the first row number `first`.
pub(super) fn check_finite<V: RowValue>(dim: usize, rows: &[V], first: usize) -> Result<()> {
    // The loop has no early exit, so that it is vectorised.
    let good = rows.iter().fold(true, |good, v| good & v.wide().is_finite());
    if good {
        return Ok(());
    }
    let before = rows.iter().take_while(|v| v.wide().is_finite()).count();
    let row = first + before / dim.max(1);
    Err(Error::parameter("rows", format!("NaN or infinity in row {row}"), "finite values"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(dim: usize, values: Vec<f32>) -> String {
        Atoms::new(dim, values).unwrap_err().to_string()
    }

    #[test]
    fn atoms_are_checked() {
        let longest = vec![1.0 / 32.0; MAX_DIM];
        assert_eq!(Atoms::new(MAX_DIM, longest).unwrap().len(), 1);
        assert_eq!(Atoms::new(1, vec![-1.0; MAX_ATOMS]).unwrap().len(), MAX_ATOMS);
        assert_eq!(Atoms::new(2, vec![1.0, 0.0, 0.6, 0.8]).unwrap().atom(1), [0.6, 0.8]);
        assert!(refusal(0, Vec::new()).contains("1 to 1024 values"));
        assert!(refusal(MAX_DIM + 1, vec![1.0; MAX_DIM + 1]).contains("dim = 1025"));
        assert!(refusal(3, Vec::new()).contains("1 to 1024 atoms of 3 values"));
        assert!(refusal(3, vec![1.0; 4]).contains("4 values"));
        assert!(refusal(1, vec![1.0; MAX_ATOMS + 1]).contains("1025 values"));
        assert!(refusal(2, vec![1.0, 0.0, 1.0, 0.1]).contains("of atom 1"));
        assert!(refusal(2, vec![f32::NAN, 0.0]).contains("norm NaN of atom 0"));
    }

    #[test]
    fn rows_are_counted_and_checked() {
        assert_eq!(count_rows(3, &[0.0; 6]).unwrap(), 2);
        assert_eq!(count_rows::<f32>(3, &[]).unwrap(), 0);
        assert!(count_rows(3, &[0.0; 5]).is_err());
        assert!(count_rows::<f32>(0, &[]).is_err());
        assert!(check_finite(2, &[0.0, f32::MAX, 1.0, -1.0], 0).is_ok());
        let error = check_finite(2, &[0.0, 0.0, 1.0, f32::INFINITY], 10).unwrap_err();
        assert!(error.to_string().contains("row 11"), "{error}");
    }
}
