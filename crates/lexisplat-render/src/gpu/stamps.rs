//! Time stamps around compute passes.

use crate::error::Result;

use super::device::{Buffer, Gpu};

/// Bytes of a time stamp.
const STAMP: u64 = 8;

/// Room for the starts and ends of some passes.
#[derive(Debug)]
pub(super) struct Stamps {
    passes: u32,
    queries: wgpu::QuerySet,
    resolved: Buffer,
    back: Buffer,
    /// Milliseconds of a tick.
    tick: f64,
}

impl Stamps {
    /// Room for `passes`; `None` where the GPU has no time stamps.
    pub(super) fn new(gpu: &Gpu, passes: u32) -> Result<Option<Self>> {
        use wgpu::BufferUsages as U;
        if !gpu.device().features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(None);
        }
        let (count, bytes) = (2 * passes, u64::from(2 * passes) * STAMP);
        let descriptor =
            wgpu::QuerySetDescriptor { label: Some("passes"), ty: wgpu::QueryType::Timestamp, count };
        Ok(Some(Self {
            passes,
            queries: gpu.checked("time stamps", || gpu.device().create_query_set(&descriptor))?,
            resolved: gpu.buffer("time stamps", bytes, U::QUERY_RESOLVE | U::COPY_SRC)?,
            back: gpu.buffer("time stamps back", bytes, U::MAP_READ | U::COPY_DST)?,
            tick: f64::from(gpu.queue().get_timestamp_period()) / 1e6,
        }))
    }

    /// What a pass needs to be timed as number `pass`; `None` where there is no room.
    pub(super) fn writes(&self, pass: u32) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        (pass < self.passes).then(|| wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * pass),
            end_of_pass_write_index: Some(2 * pass + 1),
        })
    }

    /// Makes the stamps of the first `passes` ready to be read once `encoder`'s work is done.
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder, passes: u32) {
        encoder.resolve_query_set(&self.queries, 0..2 * passes, &self.resolved.raw, 0);
        let bytes = u64::from(2 * passes) * STAMP;
        encoder.copy_buffer_to_buffer(&self.resolved.raw, 0, &self.back.raw, 0, bytes);
    }

    /// Start and end of the first `passes`, in milliseconds since the first one's start.
    pub(super) fn read(&self, gpu: &Gpu, passes: u32) -> Result<Vec<[f64; 2]>> {
        let stamps: Vec<u64> = gpu.read(&self.back, u64::from(2 * passes) * STAMP)?;
        let first = stamps.first().copied().unwrap_or(0);
        let since = |stamp: u64| stamp.saturating_sub(first) as f64 * self.tick;
        Ok(stamps.chunks_exact(2).map(|pair| [since(pair[0]), since(pair[1])]).collect())
    }
}
