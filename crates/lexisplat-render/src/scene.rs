//! The scenes that can be drawn: trained scenes and compressed ones.

use lexisplat::{Geometry, Model, SceneMeta, ShDegree, Splats};

use crate::error::Result;
use crate::pose::Pose;

/// A scene to draw, borrowed.
#[derive(Debug, Clone, Copy)]
pub enum Scene<'a> {
    /// A scene with dense SH, as in a PLY.
    Dense(&'a Splats),
    /// A scene with a dictionary and sparse codes, as in a .lexi. It is never expanded to dense SH.
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
    /// Returns everything but SH-rest.
    #[must_use]
    pub fn geometry(&self) -> &'a Geometry {
        match self {
            Self::Dense(splats) => &splats.geometry,
            Self::Sparse(model) => model.geometry(),
        }
    }

    /// Returns the comments and marks.
    #[must_use]
    pub fn meta(&self) -> &'a SceneMeta {
        match self {
            Self::Dense(splats) => &splats.meta,
            Self::Sparse(model) => model.meta(),
        }
    }

    /// Returns the view that the file states, from which viewers show the scene first.
    #[must_use]
    pub fn first_view(&self) -> Option<Pose> {
        self.meta().view.as_deref().and_then(Pose::parse)
    }

    /// Returns the SH degree.
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
        // The arrays of a model were checked when it was made.
        if let Self::Dense(splats) = self {
            splats.validate()?;
        }
        Ok(())
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.geometry().len()
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.geometry().is_empty()
    }
}
