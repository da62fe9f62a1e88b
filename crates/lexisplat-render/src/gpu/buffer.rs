//! GPU buffers. Their bytes are counted while they exist.

use bytemuck::Pod;
use wgpu::BufferUsages as Usages;

use crate::error::{Error, Result};

use super::counted::Counted;
use super::device::Gpu;

/// Smallest size of a buffer, in bytes: the size of the largest type in a binding.
const MIN_BUFFER: u64 = 256;
/// Number of bytes uploaded at once. wgpu holds a copy of each piece until the GPU has read it.
const UPLOAD_PIECE: usize = 32 << 20;

/// A buffer of wgpu whose memory is freed when this value is dropped and submitted work is done. A browser frees the memory of
/// a plain [`wgpu::Buffer`] only when it collects garbage, which it does not know to be large. Commands that use the buffer must
/// be submitted before it is dropped.
#[derive(Debug)]
pub struct OwnedBuffer(wgpu::Buffer);

impl From<wgpu::Buffer> for OwnedBuffer {
    fn from(buffer: wgpu::Buffer) -> Self {
        Self(buffer)
    }
}

impl std::ops::Deref for OwnedBuffer {
    type Target = wgpu::Buffer;

    fn deref(&self) -> &wgpu::Buffer {
        &self.0
    }
}

#[cfg(target_family = "wasm")]
impl Drop for OwnedBuffer {
    fn drop(&mut self) {
        self.0.destroy();
    }
}

/// A buffer on the GPU, whose bytes are counted.
#[derive(Debug)]
pub(super) struct Buffer {
    pub(super) raw: OwnedBuffer,
    counted: Counted,
}

impl Buffer {
    pub(super) fn bytes(&self) -> u64 {
        self.counted.size
    }
}

/// These methods make buffers without waiting. The [`checked`](Gpu::checked) call around them reports what the device
/// refuses.
impl Gpu {
    /// Makes a buffer of at least `size` bytes.
    pub(super) fn buffer(&self, label: &str, size: u64, usage: Usages) -> Result<Buffer> {
        // WebGPU refuses empty bindings, and copies only whole words.
        let size = size.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT).max(MIN_BUFFER);
        let limit = self.limits().max_buffer_size;
        if size > limit {
            return Err(Error::gpu_limit(format!("bytes of GPU buffer {label}"), size, limit));
        }
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        Ok(Buffer { raw: self.device().create_buffer(&descriptor).into(), counted: self.count(size) })
    }

    /// Makes a buffer that kernels read and write. It can be copied from and to.
    pub(super) fn storage(&self, label: &str, size: u64) -> Result<Buffer> {
        self.buffer(label, size, Usages::STORAGE | Usages::COPY_DST | Usages::COPY_SRC)
    }

    /// Makes a buffer that can be copied to and then read by the processor.
    pub(super) fn readable(&self, label: &str, size: u64) -> Result<Buffer> {
        self.buffer(label, size, Usages::MAP_READ | Usages::COPY_DST)
    }

    /// Makes a small buffer for uniforms.
    pub(super) fn uniform<T: Pod>(&self, label: &str, value: &T) -> Result<Buffer> {
        let buffer = self.buffer(label, size_of::<T>() as u64, Usages::UNIFORM | Usages::COPY_DST)?;
        self.queue().write_buffer(&buffer.raw, 0, bytemuck::bytes_of(value));
        Ok(buffer)
    }

    /// Makes a buffer with the contents `words`, for kernels to read.
    pub(super) async fn upload<T: Pod>(&self, label: &str, words: &[T]) -> Result<Buffer> {
        let bytes: &[u8] = bytemuck::cast_slice(words);
        let buffer = self.checked(label, || self.storage(label, bytes.len() as u64)).await?;
        self.write(&buffer, 0, bytes).await?;
        Ok(buffer)
    }

    /// Copies `bytes`, which are whole words, to `buffer` from byte `first` on. In a large upload the GPU reads each
    /// piece before the next piece is handed over, so that the copies held by wgpu do not accumulate.
    pub(super) async fn write(&self, buffer: &Buffer, first: u64, bytes: &[u8]) -> Result<()> {
        for (piece, at) in bytes.chunks(UPLOAD_PIECE).zip((first..).step_by(UPLOAD_PIECE)) {
            self.queue().write_buffer(&buffer.raw, at, piece);
            if bytes.len() > UPLOAD_PIECE {
                self.queue().submit([]);
                self.wait_async().await?;
            }
        }
        Ok(())
    }

    /// Makes an encoder, which records work for the queue.
    pub(super) fn encoder(&self) -> wgpu::CommandEncoder {
        self.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Returns the first `size` bytes of a [`readable`](Self::readable) buffer, once all submitted work is done.
    pub(super) async fn read<T: Pod>(&self, buffer: &Buffer, size: u64) -> Result<Vec<T>> {
        let values = super::readback::read_async(&buffer.raw, size).await;
        // An error of the submitted work explains why mapping failed, so it is returned first.
        self.take_failure()?;
        values
    }

    /// Copies a buffer made by [`Self::storage`] to the processor.
    #[cfg(test)]
    pub(super) fn read_back<T: Pod>(&self, buffer: &Buffer) -> Vec<T> {
        super::readback::read_buffer(self.device(), self.queue(), &buffer.raw).unwrap()
    }
}
