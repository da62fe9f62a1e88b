//! Plans a picture: the kernels that run, their order, and their buffers.

use std::num::NonZeroU64;
use std::sync::{Arc, Weak};

use crate::error::Result;
use crate::gpu_report::DrawStage;

use super::buffer::Buffer;
use super::capacity::PIXEL;
use super::chunks::ChunkBuffers;
use super::constants::{Counter, DIGIT_BITS, Dispatch, MAX_GROUPS, SCAN_BLOCK};
use super::device::Gpu;
use super::scene::GpuScene;
use super::shaders::{Kernels, all_from, bind};
use super::uniforms::{Band, ChunkUniform, Pass, Scan};
use super::work::Work;

use crate::conventions::TILE;

/// The properties of a picture that its plan depends on, besides the scene and the buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    /// Number of columns of tiles.
    pub(super) columns: u32,
    /// Number of rows of tiles.
    pub(super) rows: u32,
    /// Width in pixels.
    pub(super) width: u32,
    /// Height in pixels.
    pub(super) height: u32,
    /// Number of rows of tiles that are drawn together.
    pub(super) band_rows: u32,
    /// Whether each band searches for its own Gaussians, because the Gaussians of all bands do not fit at once.
    pub(super) bands_see: bool,
    /// Number of significant bits of depth keys.
    pub(super) depth_bits: u32,
}

/// All kernels of one picture, in order, with their bindings.
pub(super) struct Plan {
    pub(super) shape: Shape,
    pub(super) scene: u64,
    scene_lives: Weak<()>,
    pub(super) passes: Vec<StagePass>,
    /// Uniform buffers that the bindings refer to.
    _uniforms: Vec<Buffer>,
}

/// The steps of one stage, in one compute pass.
pub(super) struct StagePass {
    pub(super) stage: DrawStage,
    pub(super) steps: Vec<Step>,
}

/// One dispatch of a kernel.
pub(super) struct Step {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) bindings: wgpu::BindGroup,
    pub(super) size: Size,
}

/// The number of workgroups of a dispatch.
pub(super) enum Size {
    /// A fixed number.
    Groups(u32),
    /// A number that the GPU computes. The value is its offset in the buffer of dispatches, in bytes.
    Indirect(u64),
}

/// Number of bytes of a dispatch's arguments: three words.
const ARGUMENTS: u64 = 12;

impl Size {
    /// Returns the size with a lane for each slot of chunk `k`.
    fn chunk(k: u64) -> Self {
        Self::Indirect((Dispatch::Chunks as u64 + k) * ARGUMENTS)
    }

    fn of(dispatch: Dispatch) -> Self {
        Self::Indirect(dispatch as u64 * ARGUMENTS)
    }
}

#[cfg(test)]
#[path = "tests/scan_sort.rs"]
mod tests;

/// The buffers of a sort, and the offsets of the numbers that it needs.
struct Sorting<'a> {
    keys: [&'a Buffer; 2],
    values: [&'a Buffer; 2],
    /// Number of significant bits of the keys.
    bits: u32,
    length: Counter,
    blocks: Counter,
    digits: Counter,
    groups: Dispatch,
    scan_groups: Dispatch,
    /// Whether the values begin as the indices of their keys. The buffer of values is then not read.
    identity: bool,
}

/// Distance of the uniforms of neighbouring chunks, in bytes (WebGPU's `minUniformBufferOffsetAlignment`).
const UNIFORM_STRIDE: usize = 256;

/// The numbers that describe the chunks of a scene to kernels. They belong to the plan, so that a scene whose parts
/// change often makes them only for the pictures that are drawn.
struct Chunks<'a> {
    all: Vec<&'a ChunkBuffers>,
    /// One [`ChunkUniform`] for each [`UNIFORM_STRIDE`] bytes.
    uniforms: Buffer,
    /// First block of each chunk, and the end of the last chunk.
    blocks: Buffer,
}

