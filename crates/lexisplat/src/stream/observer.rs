//! The interface of a renderer to packing: it draws a scene part by part, if the scene is too large to be drawn as a whole.

use crate::packed::Appearance;
use crate::scene::sensitivity::{AppearanceSensitivity, Sensitivity};
use crate::scene::splats::Splats;
use crate::sparse::model::Model;
use crate::support::error::{Error, Result};

/// A renderer that draws the parts of a scene. A part holds about 262,144 Gaussians near each other, and is drawn as if it
/// were the whole scene.
pub trait Observer<E = Error> {
    /// Measures how pictures of `part` depend on its values, and which step the part asks for.
    ///
    /// # Errors
    /// Errors of drawing.
    fn observe(&mut self, part: &Splats) -> Result<Observed, E>;

    /// Returns the base colours and opacities with which pictures of `model` are nearest to those of `part`; `None`
    /// leaves them as they are. `model` is the part as the file has it. `sensitivities` has the sensitivity to the
    /// appearance of each Gaussian of `model`. `memo` is the one of [`Observed`]. The function is called for each part,
    /// if the options let these values change.
    ///
    /// # Errors
    /// Errors of drawing.
    fn refit(
        &mut self,
        _part: &Splats,
        _model: &Model,
        _sensitivities: &[AppearanceSensitivity],
        _memo: &[u8],
    ) -> Result<Option<Vec<Appearance>>, E> {
        Ok(None)
    }

    /// Returns the name of the GPU that draws, which the file records; `None` for the CPU renderer.
    fn device(&self) -> Option<String> {
        None
    }
}

/// The findings of an [`Observer`] in pictures of a part of a scene.
#[derive(Debug, Clone)]
pub struct Observed {
    /// The sensitivity of pictures to the values of the part, as if it were the whole scene.
    pub sensitivity: Sensitivity,
    /// Factor on the usual step: with this step the part, packed as a scene of its own, has the quality that was asked for.
    /// Above 0.
    pub step_factor: f64,
    /// Bytes that the observer gets back when it refits the part, such as the views that it drew. Another process may do
    /// that.
    pub memo: Vec<u8>,
}

impl Observed {
    /// Refuses a step factor that is not finite and above 0.
    pub(crate) fn check(&self) -> Result<()> {
        match self.step_factor.is_finite() && self.step_factor > 0.0 {
            true => Ok(()),
            false => Err(Error::parameter("step factor", self.step_factor, "a finite number above 0")),
        }
    }
}

impl From<Sensitivity> for Observed {
    fn from(sensitivity: Sensitivity) -> Self {
        Self { sensitivity, step_factor: 1.0, memo: Vec::new() }
    }
}
