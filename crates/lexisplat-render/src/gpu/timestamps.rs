//! Times compute passes by the clock of the GPU.

use crate::error::Result;

use super::buffer::Buffer;
use super::device::Gpu;

/// Number of bytes of a timestamp.
const TIMESTAMP: u64 = 8;

/// Buffers for the start and end of a number of passes.
#[derive(Debug)]
pub(super) struct Timestamps {
    passes: u32,
    queries: wgpu::QuerySet,
    resolved: Buffer,
    back: Buffer,
    /// Duration of a tick, in milliseconds.
    tick: f64,
}

impl Timestamps {
    /// Makes buffers for `passes` passes; `None` if the GPU has no timestamps.
    pub(super) async fn new(gpu: &Gpu, passes: u32) -> Result<Option<Self>> {
        use wgpu::BufferUsages as U;
        if !gpu.device().features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let (count, bytes) = (2 * passes, u64::from(2 * passes) * TIMESTAMP);
        let descriptor =
            wgpu::QuerySetDescriptor { label: Some("passes"), ty: wgpu::QueryType::Timestamp, count };
        let make = || {
            Ok(Self {
                passes,
                queries: gpu.device().create_query_set(&descriptor),
                resolved: gpu.buffer("timestamps", bytes, U::QUERY_RESOLVE | U::COPY_SRC)?,
                back: gpu.readable("timestamps back", bytes)?,
                tick: f64::from(gpu.queue().get_timestamp_period()) / 1e6,
            })
        };
        gpu.checked("timestamps", make).await.map(Some)
    }

    /// Returns the descriptor that makes the GPU time a pass as number `pass`; `None` beyond the last number.
    pub(super) fn writes(&self, pass: u32) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        (pass < self.passes).then(|| wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * pass),
            end_of_pass_write_index: Some(2 * pass + 1),
        })
    }

    /// Makes the times of the first `passes` readable once `encoder`'s work is done.
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder, passes: u32) {
        encoder.resolve_query_set(&self.queries, 0..2 * passes, &self.resolved.raw, 0);
        let bytes = u64::from(2 * passes) * TIMESTAMP;
        encoder.copy_buffer_to_buffer(&self.resolved.raw, 0, &self.back.raw, 0, bytes);
    }

    /// Returns the start and end of the first `passes` passes, in milliseconds since the start of the first pass.
    pub(super) async fn read(&self, gpu: &Gpu, passes: u32) -> Result<Vec<[f64; 2]>> {
        let times: Vec<u64> = gpu.read(&self.back, u64::from(2 * passes) * TIMESTAMP).await?;
        let first = times.first().copied().unwrap_or(0);
        let since = |time: u64| time.saturating_sub(first) as f64 * self.tick;
        Ok(times.chunks_exact(2).map(|pair| [since(pair[0]), since(pair[1])]).collect())
    }
}
