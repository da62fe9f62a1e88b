//! Compares two pictures on the GPU.

use std::num::NonZeroU64;

use crate::error::{Error, Result};

use super::capacity::{PIXEL, WORD};
use super::constants::{ERROR_PIXELS, GROUP};
use super::plan::dimensions;
use super::renderer::GpuRenderer;
use super::shaders::{all_from, bind};
use super::uniforms::Extent;

/// Number of pixels that a workgroup compares.
const GROUP_PIXELS: u32 = GROUP * ERROR_PIXELS;

impl GpuRenderer {
    /// Blocks on [`Self::squared_error_async`].
    ///
    /// # Errors
    /// As [`Self::squared_error_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn squared_error(&self, a: &wgpu::Buffer, b: &wgpu::Buffer, pixels: u32) -> Result<f64> {
        self.gpu.block_on(self.squared_error_async(a, b, pixels))
    }

    /// Returns the sum of the squared differences of all channels of two pictures, each clipped to 0..1. The result is
    /// within rounding of that of [`squared_error`](crate::squared_error()). Four bytes for every 4096 pixels are read
    /// back.
    ///
    /// `a` and `b` must be on the renderer's GPU. Each must begin with `pixels` pixels in the layout of
    /// [`Frame::pixels`](super::Frame::pixels).
    ///
    /// # Errors
    /// [`Error::Parameter`] if a buffer is shorter than `pixels` pixels; [`Error::Gpu`] if the device fails.
    pub async fn squared_error_async(&self, a: &wgpu::Buffer, b: &wgpu::Buffer, pixels: u32) -> Result<f64> {
        let gpu = &self.gpu;
        let size = u64::from(pixels) * PIXEL;
        if a.size().min(b.size()) < size {
            let expected = format!("buffers of at least {size} bytes");
            return Err(Error::parameter("pixels", pixels, expected));
        }
        // A piece fits in a binding, and begins at an offset that WebGPU allows.
        let fit = u32::try_from(gpu.max_binding() / PIXEL).unwrap_or(u32::MAX);
        let piece = (fit / GROUP_PIXELS * GROUP_PIXELS).max(GROUP_PIXELS);
        let bytes = u64::from(pixels.div_ceil(GROUP_PIXELS)) * WORD;
        let (mut encoder, pipeline) = (gpu.encoder(), &self.kernels["squared_error"]);
        let make = || {
            let (sums, back) = (gpu.storage("sums of errors", bytes)?, gpu.readable("errors back", bytes)?);
            let mut uniforms = Vec::new();
            for first in (0..pixels).step_by(piece as usize) {
                let own = piece.min(pixels - first);
                let extent = Extent { pixels: own, first_sum: first / GROUP_PIXELS, padding: [0; 2] };
                let uniform = gpu.uniform("extent of errors", &extent)?;
                let (offset, size) = (u64::from(first) * PIXEL, NonZeroU64::new(u64::from(own) * PIXEL));
                let picture = |binding, buffer| {
                    let resource =
                        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset, size });
                    wgpu::BindGroupEntry { binding, resource }
                };
                let bound = all_from(0, [&uniform]).chain([picture(1, a), picture(2, b)]);
                let bound = bind(gpu, pipeline, bound.chain(all_from(3, [&sums])));
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &bound, &[]);
                let (x, y) = dimensions(own.div_ceil(GROUP_PIXELS));
                pass.dispatch_workgroups(x, y, 1);
                drop(pass);
                uniforms.push(uniform);
            }
            encoder.copy_buffer_to_buffer(&sums.raw, 0, &back.raw, 0, bytes);
            Ok((encoder.finish(), back, (sums, uniforms)))
        };
        // Buffers that commands use must live until these are submitted.
        let (commands, back, _used) = gpu.checked("squared errors", make).await?;
        gpu.queue().submit([commands]);
        let sums: Vec<f32> = gpu.read(&back, bytes).await?;
        Ok(sums.into_iter().map(f64::from).sum())
    }
}
