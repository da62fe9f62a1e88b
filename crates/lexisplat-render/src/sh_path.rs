//! The ways of holding SH on a GPU.

use crate::error::{Error, Result};
use crate::scene::Scene;

/// The way in which SH is held and evaluated on the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ShPath {
    /// Dense SH: every coefficient in 32 bits.
    DenseF32,
    /// Dense SH: every coefficient in 16 bits.
    DenseF16,
    /// Sparse codes. The dictionary is read through the cache.
    Sparse,
    /// Like [`Self::Sparse`]. In addition the Gaussians of each workgroup are ordered by number of nonzeros before they
    /// are coloured.
    SparseOrdered,
    /// Sparse codes. The dictionary is held in workgroup memory, in which it must fit.
    SparseShared,
    /// Sparse codes. The radiance of each atom is read from a table over directions. This is an approximation.
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

    /// Returns the name of the path in reports and on the command line.
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

    /// Returns whether the path needs a compressed scene.
    #[must_use]
    pub fn is_sparse(self) -> bool {
        !matches!(self, Self::DenseF32 | Self::DenseF16)
    }

    /// Returns the path that draws `scene` in its own representation, without approximation.
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
