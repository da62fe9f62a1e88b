//! Drawing of a scene part by part, if it is too large to be drawn as a whole.

use crate::packed::Appearance;
use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::Splats;
use crate::sparse::model::Model;
use crate::support::error::{Error, Result};

/// Draws the parts of a scene. A part holds about 262,144 Gaussians near each other, and is drawn as if it were the whole scene.
pub trait Observer<E = Error> {
    /// Measures how pictures of `part` depend on its values, and which step it asks for.
    ///
    /// # Errors
    /// Those of drawing.
    fn observe(&mut self, part: &Splats) -> Result<Observed, E>;

    /// Base colours and opacities with which pictures of `model` are nearest to those of `part`; `None` to leave them. `model` is
    /// what a file has of the part, `weights` are the sensitivities of its Gaussians to the colour and to the logarithm of the
    /// opacity, and `memo` is that of [`Observed`]. It is called for each part, if the options let these values change.
    ///
    /// # Errors
    /// Those of drawing.
    fn refit(
        &mut self,
        _part: &Splats,
        _model: &Model,
        _weights: &[[f32; 2]],
        _memo: &[u8],
    ) -> Result<Option<Vec<Appearance>>, E> {
        Ok(None)
    }

    /// Name of the GPU that draws, which the file records; `None` for the CPU renderer.
    fn device(&self) -> Option<String> {
        None
    }
}

/// The findings of an [`Observer`] in pictures of a part of a scene.
#[derive(Debug, Clone)]
pub struct Observed {
    /// How pictures depend on the values of the part, as if it were the whole scene.
    pub sensitivity: Sensitivity,
    /// The factor of the usual step with which the part, packed as a scene of its own, is as good as asked: above 0.
    pub step_factor: f64,
    /// Bytes that the observer is given again when it refits the part, such as the views that it drew. Another process may refit.
    pub memo: Vec<u8>,
}

impl Observed {
    /// Refuses a factor that is not finite and above 0.
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
