//! What measuring sensitivities needs besides drawing: moments of every entry of the tiles' lists.

use crate::cpu::Moments;
use crate::error::Result;

use super::device::{Buffer, Gpu};
use super::shaders::{kernel, pipeline};
use super::work::{Room, WORD};

/// Most bytes of moments at once, unless one row of tiles needs more than a kernel sees: 1 GiB.
const MAX_BYTES: u64 = 1 << 30;
/// Bytes of one splat's moments.
pub(super) const MOMENTS_BYTES: u64 = size_of::<Moments>() as u64;

/// Kernels that only measuring runs.
#[derive(Debug, Clone)]
pub(super) struct MomentKernels {
    pub(super) slots_of_entries: wgpu::ComputePipeline,
    pub(super) tile_moments: wgpu::ComputePipeline,
    pub(super) gather_moments: wgpu::ComputePipeline,
}

impl MomentKernels {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            slots_of_entries: pipeline(gpu, &kernel(gpu, "slots_of_entries")?, "slots_of_entries")?,
            tile_moments: pipeline(gpu, &kernel(gpu, "moments")?, "tile_moments")?,
            gather_moments: pipeline(gpu, &kernel(gpu, "gather_moments")?, "gather_moments")?,
        })
    }
}

/// Entries that may have moments at once.
pub(super) fn most_entries(gpu: &Gpu) -> u64 {
    gpu.max_binding().min(MAX_BYTES) / MOMENTS_BYTES
}

/// Slots that may have moments.
pub(super) fn most_slots(gpu: &Gpu) -> u64 {
    gpu.max_binding() / MOMENTS_BYTES
}

/// Buffers that only measuring needs.
#[derive(Debug)]
pub(super) struct MomentBuffers {
    /// Slots of the entries as listed: sorted are the entries' places in the lists.
    pub(super) listed_slots: Buffer,
    /// Of each entry, in the order they are listed in.
    pub(super) of_entries: Buffer,
    /// Of each slot.
    pub(super) of_slots: Buffer,
    pub(super) of_slots_back: Buffer,
    pub(super) gaussians_back: Buffer,
}

impl MomentBuffers {
    pub(super) fn new(gpu: &Gpu, room: Room) -> Result<Self> {
        use wgpu::BufferUsages as U;
        let [slots, entries] = [room.slots, room.entries].map(u64::from);
        let back = |label: &str, size: u64| gpu.buffer(label, size, U::MAP_READ | U::COPY_DST);
        Ok(Self {
            listed_slots: gpu.storage("listed slots", entries * WORD)?,
            of_entries: gpu.storage("moments of entries", entries * MOMENTS_BYTES)?,
            of_slots: gpu.storage("moments of slots", slots * MOMENTS_BYTES)?,
            of_slots_back: back("moments of slots back", slots * MOMENTS_BYTES)?,
            gaussians_back: back("gaussians back", slots * WORD)?,
        })
    }
}
