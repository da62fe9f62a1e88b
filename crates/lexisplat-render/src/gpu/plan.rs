//! Which kernels run on what, in which order.

use std::sync::{Arc, Weak};

use crate::error::Result;

use super::buffer::Buffer;
use super::constants::{Counter, DIGIT_BITS, Dispatch, MAX_GROUPS, SCAN_BLOCK};
use super::device::Gpu;
use super::scene::GpuScene;
use super::shaders::{Bound, Kernels, bind};
use super::uniforms::{Band, Pass, Scan};
use super::work::{PIXEL, Work};

use crate::conventions::TILE;

/// A part of drawing that is timed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DrawStage {
    /// Which Gaussians may be seen.
    Cull,
    /// Ellipses on screen.
    Project,
    /// Colours.
    Radiance,
    /// Order by depth.
    Sort,
    /// Lists of the tiles.
    Tiles,
    /// Pixels.
    Blend,
}

impl DrawStage {
    /// All, in the order they run.
    pub const ALL: [Self; 6] =
        [Self::Cull, Self::Project, Self::Radiance, Self::Sort, Self::Tiles, Self::Blend];

    /// Its name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cull => "cull",
            Self::Project => "project",
            Self::Radiance => "radiance",
            Self::Sort => "sort",
            Self::Tiles => "tiles",
            Self::Blend => "blend",
        }
    }
}

/// What a plan depends on besides the scene and the buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) columns: u32,
    pub(super) rows: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Rows of tiles drawn at once.
    pub(super) band_rows: u32,
    /// Whether each band looks for its own Gaussians, because those of all bands do not fit at once.
    pub(super) bands_see: bool,
    /// Significant bits of depth keys.
    pub(super) depth_bits: u32,
}

/// Everything to run for one picture.
pub(super) struct Plan {
    pub(super) shape: Shape,
    pub(super) scene: u64,
    scene_lives: Weak<()>,
    pub(super) passes: Vec<StagePass>,
    /// Alive as long as the bindings.
    _uniforms: Vec<Buffer>,
}

/// Steps of one stage, in one compute pass.
pub(super) struct StagePass {
    pub(super) stage: DrawStage,
    pub(super) steps: Vec<Step>,
}

pub(super) struct Step {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) bindings: wgpu::BindGroup,
    pub(super) size: Size,
}

/// How many groups.
pub(super) enum Size {
    Groups(u32),
    /// As the GPU works out: where in the buffer of arguments.
    Indirect(u64),
}

/// Bytes of a dispatch's arguments.
const ARGUMENTS: u64 = 12;

impl Size {
    /// Lanes for the slots of chunk `k`.
    fn chunk(k: u64) -> Self {
        Self::place(Dispatch::Chunks as u64 + k)
    }

    fn place(dispatch: u64) -> Self {
        Self::Indirect(dispatch * ARGUMENTS)
    }

    fn of(dispatch: Dispatch) -> Self {
        Self::place(dispatch as u64)
    }
}

#[cfg(test)]
#[path = "tests/scan_sort.rs"]
mod tests;

/// What a sort works on.
struct Sorting<'a> {
    keys: [&'a Buffer; 2],
    values: [&'a Buffer; 2],
    bits: u32,
    length: Counter,
    blocks: Counter,
    digits: Counter,
    groups: Dispatch,
    scan_groups: Dispatch,
    /// Whether values are the keys' own places at first.
    identity: bool,
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
    /// Plans pictures of `shape` of `scene`, drawn with the buffers in `work`.
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

    /// Whether its scene is still there.
    pub(super) fn is_of_use(&self) -> bool {
        self.scene_lives.strong_count() > 0
    }
}

fn all(buffer: &Buffer) -> Bound<'_> {
    Bound::All(&buffer.raw)
}

