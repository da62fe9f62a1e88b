//! The interface of a renderer to packing: it draws a scene part by part, if the scene is too large to be drawn as a whole.

use crate::packed::{Appearance, PackOptions, ToRefit};
use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::Splats;
use crate::scene::tile_kind::TileKind;
use crate::support::error::{Error, Result};

/// A renderer that draws the parts of a scene. A part holds about 262,144 Gaussians near each other, and is drawn as if it
/// were the whole scene.
pub trait Observer<E = Error> {
    /// Measures how pictures of `part` depend on its values, and which step the part asks for.
    ///
    /// # Errors
    /// Errors of drawing.
    fn observe(&mut self, part: &Splats) -> Result<Observed, E>;

    /// Returns the base colours and opacities with which pictures of the file are nearest to those of the part; `None`
    /// leaves them as they are. The function is called for each part, if the options let these values change.
    ///
    /// # Errors
    /// Errors of drawing.
    fn refit(&mut self, _of: ToRefit<'_, '_>) -> Result<Option<Vec<Appearance>>, E> {
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
    /// The Gaussians that are packed instead of the part, if there are any. They have the properties of the part. The options
    /// must let Gaussians go.
    pub instead: Option<Splats>,
    /// The sensitivity of pictures to the values of the Gaussians that are packed, as if they were the whole scene.
    pub sensitivity: Sensitivity,
    /// Factor on the usual step of a scene of as many Gaussians as the part has: with this step the part, packed as a scene of its
    /// own, has the quality that was asked for.
    /// Above 0.
    pub step_factor: f64,
    /// Bytes that the observer gets back when it refits the part, such as the views that it drew. Another process may do
    /// that.
    pub memo: Vec<u8>,
}

impl Observed {
    /// Refuses a step factor that is not finite and above 0. Refuses other Gaussians than those of `part` if all must stay, or if
    /// they have other properties.
    pub(crate) fn check(&self, part: &Splats, options: &PackOptions) -> Result<()> {
        if let Some(instead) = &self.instead {
            if !options.may_change() {
                let expected = "the Gaussians of the part, with keep_all, keep_order or a tolerance";
                return Err(Error::parameter("Gaussians", "others", expected));
            }
            if let Some(difference) = TileKind::of(part).difference(&TileKind::of(instead)) {
                return Err(Error::parameter("Gaussians", difference, "the properties of the part"));
            }
        }
        match self.step_factor.is_finite() && self.step_factor > 0.0 {
            true => Ok(()),
            false => Err(Error::parameter("step factor", self.step_factor, "a finite number above 0")),
        }
    }
}

impl From<Sensitivity> for Observed {
    fn from(sensitivity: Sensitivity) -> Self {
        Self { instead: None, sensitivity, step_factor: 1.0, memo: Vec::new() }
    }
}
