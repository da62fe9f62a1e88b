//! What shows of a scene that no picture can be drawn of whole.

use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::Splats;
use crate::support::error::{Error, Result};

/// What views measure of the squared weights that a guess sums to 1: where several Gaussians share a pixel,
/// or none is, squares sum to less. Without it files came out 7 to 9 dB better than asked (leica-brush,
/// fruit-drops, snowmiku-mcmc), which is 1.7 halvings of the step.
pub(super) const SHOWN: f64 = 0.1;

/// How a part of a scene is judged: some 262,144 Gaussians, neighbours of each other.
pub enum Importance<'a, E = Error> {
    /// From each Gaussian alone ([`Sensitivity::heuristic`]).
    Heuristic,
    /// By a renderer. The parts count by their Gaussians.
    Judge {
        /// Is given the parts, once each and in order; says how pictures of one depend on its values.
        judge: &'a mut dyn FnMut(&Splats) -> Result<Sensitivity, E>,
        /// The GPU that draws, to be noted in the file; `None` for the processor.
        device: Option<String>,
    },
}

impl<E> std::fmt::Debug for Importance<'_, E> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Heuristic => "Guess",
            Self::Judge { .. } => "Judge",
        })
    }
}

impl<E> Importance<'_, E> {
    /// The GPU that drew, if one did.
    pub(super) fn device(&self) -> Option<&str> {
        match self {
            Self::Heuristic => None,
            Self::Judge { device, .. } => device.as_deref(),
        }
    }

    /// That of `part` of a scene of `gaussians` Gaussians, whose
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
