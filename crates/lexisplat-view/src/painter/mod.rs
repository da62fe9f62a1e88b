//! Pictures of scenes, in buffers that the screen can show.

mod cpu;
mod gpu;

use std::sync::Arc;

use lexisplat_render::gpu::readback;
use lexisplat_render::{Camera, Image, RenderOptions};

use crate::command::Which;
use crate::error::Result;
use crate::models::Open;

pub(crate) use cpu::Cpu;
pub(crate) use gpu::OnGpu;

/// Draws the two models.
pub(crate) trait Painter: Send {
    /// What it is called in the panel.
    fn name(&self) -> String;

    /// What `which` is from now on.
    ///
    /// # Errors
    /// If the scene does not fit the device.
    fn set(&mut self, which: Which, model: Option<Arc<Open>>) -> Result<()>;

    /// Draws `which`.
    ///
    /// # Errors
    /// If it is not open, the camera cannot be drawn with, or the device fails.
    fn paint(&mut self, which: Which, camera: &Camera, options: &RenderOptions) -> Result<Painted>;

    /// Bytes that drawing takes on the device: models and work, without the pictures handed out.
    fn resident_bytes(&self) -> u64;
}

/// A picture on the device, and what drawing it took.
#[derive(Debug)]
pub(crate) struct Painted {
    /// `width * height` times red, green, blue and 1, as f32, row by row; not clamped.
    pub(crate) pixels: wgpu::Buffer,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Gaussians that may touch it.
    pub(crate) gaussians: usize,
    /// Milliseconds of each stage.
    pub(crate) stage_times: Vec<(&'static str, f64)>,
    /// The same picture off the device, where it has been there anyway.
    pub(crate) image: Option<Image>,
}

impl Painted {
    /// The picture off the device.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn to_image(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Image> {
        if let Some(image) = &self.image {
            return Ok(image.clone());
        }
        let pixels: Vec<[f32; 4]> = readback::read_buffer(device, queue, &self.pixels)?;
        let count = self.width as usize * self.height as usize;
        let pixels = pixels.into_iter().take(count).map(|[r, g, b, _]| [r, g, b]).collect();
        Ok(Image { width: self.width, height: self.height, pixels })
    }
}
