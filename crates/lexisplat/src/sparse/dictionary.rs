//! The dictionary type: unit-norm atoms in the space of SH coefficients. [`mod@crate::learn`] makes one.

use crate::scene::sh::ShDegree;
use crate::sparse::atoms::Atoms;
use crate::support::error::{Error, Result};

/// [`Atoms`] whose length is that of the SH-rest of a degree.
///
/// At degree 0 the dimension is 0, and there are no atoms.
#[derive(Debug, Clone, PartialEq)]
pub struct Dictionary {
    degree: ShDegree,
    atoms: Atoms,
}

impl Dictionary {
    /// Creates a dictionary from `atoms`, which has the atoms one after the other, each of `degree.rest()` values.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the length is not a whole number of atoms, if there are no atoms or more than
    /// [`MAX_ATOMS`](crate::MAX_ATOMS) (at degree 0: if there are any), or if an atom does not have unit norm.
    pub fn new(degree: ShDegree, atoms: Vec<f32>) -> Result<Self> {
        let dim = degree.rest();
        if dim == 0 {
            if !atoms.is_empty() {
                return Err(Error::parameter("atoms", atoms.len(), "no values at SH degree 0"));
            }
            return Ok(Self { degree, atoms: Atoms::none() });
        }
        Ok(Self { degree, atoms: Atoms::checked(dim, atoms)? })
    }

    /// Creates a dictionary of `atoms`.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `atoms` do not have `degree.rest()` values each.
    pub fn of(degree: ShDegree, atoms: Atoms) -> Result<Self> {
        let dim = degree.rest();
        if atoms.dim() != dim {
            let expected = format!("{dim} values, those of SH degree {degree}");
            return Err(Error::parameter("atoms", format!("{} values an atom", atoms.dim()), expected));
        }
        Ok(Self { degree, atoms })
    }

    /// Creates a dictionary of atoms that were decoded. `None` if [`Self::new`] would refuse them; the decoder reports the
    /// error.
    pub(crate) fn decoded(degree: ShDegree, atoms: Vec<f32>) -> Option<Self> {
        Atoms::decoded(degree.rest(), atoms).map(|atoms| Self { degree, atoms })
    }

    /// Creates the dictionary of a scene without view dependence.
    #[must_use]
    pub fn empty() -> Self {
        Self { degree: ShDegree::ZERO, atoms: Atoms::none() }
    }

    /// Returns the SH degree of the vectors that the dictionary codes.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.degree
    }

    /// Returns the length of an atom: 0, 9, 24, 45 or 72.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.atoms.dim()
    }

    /// Returns the number of atoms.
    #[must_use]
    pub fn len(&self) -> usize {
        self.atoms.len()
    }

    /// Returns whether there are no atoms (degree 0).
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
        self.atoms.atom(j)
    }

    /// All atoms, one after the other.
    #[must_use]
    pub fn as_slice(&self) -> &[f32] {
        self.atoms.as_slice()
    }

    /// The atoms without the degree.
    #[must_use]
    pub fn atoms(&self) -> &Atoms {
        &self.atoms
    }
}
