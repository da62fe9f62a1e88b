//! Drawing by the GPU that also shows the window.

use std::sync::Arc;

use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Camera, RenderOptions};

use super::{Picture, SceneRenderer};
use crate::command::Slot;
use crate::error::{Error, Result};
use crate::models::OpenModel;

/// The rasteriser on the GPU. Compressed scenes stay sparse on it.
pub(crate) struct GpuSceneRenderer {
    gpu: Gpu,
    renderer: GpuRenderer,
    scenes: [Option<GpuScene>; 2],
}

impl GpuSceneRenderer {
    /// # Errors
    /// If the driver rejects a kernel.
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
        let place = &mut self.scenes[slot.index()];
        // The old model is freed first: there may be no memory for both.
        *place = None;
        if let Some(model) = model {
            let scene = model.scene.scene();
            *place = Some(GpuScene::new(&self.gpu, &scene, ShPath::of(&scene))?);
        }
        Ok(())
    }

    fn draw(&mut self, slot: Slot, camera: &Camera, options: &RenderOptions) -> Result<Picture> {
        let Some(scene) = &self.scenes[slot.index()] else {
            return Err(Error::Device(format!("there is no {slot:?} model to draw")));
        };
        let frame = self.renderer.draw(scene, camera, options)?;
        // The renderer reuses its own buffer for the next picture.
        let size = u64::from(frame.width) * u64::from(frame.height) * size_of::<[f32; 4]>() as u64;
        let device = self.gpu.device();
        let pixels = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&frame.pixels, 0, &pixels, 0, size);
        self.gpu.queue().submit([encoder.finish()]);
        let stages = frame.stats.stages.iter().map(|(stage, time)| (stage.name(), *time));
        Ok(Picture {
            pixels,
            width: frame.width,
            height: frame.height,
            gaussians: frame.stats.visible as usize,
            stage_times: stages.collect(),
            image: None,
        })
    }

    fn resident_bytes(&self) -> u64 {
        self.gpu.bytes()
    }
}
