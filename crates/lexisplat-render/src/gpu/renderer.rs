//! Draws scenes on the GPU. If a view needs larger buffers, it is drawn again.

use std::collections::HashMap;

use lexisplat::ShDegree;

use crate::camera::Camera;
use crate::conventions::TILE;
use crate::cpu::RenderOptions;
use crate::error::{Error, Result};
use crate::image::Image;

use super::capacity::{Capacity, ENTRY_ELEMENT, PIXEL, SLOT_ELEMENT};
use super::constants::{COUNTERS, Counter};
use super::device::Gpu;
use super::plan::{Plan, Shape, Size, dimensions};
use super::scene::GpuScene;
use super::shaders::{DRAWING, Kernels, kernels};
use super::timestamps::Timestamps;
use super::uniforms::FrameUniform;
use super::work::Work;
use crate::gpu_report::{DrawStage, FrameStats, StageTimes};
use crate::sh_path::ShPath;

/// Number of slots and entries that the first buffers hold.
const FIRST_ROOM: u32 = 1 << 18;
/// Ratio of the capacity of new buffers to what a view needed, so that a small move of the camera needs no new buffers.
const SPARE: f64 = 1.125;
/// Largest number of entries in the tile lists at once: 1 GiB of lists.
const MAX_ENTRIES: u64 = 1 << 26;
/// Largest number of passes that are timed. If a view in many bands has more, the others are not timed.
const MAX_TIMED: u32 = 1024;
/// Largest number of plans kept. They serve two scenes in turn, from cameras whose depth keys differ by one bit.
const MAX_PLANS: usize = 4;
/// Largest number of cuts that are remembered. With one more, all are forgotten.
const MAX_CUTS: usize = 64;

/// A drawn picture on the GPU.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Frame {
    /// `width * height` pixels of four floats: red, green, blue, not clamped, and 1. They are valid until the same
    /// renderer draws its next picture.
    pub pixels: wgpu::Buffer,
    /// Number of pixels in a row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Measurements of the drawing.
    pub stats: FrameStats,
}

/// Draws scenes on one GPU. Buffers are kept from picture to picture.
pub struct GpuRenderer {
    pub(super) gpu: Gpu,
    pub(super) kernels: Kernels,
    /// Whether the renderer also computes moments.
    pub(super) measuring: bool,
    pub(super) work: Option<Work>,
    /// The plans of the last scenes and sizes, the latest plan last.
    pub(super) plans: Vec<Plan>,
    pub(super) timestamps: Option<Timestamps>,
    /// The cuts of pictures that did not fit at once.
    pub(super) cuts: HashMap<PictureKey, Cut>,
    pub(super) limits: CapacityLimits,
}

impl std::fmt::Debug for GpuRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpuRenderer").field("gpu", self.gpu.summary()).finish_non_exhaustive()
    }
}

/// The number of a scene, and the width and height of a picture of it, in pixels.
pub(super) type PictureKey = (u64, u32, u32);

/// The cut of a picture into bands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    /// Number of rows of tiles that are drawn together.
    rows: u32,
    /// Whether each band searches for its own Gaussians.
    see: bool,
}

/// The largest arrays that a kernel can work on.
#[derive(Debug, Clone, Copy)]
pub(super) struct CapacityLimits {
    pub(super) slots: u64,
    pub(super) entries: u64,
    /// Number of bytes of pixels that a kernel can see at once.
    pub(super) pixels: u64,
}

