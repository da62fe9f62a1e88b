//! A scene on the GPU. It consists of parts, which can be added and removed.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use lexisplat::ShDegree;

use crate::error::{Error, Result};
use crate::scene::Scene;

use super::buffer::Buffer;
use super::chunks::ChunkBuffers;
use super::constants::GROUP;
use super::device::Gpu;
use super::form::SceneForm;
use super::part::ScenePart;
use super::part_layout::{ShKind, ShLayout};
use super::radiance::radiance_pipeline;
use super::radiance_table::RadianceTable;
use super::sh_data::ShData;
use super::uniforms::ChunkUniform;
use crate::gpu_report::SceneBytes;
use crate::sh_path::ShPath;

/// Largest number of Gaussians of a part, when a whole scene is uploaded part by part. The arrays of one part are in
/// memory at once.
const PART_GAUSSIANS: usize = 1 << 20;
/// Largest number of blocks of Gaussians of a scene. The numbers of their Gaussians fit in 32 bits.
const MAX_BLOCKS: u32 = 1 << 24;

/// A scene on the GPU for one [`ShPath`]. The scene from which it was made may be dropped.
///
/// It is uploaded whole, or made empty and filled with parts. Its Gaussians have the order of the indices of the parts.
/// The picture is the same, bit for bit, however the Gaussians are divided into parts.
#[derive(Debug)]
pub struct GpuScene {
    pub(super) id: u64,
    /// Plans hold weak references to this value. They tell a plan whether its parts are still those of the scene.
    pub(super) lives: Arc<()>,
    parts: BTreeMap<usize, Part>,
    /// The dictionary, if kernels read it.
    pub(super) atoms: Option<Buffer>,
    pub(super) radiance: wgpu::ComputePipeline,
    pub(super) table: Option<RadianceTable>,
    gpu: Gpu,
    path: ShPath,
    layout: ShLayout,
    pub(super) antialiased: bool,
    len: u32,
    blocks: u32,
}

#[derive(Debug)]
struct Part {
    chunks: Vec<ChunkBuffers>,
    /// The corners of a box around all positions that can be drawn; `None` if there are none.
    bounds: Option<[[f32; 3]; 2]>,
}

impl Part {
    fn len(&self) -> u32 {
        self.chunks.iter().map(|chunk| chunk.count).sum()
    }

    fn blocks(&self) -> u32 {
        self.chunks.iter().map(ChunkBuffers::blocks).sum()
    }
}

/// Number of the next scene. Numbers keep bindings made for one scene from being used for another.
static NEXT_ID: AtomicU64 = AtomicU64::new(0);

