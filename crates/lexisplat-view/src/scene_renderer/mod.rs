//! Draws the two models, on the GPU or the CPU, to buffers that the window can show.

mod cpu;
mod gpu;

use std::sync::Arc;

use lexisplat_render::{Camera, Image, RenderOptions};

use crate::command::Slot;
use crate::error::Result;
use crate::models::OpenModel;
use crate::picture::Picture;

pub(crate) use cpu::CpuSceneRenderer;
pub(crate) use gpu::GpuSceneRenderer;

/// A renderer of the two models.
pub(crate) trait SceneRenderer: Send {
    /// Returns the name that the panel shows.
    fn name(&self) -> String;

    /// Replaces the model of `slot`.
    ///
    /// # Errors
    /// An error if the scene does not fit on the device.
    fn set(&mut self, slot: Slot, model: Option<Arc<OpenModel>>) -> Result<()>;

    /// Draws the model of `slot`.
    ///
    /// # Errors
    /// An error if there is no such model, the camera is not valid, or the device fails.
    fn draw(&mut self, slot: Slot, camera: &Camera, options: &RenderOptions) -> Result<DrawnPicture>;

    /// Returns the number of bytes of models and work buffers on the device, without the returned pictures.
    fn resident_bytes(&self) -> u64;
}

/// A picture on the device, and statistics of its drawing.
#[derive(Debug)]
pub(crate) struct DrawnPicture {
    pub(crate) picture: Picture,
    /// Number of Gaussians that may touch the picture.
    pub(crate) gaussians: usize,
    /// Duration of each stage, in milliseconds.
    pub(crate) stage_times: Vec<(&'static str, f64)>,
    /// The same picture in memory, if the CPU drew it.
    pub(crate) image: Option<Image>,
}

impl DrawnPicture {
    /// Returns the picture in memory.
    ///
    /// # Errors
    /// An error if the device fails.
    pub(crate) fn to_image(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Image> {
        match &self.image {
            Some(image) => Ok(image.clone()),
            None => self.picture.to_image(device, queue),
        }
    }
}
