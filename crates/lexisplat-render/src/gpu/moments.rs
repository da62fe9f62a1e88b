//! What measuring sensitivities needs besides drawing: the moments of every entry of the tiles' lists.

use crate::cpu::Moments;
use crate::error::Result;

use super::buffer::Buffer;
use super::device::Gpu;
use super::work::{Capacity, WORD};

/// Most bytes of moments at once: 1 GiB, or less where a kernel sees less.
pub(super) const MAX_BYTES: u64 = 1 << 30;
/// Bytes of one splat's moments.
pub(super) const MOMENTS_BYTES: u64 = size_of::<Moments>() as u64;

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
