//! What can be drawn: a trained scene or a compressed one.

use lexisplat::{Geometry, Model, SceneMeta, ShDegree, Splats};

use crate::error::Result;

/// A scene to draw, borrowed.
#[derive(Debug, Clone, Copy)]
pub enum Scene<'a> {
    /// With dense SH, as a PLY holds it.
    Dense(&'a Splats),
    /// With a dictionary and sparse codes, as a .lexi holds it; never expanded to dense SH.
    Sparse(&'a Model),
}

impl<'a> From<&'a Splats> for Scene<'a> {
    fn from(splats: &'a Splats) -> Self {
        Self::Dense(splats)
    }
}

impl<'a> From<&'a Model> for Scene<'a> {
    fn from(model: &'a Model) -> Self {
        Self::Sparse(model)
    }
}

impl<'a> Scene<'a> {
    /// Everything but SH-rest.
    #[must_use]
    pub fn geometry(&self) -> &'a Geometry {
        match self {
            Self::Dense(splats) => &splats.geometry,
            Self::Sparse(model) => model.geometry(),
        }
    }

    /// Comments and marks.
    #[must_use]
    pub fn meta(&self) -> &'a SceneMeta {
        match self {
            Self::Dense(splats) => &splats.meta,
            Self::Sparse(model) => model.meta(),
        }
    }

    /// SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        match self {
            Self::Dense(splats) => splats.degree,
            Self::Sparse(model) => model.degree(),
        }
    }

    /// Checks that every array has an entry for each Gaussian.
    ///
    /// # Errors
    /// [`Error::Codec`](crate::Error::Codec) naming the array and its length.
    pub fn validate(&self) -> Result<()> {
        // A model checks its arrays when it is made.
        if let Self::Dense(splats) = self {
            splats.validate()?;
        }
        Ok(())
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.geometry().len()
    }

    /// Whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.geometry().is_empty()
    }
}