impl<'a> Chunks<'a> {
    fn new(gpu: &Gpu, scene: &'a GpuScene) -> Result<Self> {
        let numbering = scene.numbering();
        let mut bytes = vec![0; numbering.len() * UNIFORM_STRIDE];
        for (out, uniform) in bytes.chunks_exact_mut(UNIFORM_STRIDE).zip(&numbering) {
            let uniform = bytemuck::bytes_of(uniform);
            out[..uniform.len()].copy_from_slice(uniform);
        }
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniforms = gpu.buffer("chunks", bytes.len() as u64, usage)?;
        gpu.queue().write_buffer(&uniforms.raw, 0, &bytes);
        let ends = numbering.iter().map(|chunk| chunk.first_block + chunk.blocks);
        let starts: Vec<u32> = std::iter::once(0).chain(ends).collect();
        let blocks = gpu.storage("chunk blocks", size_of_val(starts.as_slice()) as u64)?;
        gpu.queue().write_buffer(&blocks.raw, 0, bytemuck::cast_slice(&starts));
        Ok(Self { all: scene.chunks().collect(), uniforms, blocks })
    }

    /// Returns the chunks in order, each with the binding of its uniform.
    fn each(&self) -> impl Iterator<Item = (&'a ChunkBuffers, wgpu::BindGroupEntry<'_>)> {
        let entry = |offset| wgpu::BindGroupEntry {
            binding: 1,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &self.uniforms.raw,
                offset,
                size: NonZeroU64::new(size_of::<ChunkUniform>() as u64),
            }),
        };
        self.all.iter().copied().zip((0..).step_by(UNIFORM_STRIDE).map(entry))
    }
}

struct Planner<'a> {
    gpu: &'a Gpu,
    kernels: &'a Kernels,
    work: &'a Work,
    uniforms: Vec<Buffer>,
    steps: Vec<Step>,
    passes: Vec<StagePass>,
}

impl Plan {
    /// Plans pictures of `scene` with this `shape`, drawn with the buffers in `work`.
    pub(super) async fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        scene: &GpuScene,
        work: &Work,
        shape: Shape,
    ) -> Result<Self> {
        let planner =
            Planner { gpu, kernels, work, uniforms: Vec::new(), steps: Vec::new(), passes: Vec::new() };
        gpu.checked("bindings", || planner.plan(scene, shape)).await
    }

    /// Returns whether the scene of the plan still exists and has the same parts.
    pub(super) fn is_of_use(&self) -> bool {
        self.scene_lives.strong_count() > 0
    }
}

