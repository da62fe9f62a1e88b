//! A picture on the graphics device.

use std::sync::Arc;

use lexisplat_render::Image;
use lexisplat_render::gpu::{OwnedBuffer, readback};

use crate::error::Result;

/// Number of bytes of a pixel: red, green, blue and 1, each as f32.
const PIXEL: u64 = size_of::<[f32; 4]>() as u64;

/// A picture in a buffer of the device. Clones share the buffer.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Red, green, blue and 1, each as f32, for each of `width * height` pixels, row by row; not clamped. The usage of
    /// the buffer is at least `STORAGE`.
    pub pixels: Arc<OwnedBuffer>,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

impl Picture {
    /// Returns a copy of the first `width * height` pixels of `pixels`, which must allow `COPY_SRC`. A copy is needed
    /// because a renderer reuses its buffer for the next picture.
    #[must_use]
    pub fn copied(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        pixels: &wgpu::Buffer,
        width: u32,
        height: u32,
    ) -> Self {
        let size = u64::from(width) * u64::from(height) * PIXEL;
        let copy = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(pixels, 0, &copy, 0, size);
        queue.submit([encoder.finish()]);
        Self { pixels: Arc::new(copy.into()), width, height }
    }

    /// Copies the picture to memory. Its buffer must allow `COPY_SRC`. Outside of a browser something must poll the
    /// device meanwhile.
    ///
    /// # Errors
    /// [`Error::Render`](crate::Error::Render) if the device is lost.
    pub async fn to_image_async(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Image> {
        let size = u64::from(self.width) * u64::from(self.height) * PIXEL;
        let target = readback::target(device, size);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.pixels, 0, &target, 0, size);
        queue.submit([encoder.finish()]);
        Ok(self.image(readback::read_async(&target, size).await?))
    }

    /// Copies like [`Self::to_image_async`], and blocks.
    ///
    /// # Errors
    /// As [`Self::to_image_async`].
    #[cfg(feature = "window")]
    pub(crate) fn to_image(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Image> {
        Ok(self.image(readback::read_buffer(device, queue, &self.pixels)?))
    }

    fn image(&self, pixels: Vec<[f32; 4]>) -> Image {
        let count = self.width as usize * self.height as usize;
        let pixels = pixels.into_iter().take(count).map(|[r, g, b, _]| [r, g, b]).collect();
        Image { width: self.width, height: self.height, pixels }
    }
}