impl Planner<'_> {
    fn plan(mut self, scene: &GpuScene, shape: Shape) -> Result<Plan> {
        let mut by_depth = 0;
        let mut first = 0;
        while first < shape.rows {
            let rows = shape.band_rows.min(shape.rows - first);
            if shape.bands_see {
                by_depth = self.see(scene, shape, first, rows)?;
            } else if first == 0 {
                by_depth = self.see(scene, shape, 0, shape.rows)?;
            }
            self.band(shape, &self.work.slot_values[by_depth], first, rows)?;
            first += rows;
        }
        let scene_lives = Arc::downgrade(&scene.lives);
        Ok(Plan { shape, scene: scene.id, scene_lives, passes: self.passes, _uniforms: self.uniforms })
    }

    /// Projects, shades and orders what may be seen in some rows of tiles; in which of the two buffers the
    /// slots then are.
    fn see(&mut self, scene: &GpuScene, shape: Shape, first: u32, rows: u32) -> Result<usize> {
        let (work, kernels) = (self.work, self.kernels);
        let tiles = rows * shape.columns;
        let band = self.gpu.uniform("rows in view", &Band { first, rows, tiles, padding: 0 })?;
        for chunk in &scene.chunks {
            let bound = [
                (0, all(&work.frame)),
                (1, all(&chunk.uniform)),
                (2, all(&chunk.bodies)),
                (3, all(&work.masks)),
                (4, all(&work.starts)),
                (5, all(&band)),
            ];
            self.step(&kernels.cull, &bound, Size::Groups(chunk.blocks));
        }
        self.scan(&work.starts, Counter::Found, Some(scene.blocks() + 1), None)?;
        let bound =
            [(0, all(&work.frame)), (1, all(&work.masks)), (2, all(&work.starts)), (3, all(&work.gaussians))];
        self.step(&kernels.compact, &bound, Size::Groups(scene.blocks()));
        let bound = [
            (0, all(&work.frame)),
            (1, all(&work.starts)),
            (2, all(&scene.chunk_blocks)),
            (3, all(&work.counters)),
            (4, all(&work.dispatches)),
        ];
        self.step(&kernels.plan_slots, &bound, Size::Groups(1));
        self.end(DrawStage::Cull);

        for (chunk, k) in scene.chunks.iter().zip(0_u64..) {
            let bound = [
                (0, all(&work.frame)),
                (1, all(&chunk.uniform)),
                (2, all(&work.starts)),
                (3, all(&work.gaussians)),
                (4, all(&chunk.bodies)),
                (5, all(&chunk.shapes)),
                (6, all(&work.centres)),
                (7, all(&work.conics)),
                (8, all(&work.slot_keys[0])),
                (9, all(&work.rects)),
            ];
            let size = Size::chunk(k);
            self.step(&kernels.project, &bound, size);
        }
        self.end(DrawStage::Project);

        for (chunk, k) in scene.chunks.iter().zip(0_u64..) {
            let mut bound = vec![
                (0, all(&work.frame)),
                (1, all(&chunk.uniform)),
                (2, all(&work.starts)),
                (3, all(&work.gaussians)),
                (4, all(&chunk.bodies)),
                (5, all(&work.colours)),
            ];
            bound.extend(chunk.sh.iter().zip(6..).map(|(buffer, binding)| (binding, all(buffer))));
            bound.extend(scene.table.iter().flat_map(|table| table.bound()));
            let size = Size::chunk(k);
            self.step(&scene.radiance, &bound, size);
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

    /// Lists and draws some rows of tiles.
    fn band(&mut self, shape: Shape, order: &Buffer, first: u32, rows: u32) -> Result<()> {
        let (work, kernels) = (self.work, self.kernels);
        let tiles = rows * shape.columns;
        let band = self.gpu.uniform("band", &Band { first, rows, tiles, padding: 0 })?;
        let common = || {
            [
                (0, all(&work.frame)),
                (1, all(&band)),
                (2, all(&work.counters)),
                (3, all(order)),
                (4, all(&work.rects)),
                (5, all(&work.centres)),
                (6, all(&work.conics)),
                (7, all(&work.offsets)),
            ]
        };
        self.step(&kernels.count_tiles, &common(), Size::of(Dispatch::SlotsAndEnd));
        self.scan(&work.offsets, Counter::SlotsAndEnd, None, Some(Dispatch::SlotScan))?;
        let bound = [
            (0, all(&work.frame)),
            (3, all(&work.counters)),
            (4, all(&work.dispatches)),
            (5, all(&work.offsets)),
        ];
        self.step(&kernels.plan_entries, &bound, Size::Groups(1));
        let measuring = kernels.moments.as_ref().zip(work.moments.as_ref());
        let listed_slots = measuring.map_or(&work.entry_values[0], |(_, moments)| &moments.listed_slots);
        let lists = [(8, all(&work.entry_keys[0])), (9, all(listed_slots))];
        let bound: Vec<_> = common().into_iter().chain(lists).collect();
        self.step(&kernels.list_tiles, &bound, Size::of(Dispatch::SlotsAndEnd));
        let by_tile = self.sort(&Sorting {
            keys: work.entry_keys.each_ref(),
            values: work.entry_values.each_ref(),
            // Tiles and what belongs to none.
            bits: u32::BITS - tiles.leading_zeros(),
            length: Counter::Entries,
            blocks: Counter::EntryBlocks,
            digits: Counter::EntryDigits,
            groups: Dispatch::EntryBlocks,
            scan_groups: Dispatch::EntryDigits,
            identity: measuring.is_some(),
        })?;
        let mut entry_slots = &work.entry_values[by_tile];
        if let Some((kernels, moments)) = measuring {
            // The sort is done with the other buffer.
            entry_slots = &work.entry_values[1 - by_tile];
            let bound = [
                (0, all(&work.counters)),
                (1, all(&work.entry_values[by_tile])),
                (2, all(&moments.listed_slots)),
                (3, all(entry_slots)),
            ];
            self.step(&kernels.slots_of_entries, &bound, Size::of(Dispatch::Entries));
        }
        let bound = [
            (0, all(&band)),
            (1, all(&work.counters)),
            (2, all(&work.entry_keys[by_tile])),
            (3, all(&work.ranges)),
        ];
        self.step(&kernels.find_ranges, &bound, Size::of(Dispatch::Entries));
        self.end(DrawStage::Tiles);

        let tile = u64::try_from(TILE).unwrap_or(u64::MAX);
        let line = u64::from(shape.width) * PIXEL;
        let top = u64::from(first) * tile;
        let lines = (u64::from(rows) * tile).min(u64::from(shape.height) - top);
        // A row of tiles is a multiple of 256 bytes, as offsets must be.
        let pixels = || Bound::Part(&work.pixels.raw, top * line, lines * line);
        let tile = || {
            [
                (0, all(&work.frame)),
                (1, all(&band)),
                (2, all(&work.ranges)),
                (3, all(entry_slots)),
                (4, all(&work.centres)),
                (5, all(&work.conics)),
                (6, all(&work.colours)),
            ]
        };
        let bound: Vec<_> = tile().into_iter().chain([(7, pixels())]).collect();
        self.step(&kernels.blend, &bound, Size::Groups(tiles));
        if let Some((kernels, moments)) = measuring {
            let measured =
                [(7, all(&work.entry_values[by_tile])), (8, pixels()), (9, all(&moments.of_entries))];
            let bound: Vec<_> = tile().into_iter().chain(measured).collect();
            self.step(&kernels.tile_moments, &bound, Size::Groups(tiles));
            let bound = [
                (0, all(&work.frame)),
                (1, all(&work.counters)),
                (2, all(order)),
                (3, all(&work.offsets)),
                (4, all(&moments.of_entries)),
                (5, all(&moments.of_slots)),
            ];
            self.step(&kernels.gather_moments, &bound, Size::of(Dispatch::SlotsAndEnd));
        }
        self.end(DrawStage::Blend);
        self.uniforms.push(band);
        Ok(())
    }

    fn step(&mut self, pipeline: &wgpu::ComputePipeline, bound: &[(u32, Bound<'_>)], size: Size) {
        let bindings = bind(self.gpu, pipeline, bound);
        self.steps.push(Step { pipeline: pipeline.clone(), bindings, size });
    }

    fn end(&mut self, stage: DrawStage) {
        self.passes.push(StagePass { stage, steps: std::mem::take(&mut self.steps) });
    }

    /// Exclusive sums of `data` in place: of `fixed` numbers, or as many as `counter` says.
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
        let bound = || [(0, all(&uniform)), (1, all(&work.counters)), (2, all(data)), (3, all(&work.sums))];
        let size = || match groups {
            Some(dispatch) => Size::of(dispatch),
            None => Size::Groups(fixed.unwrap_or(0).div_ceil(SCAN_BLOCK)),
        };
        self.step(&kernels.scan_reduce, &bound(), size());
        let spine = [(0, all(&uniform)), (1, all(&work.counters)), (3, all(&work.sums))];
        self.step(&kernels.scan_spine, &spine, Size::Groups(1));
        self.step(&kernels.scan_spread, &bound(), size());
        self.uniforms.push(uniform);
        Ok(())
    }

    /// Sorts; in which of the two buffers the result is.
    fn sort(&mut self, sorting: &Sorting<'_>) -> Result<usize> {
        let (work, kernels) = (self.work, self.kernels);
        let passes = sorting.bits.div_ceil(DIGIT_BITS).max(1);
        for k in 0..passes {
            let (from, to) = if k % 2 == 0 { (0, 1) } else { (1, 0) };
            let pass = Pass {
                shift: k * DIGIT_BITS,
                length: sorting.length as u32,
                blocks: sorting.blocks as u32,
                identity: u32::from(sorting.identity && k == 0),
            };
            let uniform = self.gpu.uniform("pass", &pass)?;
            let common = || {
                [
                    (0, all(&uniform)),
                    (1, all(&work.counters)),
                    (2, all(sorting.keys[from])),
                    (3, all(&work.histogram)),
                ]
            };
            self.step(&kernels.sort_count, &common(), Size::of(sorting.groups));
            self.scan(&work.histogram, sorting.digits, None, Some(sorting.scan_groups))?;
            let moved =
                [(4, all(sorting.values[from])), (5, all(sorting.keys[to])), (6, all(sorting.values[to]))];
            let bound: Vec<_> = common().into_iter().chain(moved).collect();
            self.step(&kernels.sort_scatter, &bound, Size::of(sorting.groups));
            self.uniforms.push(uniform);
        }
        Ok((passes % 2) as usize)
    }
}

/// `groups` as two dimensions of a dispatch.
pub(super) fn dimensions(groups: u32) -> (u32, u32) {
    (groups.min(MAX_GROUPS), groups.div_ceil(MAX_GROUPS))
}
