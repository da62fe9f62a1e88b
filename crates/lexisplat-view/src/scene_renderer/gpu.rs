//! Draws by the GPU that also shows the window.

use std::sync::Arc;

use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Camera, RenderOptions};

use super::{DrawnPicture, SceneRenderer};
use crate::command::Slot;
use crate::error::{Error, Result};
use crate::models::OpenModel;
use crate::picture::Picture;

/// The rasteriser on the GPU. Compressed scenes stay sparse on it.
pub(crate) struct GpuSceneRenderer {
    gpu: Gpu,
    renderer: GpuRenderer,
    scenes: [Option<GpuScene>; 2],
}

impl GpuSceneRenderer {
    /// Returns a renderer on `gpu`.
    ///
    /// # Errors
    /// An error if the driver rejects a kernel.
    pub(crate) fn new(gpu: Gpu) -> Result<Self> {
        let renderer = GpuRenderer::new(&gpu)?;
        Ok(Self { gpu, renderer, scenes: [None, None] })
    }
}

impl SceneRenderer for GpuSceneRenderer {
    fn name(&self) -> String {
        self.gpu.summary().name.clone()
    }

    fn set(&mut self, slot: Slot, model: Option<Arc<OpenModel>>) -> Result<()> {
        let held = &mut self.scenes[slot.index()];
        // The old model is freed first, because there may be no memory for both.
        *held = None;
        if let Some(model) = model {
            let scene = model.scene.scene();
            *held = Some(GpuScene::new(&self.gpu, &scene, ShPath::of(&scene))?);
        }
        Ok(())
    }

    fn draw(&mut self, slot: Slot, camera: &Camera, options: &RenderOptions) -> Result<DrawnPicture> {
        let Some(scene) = &self.scenes[slot.index()] else {
            return Err(Error::Device(format!("there is no {slot:?} model to draw")));
        };
        let frame = self.renderer.draw(scene, camera, options)?;
        let (device, queue) = (self.gpu.device(), self.gpu.queue());
        let picture = Picture::copied(device, queue, &frame.pixels, frame.width, frame.height);
        let stages = frame.stats.stages.iter().map(|(stage, time)| (stage.name(), *time));
        Ok(DrawnPicture {
            picture,
            gaussians: frame.stats.visible as usize,
            stage_times: stages.collect(),
            image: None,
        })
    }

    fn resident_bytes(&self) -> u64 {
        self.gpu.bytes()
    }
}
