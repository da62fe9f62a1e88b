//! Small structs that kernels read. Their layout is that of `frame.wgsl`, `scan.wgsl` and `sort.wgsl`, which describe the
//! fields.

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
    /// Near plane: only Gaussians of larger view-space z are drawn.
    pub(super) near: f32,
}

/// A chunk of the scene, which fits in one binding.
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

/// Rows of tiles that are drawn together.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Band {
    pub(super) first: u32,
    pub(super) rows: u32,
    pub(super) tiles: u32,
    pub(super) padding: u32,
}

/// Length of a scan: the value of a counter, or `fixed_length` if `fixed_length` is not 0.
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

/// Number of pixels of two pictures that are compared, with the layout of `squared_error.wgsl`.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Extent {
    pub(super) pixels: u32,
    pub(super) first_sum: u32,
    pub(super) padding: [u32; 2],
}
