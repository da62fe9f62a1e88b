//! The sensitivity of pictures to a scene that is too large to be drawn as a whole.

use crate::packed::Refit;
use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::Splats;
use crate::support::error::{Error, Result};

/// Finds a factor of the usual step for a part of a scene.
pub type Correct<'a, E = Error> = dyn FnMut(&Splats) -> Result<f64, E> + 'a;

/// How the sensitivity to a part of a scene is found. A part holds about 262,144 Gaussians near each other.
pub enum Importance<'a, E = Error> {
    /// From each Gaussian alone ([`Sensitivity::heuristic`]).
    Heuristic,
    /// By a renderer. Parts are weighted by their number of Gaussians.
    Judge {
        /// Measures how pictures of a part depend on its values. It is called once for each part, in order.
        judge: &'a mut dyn FnMut(&Splats) -> Result<Sensitivity, E>,
        /// Finds the factor of the usual step with which a part, packed as a scene of its own, is as good as asked. It is called
        /// for some parts, before any is measured. Without it the usual step stays.
        correct: Option<&'a mut Correct<'a, E>>,
        /// Fits base colours and opacities to pictures of a part, if the options let them change. The parts are those that `judge`
        /// takes.
        refit: Option<&'a mut Refit<'a, E>>,
        /// Name of the GPU that draws, which the file records; `None` for the CPU renderer.
        device: Option<String>,
    },
}

impl<E> std::fmt::Debug for Importance<'_, E> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Heuristic => "Heuristic",
            Self::Judge { .. } => "Judge",
        })
    }
}

impl<'a, E> Importance<'a, E> {
    /// Name of the GPU that drew, if one did.
    pub(super) fn device(&self) -> Option<&str> {
        match self {
            Self::Heuristic => None,
            Self::Judge { device, .. } => device.as_deref(),
        }
    }

    /// What fits base colours and opacities, if anything does.
    pub(super) fn refit(&mut self) -> Option<&mut Refit<'a, E>> {
        match self {
            Self::Heuristic => None,
            Self::Judge { refit, .. } => refit.as_deref_mut(),
        }
    }

    /// The factor of the usual step for `part`, if something finds it.
    pub(super) fn correction(&mut self, part: &Splats) -> Result<Option<f64>, E> {
        match self {
            Self::Judge { correct: Some(correct), .. } => correct(part).map(Some),
            Self::Heuristic | Self::Judge { .. } => Ok(None),
        }
    }

    /// The sensitivity to `part` as if it were the whole scene, if something measures it.
    pub(super) fn of(&mut self, part: &Splats) -> Result<Option<Sensitivity>, E> {
        match self {
            Self::Heuristic => Ok(None),
            Self::Judge { judge, .. } => judge(part).map(Some),
        }
    }
}
