//! Drawing the two models, on the GPU or the CPU, to buffers that the window can show.

mod cpu;
mod gpu;

use std::sync::Arc;

use lexisplat_render::gpu::readback;
use lexisplat_render::{Camera, Image, RenderOptions};

use crate::command::Slot;
use crate::error::Result;
use crate::models::OpenModel;

pub(crate) use cpu::CpuSceneRenderer;
pub(crate) use gpu::GpuSceneRenderer;

/// Something that draws the two models.
pub(crate) trait SceneRenderer: Send {
    /// Returns the name that the panel shows.
    fn name(&self) -> String;

    /// Replaces the model of `slot`.
    ///
    /// # Errors
    /// If the scene does not fit on the device.
    fn set(&mut self, slot: Slot, model: Option<Arc<OpenModel>>) -> Result<()>;

    /// Draws the model of `slot`.
    ///
    /// # Errors
    /// If there is no such model, the camera is not valid, or the device fails.
    fn draw(&mut self, slot: Slot, camera: &Camera, options: &RenderOptions) -> Result<Picture>;

    /// Returns the bytes of models and work buffers on the device, without the pictures returned.
    fn resident_bytes(&self) -> u64;
}

/// A picture on the device, and statistics of drawing it.
#[derive(Debug)]
pub(crate) struct Picture {
    /// Red, green, blue and 1 as f32 for each of `width * height` pixels, row by row; not clamped.
    pub(crate) pixels: wgpu::Buffer,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Number of Gaussians that may touch the picture.
    pub(crate) gaussians: usize,
    /// Milliseconds of each stage.
    pub(crate) stage_times: Vec<(&'static str, f64)>,
    /// The same picture in memory, if the CPU drew it.
    pub(crate) image: Option<Image>,
}

impl Picture {
    /// Returns the picture in memory.
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
