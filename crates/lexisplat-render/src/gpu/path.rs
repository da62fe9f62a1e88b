//! The ways in which a GPU can hold SH.

use crate::error::{Error, Result};
use crate::scene::Scene;

/// How SH is held on the GPU, and evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ShPath {
    /// Every coefficient in 32 bits.
    DenseF32,
    /// Every coefficient in 16 bits.
    DenseF16,
    /// Sparse codes, with the dictionary read through the cache.
    Sparse,
    /// As [`Self::Sparse`], with the Gaussians of each workgroup ordered by nonzeros before they are coloured.
    SparseOrdered,
    /// Sparse codes, with the dictionary in workgroup memory. Only for dictionaries that fit there.
    SparseShared,
    /// Sparse codes, with each atom's radiance from a table over directions. This is an approximation.
    SparseTable,
}

impl ShPath {
    /// All paths.
    pub const ALL: [Self; 6] = [
        Self::DenseF32,
        Self::DenseF16,
        Self::Sparse,
        Self::SparseOrdered,
        Self::SparseShared,
        Self::SparseTable,
    ];

    /// Its name in reports and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DenseF32 => "dense-f32",
            Self::DenseF16 => "dense-f16",
            Self::Sparse => "sparse",
            Self::SparseOrdered => "sparse-ordered",
            Self::SparseShared => "sparse-shared",
            Self::SparseTable => "sparse-table",
        }
    }

    /// Whether it needs a compressed scene.
    #[must_use]
    pub fn is_sparse(self) -> bool {
        !matches!(self, Self::DenseF32 | Self::DenseF16)
    }

    /// Returns the path that draws `scene` as it is stored, exactly.
    #[must_use]
    pub fn of(scene: &Scene<'_>) -> Self {
        match scene {
            Scene::Dense(_) => Self::DenseF32,
            Scene::Sparse(_) => Self::SparseOrdered,
        }
    }
}

impl std::str::FromStr for ShPath {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|path| path.name() == text);
        found.ok_or_else(|| Error::parameter("path", text, format!("one of {}", names())))
    }
}
