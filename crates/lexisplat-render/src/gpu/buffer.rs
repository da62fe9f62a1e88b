//! Buffers whose bytes are counted while they live.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use bytemuck::Pod;
use wgpu::BufferUsages as Usages;

use crate::error::{Error, Result};

use super::device::Gpu;

/// Smallest size of a buffer in bytes: that of the largest type in a binding.
const MIN_BUFFER: u64 = 256;
/// Bytes uploaded at once. wgpu holds a copy of each piece until the GPU has read it.
const UPLOAD_PIECE: usize = 32 << 20;

/// A buffer on the GPU.
#[derive(Debug)]
pub(super) struct Buffer {
    pub(super) raw: wgpu::Buffer,
    counted: Counted,
}

impl Buffer {
    pub(super) fn bytes(&self) -> u64 {
        self.counted.size
    }
}

/// Bytes on the GPU, counted until this is dropped.
#[derive(Debug)]
pub(super) struct Counted {
    pub(super) size: u64,
    total: Arc<AtomicU64>,
}

impl Counted {
    /// Adds `size` to `total`.
    pub(super) fn new(size: u64, total: &Arc<AtomicU64>) -> Self {
        total.fetch_add(size, Relaxed);
        Self { size, total: Arc::clone(total) }
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.total.fetch_sub(self.size, Relaxed);
    }
}

/// Buffers are made without waiting. What the device has against one is reported by the
/// [`checked`](Gpu::checked) around it.
impl Gpu {
    /// Makes a buffer of at least `size` bytes.
    pub(super) fn buffer(&self, label: &str, size: u64, usage: Usages) -> Result<Buffer> {
        // WebGPU refuses empty bindings, and copies whole words.
        let size = size.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT).max(MIN_BUFFER);
        let limit = self.limits().max_buffer_size;
        if size > limit {
            return Err(Error::gpu_limit(format!("bytes of GPU buffer {label}"), size, limit));
        }
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        Ok(Buffer { raw: self.device().create_buffer(&descriptor), counted: self.count(size) })
    }

    /// Makes a buffer that kernels read and write, and that can be copied from and to.
    pub(super) fn storage(&self, label: &str, size: u64) -> Result<Buffer> {
        self.buffer(label, size, Usages::STORAGE | Usages::COPY_DST | Usages::COPY_SRC)
    }

    /// Makes a buffer that can be copied to and read back.
    pub(super) fn readable(&self, label: &str, size: u64) -> Result<Buffer> {
        self.buffer(label, size, Usages::MAP_READ | Usages::COPY_DST)
    }

    /// Makes a small buffer of uniforms.
    pub(super) fn uniform<T: Pod>(&self, label: &str, value: &T) -> Result<Buffer> {
        let buffer = self.buffer(label, size_of::<T>() as u64, Usages::UNIFORM | Usages::COPY_DST)?;
        self.queue().write_buffer(&buffer.raw, 0, bytemuck::bytes_of(value));
        Ok(buffer)
    }

    /// Makes a buffer for kernels to read, with `words` in it.
    pub(super) async fn upload<T: Pod>(&self, label: &str, words: &[T]) -> Result<Buffer> {
        let bytes: &[u8] = bytemuck::cast_slice(words);
        let buffer = self.checked(label, || self.storage(label, bytes.len() as u64)).await?;
        self.write(&buffer, 0, bytes).await?;
        Ok(buffer)
    }

    /// Copies `bytes`, of whole words, to `buffer` from byte `first` on. Of large uploads the GPU reads each piece
    /// before the next is handed over, so that the copies that wgpu holds do not pile up.
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

    /// Makes what records work for the queue.
    pub(super) fn encoder(&self) -> wgpu::CommandEncoder {
        self.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// The first `size` bytes of a [`readable`](Self::readable) buffer, once all submitted work is done.
    pub(super) async fn read<T: Pod>(&self, buffer: &Buffer, size: u64) -> Result<Vec<T>> {
        let values = super::readback::read_async(&buffer.raw, size).await;
        // What the device had against the work explains why mapping failed.
        self.take_failure()?;
        values
    }

    /// Copies all of a buffer made by [`Self::storage`] and reads it.
    #[cfg(test)]
    pub(super) fn read_back<T: Pod>(&self, buffer: &Buffer) -> Vec<T> {
        super::readback::read_buffer(self.device(), self.queue(), &buffer.raw).unwrap()
    }
}