impl GpuScene {
    /// Blocks on [`Self::new_async`].
    ///
    /// # Errors
    /// As [`Self::new_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn new(gpu: &Gpu, scene: &Scene<'_>, path: ShPath) -> Result<Self> {
        gpu.block_on(Self::new_async(gpu, scene, path))
    }

    /// Uploads `scene`.
    ///
    /// # Errors
    /// [`Error::Codec`] if the lengths of the scene's arrays do not match; [`Error::Parameter`] for a sparse path of a
    /// dense scene, or a dictionary too large for the path; [`Error::GpuLimit`] for more than 2^32 - 2 Gaussians;
    /// [`Error::Gpu`] if memory runs out.
    pub async fn new_async(gpu: &Gpu, scene: &Scene<'_>, path: ShPath) -> Result<Self> {
        scene.validate()?;
        check_size(scene.len() as u64, scene.len().div_ceil(GROUP as usize) as u64)?;
        let data = ShData::new(scene, path)?;
        let mut this = Self::empty(gpu, &SceneForm::of_data(&data, scene), path).await?;
        let mut nonzero = 0;
        for (first, index) in (0..scene.len()).step_by(PART_GAUSSIANS).zip(0..) {
            let range = first..(first + PART_GAUSSIANS).min(scene.len());
            this.put_async(index, &ScenePart::of(&data, scene, range.clone(), nonzero)?).await?;
            if let ShData::Codes(model) = data {
                nonzero += model.codes().counts()[range].iter().map(|&c| usize::from(c)).sum::<usize>();
            }
        }
        gpu.wait_async().await?;
        Ok(this)
    }

    /// Blocks on [`Self::of_parts_async`].
    ///
    /// # Errors
    /// As [`Self::of_parts_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn of_parts(gpu: &Gpu, form: &SceneForm) -> Result<Self> {
        gpu.block_on(Self::of_parts_async(gpu, form))
    }

    /// Makes a scene without Gaussians, to which [`Self::put_async`] adds parts of this `form`.
    ///
    /// # Errors
    /// [`Error::GpuLimit`] for a dictionary larger than a binding; [`Error::Gpu`] if the device fails.
    pub async fn of_parts_async(gpu: &Gpu, form: &SceneForm) -> Result<Self> {
        Self::empty(gpu, form, form.path()).await
    }

    async fn empty(gpu: &Gpu, form: &SceneForm, path: ShPath) -> Result<Self> {
        let codes = matches!(form.layout.kind, ShKind::Codes { .. });
        let table = match path {
            ShPath::SparseTable => Some(RadianceTable::new(gpu, &form.dictionary).await?),
            _ => None,
        };
        let radiance = radiance_pipeline(gpu, form.layout, path).await?;
        // A path that reads radiance from a table reads no atoms.
        let atoms = match codes && table.is_none() {
            true => {
                let atoms = form.atoms();
                let (size, limit) = (size_of_val(atoms.as_slice()) as u64, gpu.max_binding());
                if size > limit {
                    return Err(Error::gpu_limit("bytes of a dictionary on the GPU", size, limit));
                }
                Some(gpu.upload("atoms", &atoms).await?)
            }
            false => None,
        };
        Ok(Self {
            id: NEXT_ID.fetch_add(1, Relaxed),
            lives: Arc::default(),
            parts: BTreeMap::new(),
            atoms,
            radiance,
            table,
            gpu: gpu.clone(),
            path,
            layout: form.layout,
            antialiased: form.antialiased,
            len: 0,
            blocks: 0,
        })
    }

    /// Blocks on [`Self::put_async`].
    ///
    /// # Errors
    /// As [`Self::put_async`].
    #[cfg(not(target_family = "wasm"))]
    pub fn put(&mut self, index: usize, part: &ScenePart<'_>) -> Result<()> {
        self.gpu.clone().block_on(self.put_async(index, part))
    }

    /// Uploads `part` as part number `index`. It replaces the part that has this number. The next picture shows it. The
    /// old part is kept until the upload is done.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the part does not have the form of the scene; [`Error::GpuLimit`] for more than 2^32 - 2
    /// Gaussians or 2^24 blocks of 256 in all, where each part begins a block; [`Error::Gpu`] if memory runs out. The
    /// scene is unchanged after an error.
    pub async fn put_async(&mut self, index: usize, part: &ScenePart<'_>) -> Result<()> {
        if part.outline.layout != self.layout {
            let (found, expected) = (part.outline.layout, self.layout);
            return Err(Error::parameter("part", format!("{found:?}"), format!("{expected:?}")));
        }
        let cuts = part.cuts(self.gpu.max_binding())?;
        let (len, blocks) = self.parts.get(&index).map_or((0, 0), |old| (old.len(), old.blocks()));
        let own: u64 = cuts.iter().map(|cut| cut.gaussians.len().div_ceil(GROUP as usize) as u64).sum();
        check_size(u64::from(self.len - len) + u64::from(part.len()), u64::from(self.blocks - blocks) + own)?;
        let mut chunks = Vec::with_capacity(cuts.len());
        for cut in &cuts {
            chunks.push(part.upload(&self.gpu, cut).await?);
        }
        // The device keeps copies of what is uploaded, and buffers that were dropped, until something is submitted.
        self.gpu.queue().submit([]);
        self.parts.insert(index, Part { chunks, bounds: part.bounds() });
        self.changed();
        Ok(())
    }

    /// Removes part number `index`. Returns whether it existed.
    pub fn remove(&mut self, index: usize) -> bool {
        let removed = self.parts.remove(&index).is_some();
        if removed {
            self.changed();
        }
        removed
    }

    /// Removes all parts.
    pub fn clear(&mut self) {
        self.parts.clear();
        self.changed();
    }

    /// Counts the Gaussians again, and invalidates plans for the old parts.
    fn changed(&mut self) {
        self.lives = Arc::default();
        self.len = self.parts.values().map(Part::len).sum();
        self.blocks = self.parts.values().map(Part::blocks).sum();
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.len
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the number of parts.
    #[must_use]
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// Returns the SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.layout.degree
    }

    /// Returns the path by which SH is held.
    #[must_use]
    pub fn path(&self) -> ShPath {
        self.path
    }

    /// Returns the corners of a box around all positions that can be drawn; `None` if there are none.
    #[must_use]
    pub fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        self.parts.values().filter_map(|part| part.bounds).reduce(|[low, high], [least, most]| {
            [std::array::from_fn(|k| low[k].min(least[k])), std::array::from_fn(|k| high[k].max(most[k]))]
        })
    }

    /// Returns the numbers of bytes on the GPU.
    #[must_use]
    pub fn bytes(&self) -> SceneBytes {
        let mut bytes = SceneBytes { geometry: 0, sh: self.shared_bytes() };
        for chunk in self.chunks() {
            bytes.geometry += chunk.bodies.bytes() + chunk.shapes.bytes();
            bytes.sh += chunk.sh.iter().map(Buffer::bytes).sum::<u64>();
        }
        bytes
    }

    /// Returns the number of bytes for SH that all Gaussians share: dictionary or table.
    fn shared_bytes(&self) -> u64 {
        let table = self.table.as_ref().map_or(0, |table| table.bytes.size);
        self.atoms.as_ref().map_or(0, Buffer::bytes) + table
    }

    /// Returns the number of bytes that colouring one visible Gaussian moves on average: its slot, position, SH and
    /// colour. The dictionary or table is not counted, because caches hold it.
    #[must_use]
    pub fn shading_bytes(&self) -> f64 {
        let own = self.bytes().sh.saturating_sub(self.shared_bytes()) as f64 / f64::from(self.len.max(1));
        let (slot, body, colour) = (size_of::<u32>(), size_of::<[f32; 4]>(), size_of::<[f32; 3]>());
        own + (slot + body + colour) as f64
    }

    /// Returns the number of bytes of geometry that are read to find and project `visible` Gaussians: the positions of
    /// all Gaussians, and the slots, positions and shapes of the visible ones.
    #[must_use]
    pub fn looking_bytes(&self, visible: f64) -> f64 {
        let (slot, body, shape) = (size_of::<u32>(), size_of::<[f32; 4]>(), size_of::<[f32; 8]>());
        body as f64 * f64::from(self.len) + visible * (slot + body + shape) as f64
    }

    /// Returns the GPU that holds the scene.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Returns the number of blocks. Every chunk begins a block.
    pub(super) fn blocks(&self) -> u32 {
        self.blocks
    }

    /// Returns the chunks of all parts, in order.
    pub(super) fn chunks(&self) -> impl Iterator<Item = &ChunkBuffers> {
        self.parts.values().flat_map(|part| &part.chunks)
    }

    /// Returns the numbers that describe each chunk to kernels. The first Gaussian of a block has the number of the block
    /// times [`GROUP`]. The numbers after the last Gaussian of a short block are not used.
    pub(super) fn numbering(&self) -> Vec<ChunkUniform> {
        let mut first_block = 0;
        let number = |chunk: &ChunkBuffers| {
            let uniform = ChunkUniform {
                first: first_block * GROUP,
                count: chunk.count,
                first_block,
                blocks: chunk.blocks(),
                escapes_at: chunk.escapes_at,
                escapes: chunk.escapes,
                exact_at: chunk.exact_at,
                padding: 0,
            };
            first_block += chunk.blocks();
            uniform
        };
        self.chunks().map(number).collect()
    }
}

/// Returns an error if there are more Gaussians, or blocks of them, than kernels can number.
fn check_size(len: u64, blocks: u64) -> Result<()> {
    for (what, found, limit) in [
        ("Gaussians of a scene on the GPU", len, u64::from(u32::MAX) - 1),
        ("blocks of Gaussians of a scene on the GPU", blocks, u64::from(MAX_BLOCKS)),
    ] {
        if found > limit {
            return Err(Error::gpu_limit(what, found, limit));
        }
    }
    Ok(())
}
