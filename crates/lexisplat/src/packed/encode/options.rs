//! Options of packing.

use serde::{Deserialize, Serialize};

use crate::scene::splats::all_finite;
use crate::support::builder::builder_methods;
use crate::support::error::{Error, Result};
use crate::support::limits::MAX_ATOMS;

/// Least number of Gaussians of a scene with two layers, by default. Smaller scenes have small files.
const LEAST_LAYERED: usize = 8000;
/// Most Gaussians of the first layer, with levels of detail, for [`PackOptions::lod`]. The number was chosen, not
/// measured: the layer is about half a megabyte.
pub const LOD_FIRST_LAYER: usize = 65_536;

/// Options of packing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PackOptions {
    /// Un-squared L2 norm that the SH-rest error of no Gaussian exceeds. By default there is none, and SH are as exact as
    /// pictures need.
    pub tolerance: Option<f64>,
    /// Number of atoms to learn, 1 to 1024. `None` lets the size of the scene decide.
    pub atoms: Option<usize>,
    /// Stores the index of each Gaussian in the source. Then no Gaussian is left out.
    pub keep_order: bool,
    /// Leaves no Gaussian out, and keeps base colours and opacities. A tolerance has the same effect.
    pub keep_all: bool,
    /// Seed of the learning sample.
    pub seed: u64,
    /// Up to 15 points from which the scene is seen. The file then holds the base colours that are seen from these points
    /// on average, so that colours are right without SH-rest too.
    pub points_of_view: Vec<[f32; 3]>,
    /// Least number of Gaussians of a scene with two layers. The first layer draws the whole scene coarsely. Smaller scenes
    /// have one layer. Default 8,000; `usize::MAX` for one layer always.
    pub layers_from: usize,
    /// Most Gaussians of the first layer, with levels of detail. A scene then has more layers, each of about five times
    /// as many Gaussians as the layers before it, so that readers draw distant Gaussians from few layers
    /// ([`Outline::select`](crate::packed::Outline::select)). docs/results/lod.md has their bytes. Default `None`: two
    /// layers.
    pub lod: Option<usize>,
}

impl Default for PackOptions {
    fn default() -> Self {
        Self {
            tolerance: None,
            atoms: None,
            keep_order: false,
            keep_all: false,
            seed: 0,
            points_of_view: Vec::new(),
            layers_from: LEAST_LAYERED,
            lod: None,
        }
    }
}

impl PackOptions {
    builder_methods!(
        with_tolerance(tolerance: impl Into<Option<f64>>),
        with_atoms(atoms: impl Into<Option<usize>>),
        with_keep_order(keep_order: bool),
        with_keep_all(keep_all: bool),
        with_seed(seed: u64),
        with_points_of_view(points_of_view: Vec<[f32; 3]>),
        with_layers_from(layers_from: usize),
        with_lod(lod: impl Into<Option<usize>>),
    );

    /// Returns whether packing may leave Gaussians out, and may change base colours and opacities to make up for errors.
    #[must_use]
    pub fn may_change(&self) -> bool {
        !self.keep_all && !self.keep_order && self.tolerance.is_none()
    }

    /// Refuses options out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the option.
    pub fn check(&self) -> Result<()> {
        if let Some(atoms) = self.atoms
            && !(1..=MAX_ATOMS).contains(&atoms)
        {
            return Err(Error::parameter("atoms", atoms, format!("1 to {MAX_ATOMS}")));
        }
        if self.lod == Some(0) {
            return Err(Error::parameter("lod", 0, "at least 1 Gaussian in the first layer"));
        }
        all_finite([("points_of_view", self.points_of_view.as_flattened())])?;
        if let Some(tol) = self.tolerance
            && (!tol.is_finite() || tol <= 0.0)
        {
            return Err(Error::parameter("tolerance", tol, "a finite number above 0"));
        }
        Ok(())
    }
}
