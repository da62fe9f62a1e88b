//! Buffers for drawing, besides those of the scene. They are as large as the fullest view so far needed.

use crate::error::Result;

use super::buffer::Buffer;
use super::capacity::{Capacity, PIXEL, WORD};
use super::constants::{COUNTERS, DIGITS, Dispatch, GROUP, SCAN_BLOCK, SORT_BLOCK};
use super::device::Gpu;
use super::moments::MomentBuffers;
use super::uniforms::FrameUniform;

/// The buffers and their capacity.
#[derive(Debug)]
pub(super) struct Work {
    pub(super) capacity: Capacity,
    pub(super) frame: Buffer,
    pub(super) masks: Buffer,
    pub(super) starts: Buffer,
    pub(super) counters: Buffer,
    pub(super) dispatches: Buffer,
    /// Sums of the blocks of a scan.
    pub(super) sums: Buffer,
    pub(super) gaussians: Buffer,
    pub(super) centres: Buffer,
    pub(super) conics: Buffer,
    pub(super) rects: Buffer,
    pub(super) colours: Buffer,
    pub(super) offsets: Buffer,
    pub(super) histogram: Buffer,
    /// Depth keys; with them `slot_values` has the slots. Each pass of the sort reads one of the two buffers and writes
    /// the other.
    pub(super) slot_keys: [Buffer; 2],
    pub(super) slot_values: [Buffer; 2],
    /// Tiles; with them `entry_values` has the slots. They are sorted in the same way.
    pub(super) entry_keys: [Buffer; 2],
    pub(super) entry_values: [Buffer; 2],
    pub(super) ranges: Buffer,
    pub(super) pixels: Buffer,
    pub(super) counters_back: Buffer,
    /// Buffers for moments, which exist only while sensitivities are measured.
    pub(super) moments: Option<MomentBuffers>,
}

impl Work {
    /// Makes the buffers. If `measuring` is set, makes buffers for moments too.
    pub(super) async fn new(gpu: &Gpu, capacity: Capacity, measuring: bool) -> Result<Self> {
        gpu.checked("buffers for drawing", || Self::allocate(gpu, capacity, measuring)).await
    }

    fn allocate(gpu: &Gpu, capacity: Capacity, measuring: bool) -> Result<Self> {
        use wgpu::BufferUsages as U;
        let words = |label: &str, n: u64| gpu.storage(label, n * WORD);
        let [blocks, slots, entries] = [capacity.blocks, capacity.slots, capacity.entries].map(u64::from);
        let most = slots.max(entries);
        let histogram = most.div_ceil(SORT_BLOCK.into()) * u64::from(DIGITS);
        let longest = histogram.max(slots + 1).max(blocks + 1);
        let dispatches = 3 * (Dispatch::Chunks as u64 + u64::from(capacity.chunks));
        let pair = |label: &str, n: u64| -> Result<[Buffer; 2]> { Ok([words(label, n)?, words(label, n)?]) };
        Ok(Self {
            capacity,
            frame: gpu.uniform("frame", &FrameUniform::default())?,
            masks: words("masks", blocks * u64::from(GROUP / u32::BITS))?,
            starts: words("starts", blocks + 1)?,
            counters: words("counters", COUNTERS as u64)?,
            dispatches: gpu.buffer("dispatches", dispatches * WORD, U::STORAGE | U::INDIRECT)?,
            sums: words("sums", longest.div_ceil(SCAN_BLOCK.into()))?,
            gaussians: words("gaussians", slots)?,
            centres: words("centres", 4 * slots)?,
            conics: words("conics", 4 * slots)?,
            rects: words("rects", 2 * slots)?,
            colours: words("colours", 3 * slots)?,
            offsets: words("offsets", slots + 1)?,
            histogram: words("histogram", histogram)?,
            slot_keys: pair("slot keys", slots)?,
            slot_values: pair("slot values", slots)?,
            entry_keys: pair("entry keys", entries)?,
            entry_values: pair("entry values", entries)?,
            ranges: words("ranges", 2 * u64::from(capacity.tiles))?,
            pixels: gpu.storage("pixels", capacity.pixels * PIXEL)?,
            counters_back: gpu.readable("counters back", COUNTERS as u64 * WORD)?,
            moments: measuring.then(|| MomentBuffers::new(gpu, capacity)).transpose()?,
        })
    }
}
