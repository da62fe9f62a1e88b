//! Copying buffers from the graphics device to memory.

use std::sync::mpsc::channel;

use crate::error::{Error, Result};

/// Returns all bytes of `source`, which must allow `COPY_SRC`. Waits for all work submitted before.
///
/// # Errors
/// [`Error::Device`] if the device is lost or out of memory.
pub(crate) fn buffer(device: &wgpu::Device, queue: &wgpu::Queue, source: &wgpu::Buffer) -> Result<Vec<u8>> {
    let mapped = target(device, source.size());
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(source, 0, &mapped, 0, source.size());
    queue.submit([encoder.finish()]);
    read(device, &mapped)
}

/// Returns a buffer of `size` bytes for [`read`].
pub(crate) fn target(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

/// Waits for all work submitted, and returns the bytes of a [`target`].
///
/// # Errors
/// [`Error::Device`] if the device is lost or out of memory.
pub(crate) fn read(device: &wgpu::Device, target: &wgpu::Buffer) -> Result<Vec<u8>> {
    let (sender, done) = channel();
    target.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver waits below.
        let _ = sender.send(result);
    });
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(failed)?;
    done.recv().map_err(failed)?.map_err(failed)?;
    let bytes = target.get_mapped_range(..).map_err(failed)?.to_vec();
    target.unmap();
    Ok(bytes)
}

fn failed(error: impl std::fmt::Display) -> Error {
    Error::Device(error.to_string())
}
