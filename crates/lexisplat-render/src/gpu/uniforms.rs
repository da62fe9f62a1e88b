//! Small structures that kernels read. They are laid out as in `frame.wgsl`, `scan.wgsl` and `sort.wgsl`, which
//! describe the fields.

use bytemuck::{Pod, Zeroable};

/// Values that are the same for a whole picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FrameUniform {
    pub(super) right: [f32; 3],
    pub(super) degree: u32,
    pub(super) down: [f32; 3],
    pub(super) columns: u32,
    pub(super) forward: [f32; 3],
    pub(super) rows: u32,
    pub(super) position: [f32; 3],
    pub(super) antialiased: u32,
    pub(super) background: [f32; 3],
    pub(super) slots: u32,
    pub(super) tangents: [f32; 2],
    pub(super) focal: [f32; 2],
    pub(super) size: [f32; 2],
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) blocks: u32,
    pub(super) chunks: u32,
    pub(super) entries: u32,
    /// View-space z beyond which something is drawn.
    pub(super) near: f32,
}

/// A part of the scene that fits in one binding.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ChunkUniform {
    pub(super) first: u32,
    pub(super) count: u32,
    pub(super) first_block: u32,
    pub(super) blocks: u32,
    pub(super) escapes_at: u32,
    pub(super) escapes: u32,
    pub(super) exact_at: u32,
    pub(super) padding: u32,
}

/// Rows of tiles drawn at once.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Band {
    pub(super) first: u32,
    pub(super) rows: u32,
    pub(super) tiles: u32,
    pub(super) padding: u32,
}

/// The length of a scan: what a counter says, or `fixed_length` if that is not 0.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Scan {
    pub(super) counter: u32,
    pub(super) fixed_length: u32,
    pub(super) padding: [u32; 2],
}

/// One pass of a sort.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Pass {
    pub(super) shift: u32,
    pub(super) length: u32,
    pub(super) blocks: u32,
    pub(super) identity: u32,
}

/// How many pixels of two pictures are compared, laid out as in `squared_error.wgsl`.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Extent {
    pub(super) pixels: u32,
    pub(super) first_sum: u32,
    pub(super) padding: [u32; 2],
}