impl GpuRenderer {
    /// Blocks on [`Self::new_async`].
    ///
    /// # Errors
    /// As [`Self::new_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn new(gpu: &Gpu) -> Result<Self> {
        gpu.block_on(Self::new_async(gpu))
    }

    /// Makes a renderer on `gpu`. Compiles the kernels.
    ///
    /// # Errors
    /// [`Error::Gpu`] if the driver refuses a kernel.
    pub async fn new_async(gpu: &Gpu) -> Result<Self> {
        let binding = gpu.max_binding();
        let limits = CapacityLimits {
            slots: binding / SLOT_ELEMENT,
            entries: (binding / ENTRY_ELEMENT).min(MAX_ENTRIES),
            pixels: binding,
        };
        Ok(Self {
            gpu: gpu.clone(),
            kernels: kernels(gpu, &DRAWING).await?,
            measuring: false,
            work: None,
            plans: Vec::new(),
            timestamps: Timestamps::new(gpu, MAX_TIMED).await?,
            cuts: HashMap::new(),
            limits,
        })
    }

    /// Returns this renderer with smaller limits than those of the GPU.
    #[cfg(test)]
    pub(super) fn with_limits(mut self, limits: CapacityLimits) -> Self {
        self.limits = limits;
        self
    }

    /// Returns the buffers of the last picture, and its shape.
    #[cfg(test)]
    pub(super) fn inside(&self) -> (&Work, Shape) {
        (self.work.as_ref().unwrap(), self.plans.last().unwrap().shape)
    }

    /// Blocks on [`Self::render_async`].
    ///
    /// # Errors
    /// As [`Self::draw_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn render(
        &mut self,
        scene: &GpuScene,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<(Image, FrameStats)> {
        self.gpu.clone().block_on(self.render_async(scene, camera, options))
    }

    /// Draws `scene` as `camera` sees it, and copies the picture to the processor.
    ///
    /// # Errors
    /// As [`Self::draw_async`].
    pub async fn render_async(
        &mut self,
        scene: &GpuScene,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<(Image, FrameStats)> {
        let frame = self.draw_async(scene, camera, options).await?;
        let image = self.read_async(&frame).await?;
        Ok((image, frame.stats))
    }

    /// Copies the pixels of a frame of this renderer to the processor.
    ///
    /// # Errors
    /// [`Error::Gpu`] if the device fails.
    pub async fn read_async(&self, frame: &Frame) -> Result<Image> {
        let size = u64::from(frame.width) * u64::from(frame.height) * PIXEL;
        let back = self.gpu.checked("pixels back", || self.gpu.readable("pixels back", size)).await?;
        let mut encoder = self.gpu.encoder();
        encoder.copy_buffer_to_buffer(&frame.pixels, 0, &back.raw, 0, size);
        self.gpu.queue().submit([encoder.finish()]);
        let pixels: Vec<[f32; 4]> = self.gpu.read(&back, size).await?;
        let pixels = pixels.into_iter().map(|[r, g, b, _]| [r, g, b]).collect();
        Ok(Image { width: frame.width, height: frame.height, pixels })
    }

    /// Blocks on [`Self::draw_async`].
    ///
    /// # Errors
    /// As [`Self::draw_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn draw(&mut self, scene: &GpuScene, camera: &Camera, options: &RenderOptions) -> Result<Frame> {
        self.gpu.clone().block_on(self.draw_async(scene, camera, options))
    }

    /// Draws `scene` as `camera` sees it. The picture stays on the GPU.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the scene is on another GPU, if the camera is not valid, or if the degree is lower than
    /// the scene's and radiance comes from a table; [`Error::GpuLimit`] if the view needs larger buffers than this GPU
    /// allows; [`Error::Gpu`] if the device fails.
    pub async fn draw_async(
        &mut self,
        scene: &GpuScene,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Frame> {
        camera.validate()?;
        if !scene.gpu().is(&self.gpu) {
            return Err(Error::parameter("scene", "on another GPU", "a scene on the renderer's GPU"));
        }
        let degree = options.max_degree.map_or(scene.degree(), |most| most.min(scene.degree()));
        if scene.path() == ShPath::SparseTable && degree != scene.degree() {
            let expected = format!("{}, the scene's, since its table holds nothing else", scene.degree());
            return Err(Error::parameter("degree", degree, expected));
        }
        let mut retries = 0;
        loop {
            let shape = self.shape(scene, camera)?;
            self.make_room(scene, shape, None).await?;
            let (mut frame, found) = self.attempt(scene, camera, options, degree, shape).await?;
            match self.missing(found, shape)? {
                None => {
                    frame.stats.retries = retries;
                    return Ok(frame);
                }
                Some(Missing::Capacity { slots, entries }) => {
                    self.make_room(scene, shape, Some([slots, entries])).await?;
                }
                Some(Missing::Bands { see }) => {
                    let cut = Cut { rows: (shape.band_rows / 2).max(1), see: see || shape.bands_see };
                    self.cuts.insert(picture_key(scene, camera), cut);
                }
            }
            retries += 1;
        }
    }

    /// Returns the sizes of the picture and its cut into bands.
    fn shape(&mut self, scene: &GpuScene, camera: &Camera) -> Result<Shape> {
        // Sides are at most 16384.
        let tile = u32::try_from(TILE).unwrap_or(u32::MAX);
        let (columns, rows) = (camera.width.div_ceil(tile), camera.height.div_ceil(tile));
        let line = u64::from(camera.width) * PIXEL * u64::from(tile);
        let fit = u32::try_from(self.limits.pixels / line).unwrap_or(u32::MAX);
        if fit == 0 {
            return Err(Error::gpu_limit("bytes of a row of tiles", line, self.limits.pixels));
        }
        if self.cuts.len() > MAX_CUTS {
            self.cuts.clear();
        }
        let whole = Cut { rows, see: false };
        let cut = self.cuts.get(&picture_key(scene, camera)).copied().unwrap_or(whole);
        let (band_rows, bands_see) = (cut.rows.min(rows).min(fit), cut.see);
        let depth_bits = depth_bits(scene, camera);
        let (width, height) = (camera.width, camera.height);
        Ok(Shape { columns, rows, width, height, band_rows, bands_see, depth_bits })
    }

    /// Makes sure that the buffers are large enough for the scene, for the picture, and for `wanted` slots and entries.
    async fn make_room(&mut self, scene: &GpuScene, shape: Shape, wanted: Option<[u32; 2]>) -> Result<()> {
        let chunks = u32::try_from(scene.chunks().count()).unwrap_or(u32::MAX);
        let limit = |value: u32, most: u64| value.min(u32::try_from(most).unwrap_or(u32::MAX));
        let least = Capacity {
            blocks: scene.blocks(),
            chunks,
            slots: limit(FIRST_ROOM.min(scene.len()), self.limits.slots).max(1),
            entries: limit(FIRST_ROOM, self.limits.entries),
            tiles: shape.columns * shape.band_rows,
            pixels: u64::from(shape.width) * u64::from(shape.height),
        };
        let now = self.work.as_ref().map_or(least, |work| work.capacity);
        let [slots, entries] = wanted.unwrap_or([0, 0]);
        // A scene to which parts are added gets new buffers only after its size has doubled.
        let grown = |now: u32, least: u32| if least > now { least.max(now.saturating_mul(2)) } else { now };
        let capacity = Capacity {
            blocks: grown(now.blocks, least.blocks),
            chunks: grown(now.chunks, least.chunks),
            slots: limit(grown(now.slots, least.slots), self.limits.slots).max(slots),
            entries: now.entries.max(least.entries).max(entries),
            tiles: now.tiles.max(least.tiles),
            pixels: now.pixels.max(least.pixels),
        };
        if self.work.as_ref().is_none_or(|work| work.capacity != capacity) {
            // The old buffers are freed first, because old and new buffers together may not fit.
            self.plans.clear();
            self.work = None;
            self.work = Some(Work::new(&self.gpu, capacity, self.measuring).await?);
        }
        Ok(())
    }

    /// Draws once, and leaves out entries that do not fit in the buffers. Also returns the counters, which tell whether
    /// something was left out.
    async fn attempt(
        &mut self,
        scene: &GpuScene,
        camera: &Camera,
        options: &RenderOptions,
        degree: ShDegree,
        shape: Shape,
    ) -> Result<(Frame, [u32; COUNTERS])> {
        let gpu = &self.gpu;
        let Some(work) = &self.work else {
            return Err(Error::Gpu { problem: "no buffers".to_owned() });
        };
        // A plan keeps the buffers of its scene alive.
        self.plans.retain(Plan::is_of_use);
        let known = self.plans.iter().position(|plan| plan.scene == scene.id && plan.shape == shape);
        let plan = match known {
            Some(index) => self.plans.remove(index),
            None => Plan::new(gpu, &self.kernels, scene, work, shape).await?,
        };
        let uniform = frame_uniform(scene, camera, options, degree, shape, work.capacity);
        gpu.queue().write_buffer(&work.frame.raw, 0, bytemuck::bytes_of(&uniform));

        let mut encoder = gpu.encoder();
        encoder.clear_buffer(&work.counters.raw, 0, None);
        if let Some(moments) = &work.moments {
            encoder.clear_buffer(&moments.of_slots.raw, 0, None);
        }
        let mut timed = Vec::new();
        for stage in &plan.passes {
            let query = u32::try_from(timed.len()).unwrap_or(u32::MAX);
            let timestamp_writes = self.timestamps.as_ref().and_then(|timestamps| timestamps.writes(query));
            if timestamp_writes.is_some() {
                timed.push(stage.stage);
            }
            if stage.stage == DrawStage::Cull {
                // `cull` does not write the entry after that of the last block.
                encoder.clear_buffer(&work.starts.raw, 4 * u64::from(scene.blocks()), Some(4));
            }
            if stage.stage == DrawStage::Tiles {
                encoder.clear_buffer(&work.ranges.raw, 0, None);
                if let Some(moments) = &work.moments {
                    encoder.clear_buffer(&moments.of_entries.raw, 0, None);
                }
            }
            let label = Some(stage.stage.name());
            let mut pass =
                encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes });
            for step in &stage.steps {
                pass.set_pipeline(&step.pipeline);
                pass.set_bind_group(0, &step.bindings, &[]);
                match step.size {
                    Size::Groups(groups) => {
                        let (x, y) = dimensions(groups);
                        pass.dispatch_workgroups(x, y, 1);
                    }
                    Size::Indirect(offset) => {
                        pass.dispatch_workgroups_indirect(&work.dispatches.raw, offset);
                    }
                }
            }
        }
        if let Some(timestamps) = &self.timestamps {
            timestamps.resolve(&mut encoder, u32::try_from(timed.len()).unwrap_or(0));
        }
        let bytes = work.counters_back.bytes();
        encoder.copy_buffer_to_buffer(&work.counters.raw, 0, &work.counters_back.raw, 0, bytes);
        gpu.queue().submit([encoder.finish()]);

        let counters: Vec<u32> = gpu.read(&work.counters_back, bytes).await?;
        let found: [u32; COUNTERS] = std::array::from_fn(|k| counters.get(k).copied().unwrap_or(0));
        let (stages, total) = self.times(&timed).await?;
        let stats = FrameStats {
            visible: found[Counter::Found as usize],
            entries: found[Counter::EntriesAll as usize],
            bands: shape.rows.div_ceil(shape.band_rows),
            retries: 0,
            stages,
            total,
        };
        let pixels = work.pixels.raw.clone();
        if self.plans.len() >= MAX_PLANS {
            self.plans.remove(0);
        }
        self.plans.push(plan);
        Ok((Frame { pixels, width: shape.width, height: shape.height, stats }, found))
    }

    /// Returns the duration of each stage, summed over all bands, and the duration of the whole picture, in milliseconds.
    async fn times(&self, timed: &[DrawStage]) -> Result<(StageTimes, Option<f64>)> {
        let Some(timestamps) = &self.timestamps else { return Ok((Vec::new(), None)) };
        let passes = timestamps.read(&self.gpu, u32::try_from(timed.len()).unwrap_or(0)).await?;
        let stages = DrawStage::ALL.map(|stage| {
            let own = passes.iter().zip(timed).filter(|(_, s)| **s == stage);
            (stage, own.map(|([start, end], _)| end - start).sum())
        });
        let total = passes.last().map(|[_, end]| *end);
        Ok((stages.to_vec(), total))
    }

    /// Returns what the view lacked, or `None` if it lacked nothing.
    fn missing(&self, found: [u32; COUNTERS], shape: Shape) -> Result<Option<Missing>> {
        let Some(capacity) = self.work.as_ref().map(|work| work.capacity) else { return Ok(None) };
        let spare = |found: u32, most: u64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the limit")]
            let wanted = (f64::from(found) * SPARE).min(most as f64).min(f64::from(u32::MAX)) as u32;
            wanted
        };
        let slots = found[Counter::Found as usize];
        if slots > capacity.slots {
            if u64::from(slots) <= self.limits.slots {
                return Ok(Some(Missing::Capacity { slots: spare(slots, self.limits.slots), entries: 0 }));
            }
            // Moments are summed by slot over the bands, so slots must be the same in all bands.
            let one = shape.bands_see && shape.band_rows == 1;
            if one || self.measuring {
                let what = if one { "Gaussians in one row of tiles" } else { "Gaussians in view" };
                return Err(Error::gpu_limit(what, slots, self.limits.slots));
            }
            return Ok(Some(Missing::Bands { see: true }));
        }
        let entries = found[Counter::EntriesMost as usize];
        if entries > capacity.entries {
            if u64::from(entries) <= self.limits.entries {
                return Ok(Some(Missing::Capacity {
                    slots: 0,
                    entries: spare(entries, self.limits.entries),
                }));
            }
            if shape.band_rows == 1 {
                let what = "pairs of a Gaussian and a tile in one row of tiles";
                return Err(Error::gpu_limit(what, entries, self.limits.entries));
            }
            return Ok(Some(Missing::Bands { see: false }));
        }
        Ok(None)
    }
}

