//! Buffers that drawing needs besides the scene: as large as the fullest view so far.

use crate::error::Result;

use super::constants::{COUNTERS, DIGITS, Dispatch, GROUP, SCAN_BLOCK, SORT_BLOCK};
use super::device::{Buffer, Gpu};
use super::moments::MomentBuffers;
use super::uniforms::Frame;

/// How much there is room for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Room {
    /// Gaussians of the scene, in blocks.
    pub(super) blocks: u32,
    /// Chunks of the scene.
    pub(super) chunks: u32,
    /// Gaussians that may be seen.
    pub(super) slots: u32,
    /// Entries in the tiles' lists of a band.
    pub(super) entries: u32,
    /// Tiles of a band.
    pub(super) tiles: u32,
    /// Pixels of the picture.
    pub(super) pixels: u64,
}

/// The buffers.
#[derive(Debug)]
pub(super) struct Work {
    pub(super) room: Room,
    pub(super) frame: Buffer,
    pub(super) masks: Buffer,
    pub(super) starts: Buffer,
    pub(super) counters: Buffer,
    pub(super) dispatches: Buffer,
    /// Sums of scanned blocks.
    pub(super) sums: Buffer,
    pub(super) gaussians: Buffer,
    pub(super) centres: Buffer,
    pub(super) conics: Buffer,
    pub(super) rects: Buffer,
    pub(super) colours: Buffer,
    pub(super) offsets: Buffer,
    pub(super) histogram: Buffer,
    /// Depth keys and slots, from one and into the other in turn.
    pub(super) slot_keys: [Buffer; 2],
    pub(super) slot_values: [Buffer; 2],
    /// Tiles and slots, likewise.
    pub(super) entry_keys: [Buffer; 2],
    pub(super) entry_values: [Buffer; 2],
    pub(super) ranges: Buffer,
    pub(super) pixels: Buffer,
    pub(super) counters_back: Buffer,
    /// Only while measuring.
    pub(super) moments: Option<MomentBuffers>,
}

/// Bytes of a word.
pub(super) const WORD: u64 = 4;
/// Bytes of a pixel: four floats.
pub(super) const PIXEL: u64 = 16;
/// Largest element of an array with one element a slot, in bytes: the centres' and conics'.
pub(super) const SLOT_ELEMENT: u64 = 16;
/// Of an array with one element an entry.
pub(super) const ENTRY_ELEMENT: u64 = WORD;

impl Work {
    pub(super) fn new(gpu: &Gpu, room: Room, measuring: bool) -> Result<Self> {
        use wgpu::BufferUsages as U;
        let words = |label: &str, n: u64| gpu.storage(label, n * WORD);
        let [blocks, slots, entries] = [room.blocks, room.slots, room.entries].map(u64::from);
        let most = slots.max(entries);
        let histogram = most.div_ceil(SORT_BLOCK.into()) * u64::from(DIGITS);
        let longest = histogram.max(slots + 1).max(blocks + 1);
        let dispatches = 3 * (Dispatch::Chunks as u64 + u64::from(room.chunks));
        let pair = |label: &str, n: u64| Ok::<_, crate::error::Error>([words(label, n)?, words(label, n)?]);
        Ok(Self {
            room,
            frame: gpu.uniform("frame", &Frame::default())?,
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
            ranges: words("ranges", 2 * u64::from(room.tiles))?,
            pixels: gpu.storage("pixels", room.pixels * PIXEL)?,
            counters_back: gpu.buffer("counters back", COUNTERS as u64 * WORD, U::MAP_READ | U::COPY_DST)?,
            moments: measuring.then(|| MomentBuffers::new(gpu, room)).transpose()?,
        })
    }
}
