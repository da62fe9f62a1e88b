//! A scene in parts, drawn by the processor.

use std::collections::BTreeMap;

use crate::camera::Camera;
use crate::error::Result;
use crate::gpu::{PartGaussians, SceneBytes, SceneForm, ScenePart};
use crate::radiance::{Atoms, Radiance};

use super::clusters::Clusters;
use super::painting::{Painting, StageTimer};
use super::project::Projection;
use super::visible::Piece;
use super::workspace::Workspace;
use super::{Drawn, RenderOptions};

/// Largest number of entries in the lists of tiles between two steps of a picture, unless one row of tiles has more. A step takes
/// some hundredths of a second.
const ENTRIES_OF_STEP: u64 = 1 << 16;

/// A scene in parts on the processor, which are added and removed as in a [`GpuScene`](crate::gpu::GpuScene). Its pictures have the bits
/// of those that [`render`](crate::render) draws of the whole scene, if parts are numbered in the scene's order.
///
/// Pictures are drawn in steps, so that the caller can do something else in between, or begin another picture.
#[derive(Debug)]
pub struct CpuScene {
    form: SceneForm,
    atoms: Atoms,
    parts: BTreeMap<usize, Part>,
    workspace: Workspace,
    painting: Option<Painting>,
}

#[derive(Debug)]
struct Part {
    gaussians: PartGaussians,
    clusters: Clusters,
}

impl CpuScene {
    /// Makes a scene without Gaussians, to which [`Self::put`] adds parts of this `form`.
    #[must_use]
    pub fn new(form: SceneForm) -> Self {
        let atoms = Atoms::of(form.dictionary());
        Self { form, atoms, parts: BTreeMap::new(), workspace: Workspace::default(), painting: None }
    }

    /// Takes `part` as part number `index`. It replaces the part that has this number. A picture that is being drawn is
    /// dropped.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) if the part does not have the form of the scene, or has SH in 16
    /// bits; [`Error::Codec`](crate::Error::Codec) for codes that a scene cannot have. The scene is unchanged after an error.
    pub fn put(&mut self, index: usize, part: &ScenePart<'_>) -> Result<()> {
        let gaussians = part.gaussians(&self.form)?;
        let clusters = Clusters::of(&gaussians.geometry);
        self.painting = None;
        self.parts.insert(index, Part { gaussians, clusters });
        Ok(())
    }

    /// Removes part number `index`, if there is one. A picture that is being drawn is dropped.
    pub fn remove(&mut self, index: usize) {
        self.painting = None;
        self.parts.remove(&index);
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.parts.values().map(|part| part.gaussians.geometry.len()).sum()
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the numbers of bytes of the scene in memory, without what pictures are drawn in.
    #[must_use]
    pub fn bytes(&self) -> SceneBytes {
        let mut bytes = SceneBytes { geometry: 0, sh: self.atoms.bytes() };
        for part in self.parts.values() {
            let own = part.gaussians.bytes();
            bytes.geometry += own.geometry;
            bytes.sh += own.sh;
        }
        bytes
    }

    /// Begins a picture of the scene as `camera` sees it, in place of the one that was begun before.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) if the camera is not valid.
    pub fn begin(&mut self, camera: &Camera, options: &RenderOptions) -> Result<()> {
        camera.validate()?;
        self.painting = None;
        let stages = StageTimer::start();
        let projection = Projection::new(camera, self.form.antialiased());
        let degree = self.form.degree();
        let radiances: Vec<Radiance<'_>> = self
            .parts
            .values()
            .map(|part| part.gaussians.radiance(degree, &self.atoms).up_to(options.max_degree))
            .collect();
        let pieces = self.parts.values().zip(&radiances).map(|(part, radiance)| Piece {
            geometry: &part.gaussians.geometry,
            clusters: Some(&part.clusters),
            radiance,
        });
        let pieces: Vec<Piece<'_>> = pieces.collect();
        let workspace = &mut self.workspace;
        workspace.project_pieces(&pieces, &projection);
        self.painting = Some(Painting::begin(workspace, projection, options, ENTRIES_OF_STEP, stages));
        Ok(())
    }

    /// Draws some more rows of the picture that was begun. Returns the picture when it is whole; `None` before, and if
    /// no picture was begun.
    pub fn advance(&mut self) -> Option<Drawn> {
        if self.painting.as_mut()?.advance(&mut self.workspace) {
            return None;
        }
        self.painting.take().map(Painting::finish)
    }

    /// Returns whether a picture was begun and is not whole.
    #[must_use]
    pub fn is_drawing(&self) -> bool {
        self.painting.is_some()
    }
}
