//! Capacity of the buffers for drawing, and the sizes of their elements.

/// Number of bytes of a 32-bit word.
pub(super) const WORD: u64 = 4;
/// Number of bytes of a pixel: four floats.
pub(super) const PIXEL: u64 = 16;
/// Number of bytes of the largest element of arrays with one element for each slot: those of centres and conics.
pub(super) const SLOT_ELEMENT: u64 = 16;
/// Number of bytes of an element of arrays with one element for each entry.
pub(super) const ENTRY_ELEMENT: u64 = WORD;

/// Capacity of the buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Capacity {
    /// Number of blocks of Gaussians of the scene.
    pub(super) blocks: u32,
    /// Number of chunks of the scene.
    pub(super) chunks: u32,
    /// Number of Gaussians that may be visible.
    pub(super) slots: u32,
    /// Number of entries in the tile lists of a band.
    pub(super) entries: u32,
    /// Number of tiles of a band.
    pub(super) tiles: u32,
    /// Number of pixels of the picture.
    pub(super) pixels: u64,
}
