//! Draws by the CPU.

use std::sync::Arc;

use lexisplat_render::{Camera, RenderOptions, render_measured};
use wgpu::util::DeviceExt;

use super::{DrawnPicture, SceneRenderer};
use crate::command::Slot;
use crate::error::{Error, Result};
use crate::models::OpenModel;
use crate::picture::Picture;

/// The reference rasteriser on the CPU.
pub(crate) struct CpuSceneRenderer {
    device: wgpu::Device,
    models: [Option<Arc<OpenModel>>; 2],
}

impl CpuSceneRenderer {
    pub(crate) fn new(device: wgpu::Device) -> Self {
        Self { device, models: [None, None] }
    }
}

impl SceneRenderer for CpuSceneRenderer {
    fn name(&self) -> String {
        "CPU".to_owned()
    }

    fn set(&mut self, slot: Slot, model: Option<Arc<OpenModel>>) -> Result<()> {
        self.models[slot.index()] = model;
        Ok(())
    }

    fn draw(&mut self, slot: Slot, camera: &Camera, options: &RenderOptions) -> Result<DrawnPicture> {
        let Some(model) = &self.models[slot.index()] else {
            return Err(Error::Device(format!("there is no {slot:?} model to draw")));
        };
        let drawn = render_measured(&model.scene.scene(), camera, options)?;
        let image = drawn.image;
        let padded: Vec<[f32; 4]> = image.pixels.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect();
        let bytes: &[u8] = bytemuck::cast_slice(&padded);
        let most = self.device.limits().max_storage_buffer_binding_size;
        if bytes.len() as u64 > most {
            let size = format!("{} x {} pixels", image.width, image.height);
            return Err(Error::Device(format!("a picture of {size} is over its limit of {most} bytes")));
        }
        let pixels = self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("picture"),
            contents: bytes,
            usage: wgpu::BufferUsages::STORAGE,
        });
        Ok(DrawnPicture {
            picture: Picture { pixels: Arc::new(pixels.into()), width: image.width, height: image.height },
            gaussians: drawn.gaussians,
            stage_times: drawn.stage_times,
            image: Some(image),
        })
    }

    fn resident_bytes(&self) -> u64 {
        0
    }
}
