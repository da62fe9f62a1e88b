//! The sensitivity of pictures to a scene that is too large to be drawn as a whole.

use crate::packed::Refit;
use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::Splats;
use crate::support::error::{Error, Result};

/// Sum of the squared weights that views measure. The heuristic scales its weights to a sum of 1, but squares sum
/// to less where several Gaussians share a pixel or none covers it. Without this factor files came out 7 to 9 dB
/// better than asked (leica-brush, fruit-drops, snowmiku-mcmc), which is 1.7 halvings of the step.
pub(super) const SHOWN: f64 = 0.1;

/// How the sensitivity to a part of a scene is found. A part holds about 262,144 Gaussians near each other.
pub enum Importance<'a, E = Error> {
    /// From each Gaussian alone ([`Sensitivity::heuristic`]).
    Heuristic,
    /// By a renderer. Parts are weighted by their number of Gaussians.
    Judge {
        /// Measures how pictures of a part depend on its values. It is called once for each part, in order.
        judge: &'a mut dyn FnMut(&Splats) -> Result<Sensitivity, E>,
        /// Fits base colours and opacities to pictures of a part, if the options let them change. The parts are not those that
        /// `judge` takes.
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

    /// The sensitivity to `part` of a scene of `gaussians` Gaussians, whose
    /// [`heuristic_total`](crate::scene::sensitivity::heuristic_total) is `total`.
    pub(super) fn of(&mut self, part: &Splats, gaussians: usize, total: f64) -> Result<Sensitivity, E> {
        match self {
            Self::Heuristic => Ok(Sensitivity::heuristic_part(&part.geometry, total / SHOWN)),
            Self::Judge { judge, .. } => {
                let mut found = judge(part)?;
                #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
                found.share((part.len() as f64 / gaussians.max(1) as f64) as f32);
                Ok(found)
            }
        }
    }
}
