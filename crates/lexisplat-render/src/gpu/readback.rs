//! Copies bytes of GPU buffers to the processor.

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::wait::answer;

use super::buffer::OwnedBuffer;

/// Returns a buffer of `size` bytes. The GPU copies to it, and [`read_async`] reads it.
#[must_use]
pub fn target(device: &wgpu::Device, size: u64) -> OwnedBuffer {
    let target = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    target.into()
}

/// Returns the first `size` bytes of `target`, a whole number of `T`, once all submitted work that uses it is
/// done. Outside of a browser something must poll the device meanwhile, as [`read`] does.
///
/// # Errors
/// [`Error::Gpu`] if the buffer cannot be mapped: its usage lacks `MAP_READ`, or the device is lost.
pub async fn read_async<T: Pod>(target: &wgpu::Buffer, size: u64) -> Result<Vec<T>> {
    if size == 0 {
        return Ok(Vec::new());
    }
    let failed = |error: &dyn std::fmt::Display| Error::Gpu { problem: format!("reading back: {error}") };
    let (give, mapped) = answer();
    let slice = target.slice(..size);
    slice.map_async(wgpu::MapMode::Read, give);
    mapped.await.map_err(|error| failed(&error))?;
    let values = slice.get_mapped_range().map(|view| bytemuck::pod_collect_to_vec(&view));
    target.unmap();
    values.map_err(|error| failed(&error))
}

/// Waits until `device` has done all its work and called the callbacks.
#[cfg(not(target_family = "wasm"))]
pub(super) fn poll(device: &wgpu::Device) -> Result<()> {
    let polled = device.poll(wgpu::PollType::wait_indefinitely());
    polled.map(|_| ()).map_err(|error| Error::Gpu { problem: error.to_string() })
}

/// Returns the contents of a buffer made by [`target`], once all submitted work that uses it is done. Blocks until then.
///
/// # Errors
/// As [`read_async`].
#[cfg(not(target_family = "wasm"))]
pub fn read<T: Pod>(device: &wgpu::Device, target: &wgpu::Buffer) -> Result<Vec<T>> {
    crate::wait::block_on(|| poll(device), read_async(target, target.size()))
}

/// Copies `source`, which must allow `COPY_SRC`, and returns its contents once all work submitted before is done. Blocks
/// until then.
///
/// # Errors
/// As [`read_async`].
#[cfg(not(target_family = "wasm"))]
pub fn read_buffer<T: Pod>(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    source: &wgpu::Buffer,
) -> Result<Vec<T>> {
    let mapped = target(device, source.size());
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(source, 0, &mapped, 0, source.size());
    queue.submit([encoder.finish()]);
    read(device, &mapped)
}
