//! Pictures by the processor.

use std::sync::Arc;

use lexisplat_render::{Camera, RenderOptions, render_measured};
use wgpu::util::DeviceExt;

use super::{Painted, Painter};
use crate::command::Which;
use crate::error::{Error, Result};
use crate::models::Open;

/// The reference rasteriser on the processor.
pub(crate) struct Cpu {
    device: wgpu::Device,
    models: [Option<Arc<Open>>; 2],
}

impl Cpu {
    pub(crate) fn new(device: wgpu::Device) -> Self {
        Self { device, models: [None, None] }
    }
}

impl Painter for Cpu {
    fn name(&self) -> String {
        "CPU".to_owned()
    }

    fn set(&mut self, which: Which, model: Option<Arc<Open>>) -> Result<()> {
        self.models[which.index()] = model;
        Ok(())
    }

    fn paint(&mut self, which: Which, camera: &Camera, options: &RenderOptions) -> Result<Painted> {
        let Some(model) = &self.models[which.index()] else {
            return Err(Error::Device(format!("no {which:?} model to draw")));
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
        Ok(Painted {
            pixels,
            width: image.width,
            height: image.height,
            gaussians: drawn.gaussians,
            stage_times: drawn.stage_times,
            image: Some(image),
        })
    }

    fn resident_bytes(&self) -> u64 {
        0
    }
}