impl Planner<'_> {
    fn plan(mut self, scene: &GpuScene, shape: Shape) -> Result<Plan> {
        let chunks = Chunks::new(self.gpu, scene)?;
        let mut by_depth = 0;
        for first in (0..shape.rows).step_by(shape.band_rows as usize) {
            let rows = shape.band_rows.min(shape.rows - first);
            if shape.bands_see {
                by_depth = self.see(scene, &chunks, shape, [first, rows])?;
            } else if first == 0 {
                by_depth = self.see(scene, &chunks, shape, [0, shape.rows])?;
            }
            self.band(shape, &self.work.slot_values[by_depth], first, rows)?;
        }
        let scene_lives = Arc::downgrade(&scene.lives);
        self.uniforms.extend([chunks.uniforms, chunks.blocks]);
        Ok(Plan { shape, scene: scene.id, scene_lives, passes: self.passes, _uniforms: self.uniforms })
    }

    /// Plans to find, project, colour and order the Gaussians that may be visible in some rows of tiles, given by the
    /// first row and the number of rows. Returns which of the two buffers has the ordered slots.
    fn see(
        &mut self,
        scene: &GpuScene,
        chunks: &Chunks<'_>,
        shape: Shape,
        [first, rows]: [u32; 2],
    ) -> Result<usize> {
        let (work, kernels) = (self.work, self.kernels);
        let tiles = rows * shape.columns;
        let band = self.gpu.uniform("rows in view", &Band { first, rows, tiles, padding: 0 })?;
        for (chunk, uniform) in chunks.each() {
            let bound = all_from(2, [&chunk.bodies, &work.masks, &work.starts, &band]);
            let bound = all_from(0, [&work.frame]).chain([uniform]).chain(bound);
            self.step(&kernels["cull"], bound, Size::Groups(chunk.blocks()));
        }
        self.scan(&work.starts, Counter::Found, Some(scene.blocks() + 1), None)?;
        let bound = [&work.frame, &work.masks, &work.starts, &work.gaussians];
        self.step(&kernels["compact"], all_from(0, bound), Size::Groups(scene.blocks()));
        let bound = [&work.frame, &work.starts, &chunks.blocks, &work.counters, &work.dispatches];
        self.step(&kernels["plan_slots"], all_from(0, bound), Size::Groups(1));
        self.end(DrawStage::Cull);

        for ((chunk, uniform), k) in chunks.each().zip(0..) {
            let read = [&work.starts, &work.gaussians, &chunk.bodies, &chunk.shapes];
            let written = [&work.centres, &work.conics, &work.slot_keys[0], &work.rects];
            let bound = all_from(2, read.into_iter().chain(written));
            let bound = all_from(0, [&work.frame]).chain([uniform]).chain(bound);
            self.step(&kernels["project"], bound, Size::chunk(k));
        }
        self.end(DrawStage::Project);

        for ((chunk, uniform), k) in chunks.each().zip(0..) {
            let bound = [&work.starts, &work.gaussians, &chunk.bodies, &work.colours];
            let bound = all_from(2, bound.into_iter().chain(&chunk.sh).chain(&scene.atoms));
            let bound = all_from(0, [&work.frame]).chain([uniform]).chain(bound);
            let table = scene.table.iter().flat_map(|table| table.bound());
            self.step(&scene.radiance, bound.chain(table), Size::chunk(k));
        }
        self.end(DrawStage::Radiance);

        let by_depth = self.sort(&Sorting {
            keys: work.slot_keys.each_ref(),
            values: work.slot_values.each_ref(),
            bits: shape.depth_bits,
            length: Counter::Slots,
            blocks: Counter::SlotBlocks,
            digits: Counter::SlotDigits,
            groups: Dispatch::SlotBlocks,
            scan_groups: Dispatch::SlotDigits,
            identity: true,
        })?;
        self.end(DrawStage::Sort);

        self.uniforms.push(band);
        Ok(by_depth)
    }

    /// Plans to list some rows of tiles and to draw them. `order` has the slots in the order of depth.
    fn band(&mut self, shape: Shape, order: &Buffer, first: u32, rows: u32) -> Result<()> {
        let (work, kernels) = (self.work, self.kernels);
        let tiles = rows * shape.columns;
        let band = self.gpu.uniform("band", &Band { first, rows, tiles, padding: 0 })?;
        let common = [
            &work.frame,
            &band,
            &work.counters,
            order,
            &work.rects,
            &work.centres,
            &work.conics,
            &work.offsets,
        ];
        self.step(&kernels["count_tiles"], all_from(0, common), Size::of(Dispatch::SlotsAndEnd));
        self.scan(&work.offsets, Counter::SlotsAndEnd, None, Some(Dispatch::SlotScan))?;
        let bound =
            all_from(0, [&work.frame]).chain(all_from(3, [&work.counters, &work.dispatches, &work.offsets]));
        self.step(&kernels["plan_entries"], bound, Size::Groups(1));
        let listed_slots =
            work.moments.as_ref().map_or(&work.entry_values[0], |moments| &moments.listed_slots);
        let bound = all_from(0, common).chain(all_from(8, [&work.entry_keys[0], listed_slots]));
        self.step(&kernels["list_tiles"], bound, Size::of(Dispatch::SlotsAndEnd));
        let by_tile = self.sort(&Sorting {
            keys: work.entry_keys.each_ref(),
            values: work.entry_values.each_ref(),
            // Entries that belong to no tile have the key after that of the last tile.
            bits: u32::BITS - tiles.leading_zeros(),
            length: Counter::Entries,
            blocks: Counter::EntryBlocks,
            digits: Counter::EntryDigits,
            groups: Dispatch::EntryBlocks,
            scan_groups: Dispatch::EntryDigits,
            identity: work.moments.is_some(),
        })?;
        let sorted = &work.entry_values[by_tile];
        let mut entry_slots = sorted;
        if let Some(moments) = &work.moments {
            // The sort does not need the other buffer any longer.
            entry_slots = &work.entry_values[1 - by_tile];
            let bound = all_from(0, [&work.counters, sorted, &moments.listed_slots, entry_slots]);
            self.step(&kernels["slots_of_entries"], bound, Size::of(Dispatch::Entries));
        }
        let bound = all_from(0, [&band, &work.counters, &work.entry_keys[by_tile], &work.ranges]);
        self.step(&kernels["find_ranges"], bound, Size::of(Dispatch::Entries));
        self.end(DrawStage::Tiles);

        let tile = u64::try_from(TILE).unwrap_or(u64::MAX);
        let line = u64::from(shape.width) * PIXEL;
        let top = u64::from(first) * tile;
        let lines = (u64::from(rows) * tile).min(u64::from(shape.height) - top);
        // WebGPU wants offsets that are multiples of 256 bytes. A row of tiles is such a multiple.
        let (buffer, size) = (&work.pixels.raw, NonZeroU64::new(lines * line));
        let resource =
            wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: top * line, size });
        let pixels = |binding| [wgpu::BindGroupEntry { binding, resource: resource.clone() }];
        let tile =
            [&work.frame, &band, &work.ranges, entry_slots, &work.centres, &work.conics, &work.colours];
        self.step(&kernels["blend"], all_from(0, tile).chain(pixels(7)), Size::Groups(tiles));
        if let Some(moments) = &work.moments {
            let bound = all_from(0, tile.into_iter().chain([sorted])).chain(pixels(8));
            let bound = bound.chain(all_from(9, [&moments.of_entries]));
            self.step(&kernels["tile_moments"], bound, Size::Groups(tiles));
            let read = [&work.frame, &work.counters, order, &work.offsets];
            let bound = all_from(0, read.into_iter().chain([&moments.of_entries, &moments.of_slots]));
            self.step(&kernels["gather_moments"], bound, Size::of(Dispatch::SlotsAndEnd));
        }
        self.end(DrawStage::Blend);
        self.uniforms.push(band);
        Ok(())
    }

    fn step<'b>(
        &mut self,
        pipeline: &wgpu::ComputePipeline,
        bound: impl IntoIterator<Item = wgpu::BindGroupEntry<'b>>,
        size: Size,
    ) {
        let bindings = bind(self.gpu, pipeline, bound);
        self.steps.push(Step { pipeline: pipeline.clone(), bindings, size });
    }

    fn end(&mut self, stage: DrawStage) {
        self.passes.push(StagePass { stage, steps: std::mem::take(&mut self.steps) });
    }

    /// Plans to replace the numbers in `data` by the sums of the numbers before them. The number of values is `fixed`, or
    /// else that of `counter`.
    fn scan(
        &mut self,
        data: &Buffer,
        counter: Counter,
        fixed: Option<u32>,
        groups: Option<Dispatch>,
    ) -> Result<()> {
        let (work, kernels) = (self.work, self.kernels);
        let scan = Scan { counter: counter as u32, fixed_length: fixed.unwrap_or(0), padding: [0; 2] };
        let uniform = self.gpu.uniform("scan", &scan)?;
        let bound = [&uniform, &work.counters, data, &work.sums];
        let size = || match groups {
            Some(dispatch) => Size::of(dispatch),
            None => Size::Groups(fixed.unwrap_or(0).div_ceil(SCAN_BLOCK)),
        };
        self.step(&kernels["scan_reduce"], all_from(0, bound), size());
        let spine = all_from(0, [&uniform, &work.counters]).chain(all_from(3, [&work.sums]));
        self.step(&kernels["scan_spine"], spine, Size::Groups(1));
        self.step(&kernels["scan_spread"], all_from(0, bound), size());
        self.uniforms.push(uniform);
        Ok(())
    }

    /// Plans a sort. Returns which of the two buffers has the result.
    fn sort(&mut self, sorting: &Sorting<'_>) -> Result<usize> {
        let (work, kernels) = (self.work, self.kernels);
        let passes = sorting.bits.div_ceil(DIGIT_BITS).max(1);
        for k in 0..passes {
            let (from_buffer, to) = if k % 2 == 0 { (0, 1) } else { (1, 0) };
            let pass = Pass {
                shift: k * DIGIT_BITS,
                length: sorting.length as u32,
                blocks: sorting.blocks as u32,
                identity: u32::from(sorting.identity && k == 0),
            };
            let uniform = self.gpu.uniform("pass", &pass)?;
            let common = [&uniform, &work.counters, sorting.keys[from_buffer], &work.histogram];
            self.step(&kernels["sort_count"], all_from(0, common), Size::of(sorting.groups));
            self.scan(&work.histogram, sorting.digits, None, Some(sorting.scan_groups))?;
            let moved = [sorting.values[from_buffer], sorting.keys[to], sorting.values[to]];
            let bound = all_from(0, common.into_iter().chain(moved));
            self.step(&kernels["sort_scatter"], bound, Size::of(sorting.groups));
            self.uniforms.push(uniform);
        }
        Ok((passes % 2) as usize)
    }
}

/// Returns the two dimensions of a dispatch that has at least `groups` workgroups.
pub(super) fn dimensions(groups: u32) -> (u32, u32) {
    (groups.min(MAX_GROUPS), groups.div_ceil(MAX_GROUPS))
}
