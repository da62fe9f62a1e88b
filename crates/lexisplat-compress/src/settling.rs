//! Fits a refined scene to what quantisation has settled: radiance to quantised shapes, then base colours and opacities to
//! quantised SH-rest.
//!
//! Later fits make up for the errors of what was settled before (docs/METHOD.md, "Refining").

use std::cell::RefCell;
use std::collections::HashMap;

use lexisplat::packed::{Appearance, Quantised};
use lexisplat::{Geometry, Progress, Splats};

use crate::effort::RefineSteps;
use crate::error::Result;
use crate::refine::{Free, Part, Refining, RestCost};
use crate::refit::Refitted;

/// The fits of one file after another of the same scene.
pub(crate) struct Settling {
    refining: Refining,
    /// What the fit for the last file found, from which the fit for the next one begins.
    last: RefCell<Option<Radiance>>,
}

/// Fitted SH-rest, base colours and opacities.
struct Radiance {
    /// Index of each Gaussian in the scene, and its row in `splats`.
    rows: HashMap<usize, usize>,
    splats: Splats,
}

impl Radiance {
    /// Gives the Gaussians of `splats` their radiance. `sources` has their indices in the scene.
    fn give(&self, sources: impl Iterator<Item = usize>, splats: &mut Splats) {
        let rest = splats.degree.rest();
        for (i, source) in sources.enumerate() {
            let Some(&row) = self.rows.get(&source) else { continue };
            Appearance::of(&self.splats.geometry, row).give(&mut splats.geometry, i);
            splats.sh_rest[i * rest..(i + 1) * rest].copy_from_slice(self.splats.rest(row));
        }
    }
}

impl Settling {
    pub(crate) fn new(refining: Refining) -> Self {
        Self { refining, last: RefCell::default() }
    }

    /// Fits the SH-rest, the base colours and the opacities of `model`, a file of `quantised` at an overall `step`. Codes the
    /// SH-rest, and then fits base colours and opacities once more.
    ///
    /// # Errors
    /// Errors of packing and drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(crate) fn refit<'a>(
        &self,
        step: f64,
        quantised: &Quantised<'a>,
        mut model: Splats,
        progress: &dyn Progress,
    ) -> Result<Refitted<'a>> {
        let RefineSteps { radiance, again, appearance, .. } = self.refining.steps;
        let sources = || quantised.source_indices();
        let cost = RestCost::new(quantised.sensitivities().iter().map(|s| s.colour), step);
        let part = match self.last.take() {
            Some(last) => {
                last.give(sources(), &mut model);
                Part { from: radiance.saturating_sub(again), of: radiance }
            }
            None => Part::whole(radiance),
        };
        self.refining.refine(&mut model, Free::Radiance, part, &cost, progress)?;
        let fitted = quantised.with_sh_rest(&model.sh_rest, progress)?;
        let shown = appearances(&model.geometry);
        let rows = sources().zip(0..).collect();
        self.last.replace(Some(Radiance { rows, splats: model }));
        let mut model = fitted.finish(Some(&shown), None, progress)?.0.unpack()?.into_splats();
        for (i, shown) in shown.into_iter().enumerate() {
            shown.give(&mut model.geometry, i);
        }
        self.refining.refine(&mut model, Free::Appearance, Part::whole(appearance), &cost, progress)?;
        let shown = appearances(&model.geometry);
        let file = fitted.finish(Some(&shown), None, progress)?;
        Ok(Refitted { shown: Some(shown), again: Some(fitted), file })
    }
}

fn appearances(geometry: &Geometry) -> Vec<Appearance> {
    let shown = |i| {
        let shown = Appearance::of(geometry, i);
        Appearance { log_opacity: shown.log_opacity.min(0.0), ..shown }
    };
    (0..geometry.len()).map(shown).collect()
}