fn picture_key(scene: &GpuScene, camera: &Camera) -> PictureKey {
    (scene.id, camera.width, camera.height)
}

/// The need of a view that could not be drawn: larger buffers, or smaller bands.
enum Missing {
    Capacity {
        slots: u32,
        entries: u32,
    },
    /// Bands of half as many rows. `see` tells whether each band must search for its own Gaussians.
    Bands {
        see: bool,
    },
}

/// Returns the number of significant bits of depth keys, from the farthest corner of the scene.
fn depth_bits(scene: &GpuScene, camera: &Camera) -> u32 {
    let Some(bounds) = scene.bounds() else { return 1 };
    let farthest = (0..8)
        .map(|corner: usize| {
            let at = std::array::from_fn(|k| bounds[corner >> k & 1][k]);
            camera.to_view(at)[2]
        })
        .fold(0.0, f32::max);
    // The depth of a corner may round differently from the depth of a Gaussian at the same place.
    const ROUNDING: f32 = 1.0001;
    let key = (farthest * ROUNDING).min(f32::MAX).to_bits().saturating_sub(camera.near.to_bits());
    // One more bit puts the key of slots that come last above all other keys.
    (u32::BITS - key.leading_zeros() + 1).min(u32::BITS)
}

fn frame_uniform(
    scene: &GpuScene,
    camera: &Camera,
    options: &RenderOptions,
    degree: ShDegree,
    shape: Shape,
    capacity: Capacity,
) -> FrameUniform {
    let r = &camera.rotation;
    let column = |k: usize| [r[0][k], r[1][k], r[2][k]];
    #[expect(clippy::cast_precision_loss, reason = "sides are far below 2^24")]
    let size = [camera.width as f32, camera.height as f32];
    FrameUniform {
        right: column(0),
        degree: degree.get().into(),
        down: column(1),
        columns: shape.columns,
        forward: column(2),
        rows: shape.rows,
        position: camera.position,
        antialiased: scene.antialiased.into(),
        background: options.behind(camera),
        slots: capacity.slots,
        tangents: [size[0] / (2.0 * camera.fx), size[1] / (2.0 * camera.fy)],
        focal: [camera.fx, camera.fy],
        size,
        width: camera.width,
        height: camera.height,
        blocks: scene.blocks(),
        chunks: u32::try_from(scene.chunks().count()).unwrap_or(u32::MAX),
        entries: capacity.entries,
        near: camera.near,
    }
}
