//! What measuring sensitivities needs besides drawing: the moments of every entry of the tiles' lists.

use crate::cpu::Moments;
use crate::error::Result;

use super::buffer::Buffer;
use super::device::Gpu;
use super::shaders::{kernel, pipeline};
use super::work::{Capacity, WORD};

/// Most bytes of moments at once: 1 GiB, or less where a kernel sees less.
const MAX_BYTES: u64 = 1 << 30;
/// Bytes of one splat's moments.
pub(super) const MOMENTS_BYTES: u64 = size_of::<Moments>() as u64;

/// Kernels that only measuring needs.
#[derive(Debug, Clone)]
pub(super) struct MomentKernels {
    pub(super) slots_of_entries: wgpu::ComputePipeline,
    pub(super) tile_moments: wgpu::ComputePipeline,
    pub(super) gather_moments: wgpu::ComputePipeline,
}

impl MomentKernels {
    pub(super) async fn new(gpu: &Gpu) -> Result<Self> {
        let one = |name: &str, entry: &str| pipeline(gpu, &kernel(gpu, name), entry);
        let make = || {
            Ok(Self {
                slots_of_entries: one("slots_of_entries", "slots_of_entries"),
                tile_moments: one("moments", "tile_moments"),
                gather_moments: one("gather_moments", "gather_moments"),
            })
        };
        gpu.checked("kernels", make).await
    }
}

/// The most entries that can have moments at once.
pub(super) fn most_entries(gpu: &Gpu) -> u64 {
    gpu.max_binding().min(MAX_BYTES) / MOMENTS_BYTES
}

/// The most slots that can have moments.
pub(super) fn most_slots(gpu: &Gpu) -> u64 {
    gpu.max_binding() / MOMENTS_BYTES
}

/// Buffers that only measuring needs.
#[derive(Debug)]
pub(super) struct MomentBuffers {
    /// The slot of each entry, in the order the entries are listed in. While measuring, the sort moves the
    /// entries' places in this list instead of their slots.
    pub(super) listed_slots: Buffer,
    /// The moments of each entry, in the order the entries are listed in.
    pub(super) of_entries: Buffer,
    /// The moments of each slot.
    pub(super) of_slots: Buffer,
    pub(super) of_slots_back: Buffer,
    pub(super) gaussians_back: Buffer,
}

impl MomentBuffers {
    pub(super) fn new(gpu: &Gpu, capacity: Capacity) -> Result<Self> {
        let [slots, entries] = [capacity.slots, capacity.entries].map(u64::from);
        Ok(Self {
            listed_slots: gpu.storage("listed slots", entries * WORD)?,
            of_entries: gpu.storage("moments of entries", entries * MOMENTS_BYTES)?,
            of_slots: gpu.storage("moments of slots", slots * MOMENTS_BYTES)?,
            of_slots_back: gpu.readable("moments of slots back", slots * MOMENTS_BYTES)?,
            gaussians_back: gpu.readable("gaussians back", slots * WORD)?,
        })
    }
}
