//! The dictionary type: unit-norm atoms in the space of SH coefficients. [`mod@crate::learn`] makes one.

use crate::scene::sh::ShDegree;
use crate::support::error::{Error, Result};
use crate::support::limits::MAX_ATOMS;

/// Largest distance of an atom's norm from 1. It leaves room for the f32 rounding of 72 values.
pub(crate) const NORM_TOLERANCE: f64 = 1e-5;

/// `len` atoms of unit norm with `dim` values each.
///
/// At degree 0 the dimension is 0, and there are no atoms.
#[derive(Debug, Clone, PartialEq)]
pub struct Dictionary {
    degree: ShDegree,
    atoms: Vec<f32>,
}

impl Dictionary {
    /// A dictionary from `atoms`, stored one after the other, each `degree.rest()` long.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the length is not a whole number of atoms, if there are no atoms or more than
    /// [`MAX_ATOMS`] (at degree 0: if there are any), or if an atom does not have unit norm.
    pub fn new(degree: ShDegree, atoms: Vec<f32>) -> Result<Self> {
        let dim = degree.rest();
        if dim == 0 {
            if !atoms.is_empty() {
                return Err(Error::parameter("atoms", atoms.len(), "no values at SH degree 0"));
            }
            return Ok(Self { degree, atoms });
        }
        if atoms.is_empty() || !atoms.len().is_multiple_of(dim) || atoms.len() / dim > MAX_ATOMS {
            let expected = format!("1 to {MAX_ATOMS} atoms of {dim} values");
            return Err(Error::parameter("atoms", format!("{} values", atoms.len()), expected));
        }
        let dictionary = Self { degree, atoms };
        match dictionary.odd_norm() {
            Some((j, norm)) => {
                Err(Error::parameter("atoms", format!("norm {norm} of atom {j}"), "a unit norm"))
            }
            None => Ok(dictionary),
        }
    }

    /// The same for atoms that were decoded, whose decoder says itself what is wrong.
    pub(crate) fn decoded(degree: ShDegree, atoms: Vec<f32>) -> Option<Self> {
        let dictionary = Self { degree, atoms };
        let (dim, len) = (dictionary.dim(), dictionary.len());
        let fits = (1..=MAX_ATOMS).contains(&len) && len * dim == dictionary.atoms.len();
        (fits && dictionary.odd_norm().is_none()).then_some(dictionary)
    }

    /// The number and the norm of the first atom whose norm is not 1.
    fn odd_norm(&self) -> Option<(usize, f64)> {
        let norm = |atom: &[f32]| atom.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>().sqrt();
        let norms = self.atoms.chunks_exact(self.dim().max(1)).map(norm).enumerate();
        let is_odd = |norm: f64| norm.is_nan() || (norm - 1.0).abs() > NORM_TOLERANCE;
        norms.into_iter().find(|&(_, norm)| is_odd(norm))
    }

    /// The dictionary of a scene without view dependence.
    #[must_use]
    pub fn empty() -> Self {
        Self { degree: ShDegree::ZERO, atoms: Vec::new() }
    }

    /// SH degree of the vectors that the dictionary codes.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.degree
    }

    /// Length of an atom: 0, 9, 24, 45 or 72.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.degree.rest()
    }

    /// Number of atoms.
    #[must_use]
    pub fn len(&self) -> usize {
        self.atoms.len().checked_div(self.dim()).unwrap_or(0)
    }

    /// Whether there are no atoms (degree 0).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.atoms.is_empty()
    }

    /// Atom `j`, channel-major as SH-rest is.
    ///
    /// # Panics
    /// If `j` is not below [`Self::len`].
    #[must_use]
    #[inline]
    pub fn atom(&self, j: usize) -> &[f32] {
        let dim = self.dim();
        &self.atoms[j * dim..(j + 1) * dim]
    }

    /// All atoms, one after the other.
    #[must_use]
    pub fn as_slice(&self) -> &[f32] {
        &self.atoms
    }
}
