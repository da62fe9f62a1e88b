//! Scenes from Python, compressed or dense, that are drawn.

use std::borrow::Cow;
use std::sync::Arc;

use lexisplat::{Model, Offset, Splats};
use lexisplat_render::Scene as Drawable;
use pyo3::prelude::*;

use crate::arrays::finite_from_python;
use crate::errors::Result;
use crate::held::Held;
use crate::scene::Scene;

/// A scene from Python, which may not be decoded yet.
pub(crate) enum Subject {
    Dense(Box<Splats>),
    Held(Arc<Held>),
}

/// A scene that can be drawn.
pub(crate) enum Resolved {
    Dense(Box<Splats>),
    Sparse(Arc<Model>),
}

impl Subject {
    /// Returns the scene in `given`: a compressed scene, or an object with the attributes of `Splats`, all of them
    /// finite.
    pub(crate) fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        Self::dropping(given, false, &mut Vec::new())
    }

    /// Returns the scene in `given`, like [`Self::of`]. If `drop_invalid` is set, Gaussians with other values are left
    /// out, and a message with their number is added to `told`.
    pub(crate) fn dropping(
        given: &Bound<'_, PyAny>,
        drop_invalid: bool,
        told: &mut Vec<String>,
    ) -> PyResult<Self> {
        match given.cast::<Scene>() {
            Ok(scene) => Ok(Self::Held(Arc::clone(&scene.get().held))),
            Err(_) => Ok(Self::Dense(Box::new(finite_from_python(given, drop_invalid, told)?))),
        }
    }

    pub(crate) fn resolved(self) -> Result<Resolved> {
        Ok(match self {
            Self::Dense(splats) => Resolved::Dense(splats),
            Self::Held(held) => Resolved::Sparse(held.model()?),
        })
    }
}

impl Resolved {
    pub(crate) fn scene(&self) -> Drawable<'_> {
        match self {
            Self::Dense(splats) => Drawable::from(&**splats),
            Self::Sparse(model) => Drawable::from(&**model),
        }
    }

    /// Returns the offset to which positions are relative.
    pub(crate) fn offset(&self) -> Option<Offset> {
        self.scene().meta().offset
    }

    /// Makes positions relative to `offset`. The scene stays in place.
    pub(crate) fn rebase(&mut self, offset: Option<Offset>) {
        if self.offset() == offset {
            return;
        }
        match self {
            Self::Dense(splats) => drop(splats.rebase(offset)),
            Self::Sparse(model) => Arc::make_mut(model).rebase(offset),
        }
    }

    /// Returns the scene with dense SH.
    pub(crate) fn dense(&self) -> Cow<'_, Splats> {
        match self {
            Self::Dense(splats) => Cow::Borrowed(splats),
            Self::Sparse(model) => Cow::Owned(Model::clone(model).into_splats()),
        }
    }
}
