//! Moments of every entry of the tile lists. Measuring sensitivities needs them in addition to the buffers for drawing.

use crate::cpu::Moments;
use crate::error::Result;

use super::buffer::Buffer;
use super::capacity::{Capacity, WORD};
use super::device::Gpu;

/// Largest number of bytes of moments at once: 1 GiB, or less if a kernel can see less.
pub(super) const MAX_BYTES: u64 = 1 << 30;
/// Number of bytes of one splat's moments.
pub(super) const MOMENTS_BYTES: u64 = size_of::<Moments>() as u64;

/// The buffers that only measuring needs.
#[derive(Debug)]
pub(super) struct MomentBuffers {
    /// Slot of each entry, in the order in which the entries are listed. While sensitivities are measured, the sort moves
    /// the indices of entries in this list instead of their slots.
    pub(super) listed_slots: Buffer,
    /// Moments of each entry, in the order in which the entries are listed.
    pub(super) of_entries: Buffer,
    /// Moments of each slot.
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
