//! Extras of a scene that comes part after part.

use crate::scene::extra::{Extra, for_extra};
use crate::scene::splats::Geometry;
use crate::support::error::Result;
use crate::support::spill::{Spill, SpillTo, Spilled};

/// Extras without values, each with its spilled values.
#[derive(Debug)]
pub(crate) struct SpilledExtras(Vec<(Extra, Spill)>);

impl SpilledExtras {
    /// Starts with no values of the extras of `empty`, which has no Gaussians.
    pub(crate) fn new(to: SpillTo<'_>, empty: Geometry) -> Result<Self> {
        empty.extras.into_iter().map(|extra| Ok((extra, Spill::new(to)?))).collect::<Result<_>>().map(Self)
    }

    /// Appends the values of the next Gaussians.
    pub(crate) fn push(&mut self, extras: &[Extra]) -> Result<()> {
        for (extra, (_, spill)) in extras.iter().zip(&mut self.0) {
            for_extra!(&extra.values, v => spill.push(v)?);
        }
        Ok(())
    }

    /// Returns the name and type of each extra, and its spilled values.
    pub(crate) fn finish(self) -> Result<Vec<(Extra, Spilled)>> {
        self.0.into_iter().map(|(extra, spill)| Ok((extra, spill.finish()?))).collect()
    }
}
