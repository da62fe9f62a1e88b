//! A scene on the GPU.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use lexisplat::{Geometry, ShDegree};

use crate::error::{Error, Result};
use crate::parallel::*;
use crate::scene::Scene;

use super::buffer::Buffer;
use super::columns::Columns;
use super::constants::GROUP;
use super::device::Gpu;
use super::path::ShPath;
use super::radiance::radiance_pipeline;
use super::radiance_table::RadianceTable;
use super::sh_data::{ShData, atoms, body, dense_rows, shape};
use super::uniforms::ChunkUniform;

/// Bytes of a scene on the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SceneBytes {
    /// Positions, shapes and opacities.
    pub geometry: u64,
    /// Everything that colours need: base colours, coefficients or codes, dictionary, table.
    pub sh: u64,
}

/// A scene uploaded for one [`ShPath`]. The scene that it was made from may be dropped.
#[derive(Debug)]
pub struct GpuScene {
    pub(super) id: u64,
    /// Plans hold weak references to this, and so know whether the scene still lives.
    pub(super) lives: Arc<()>,
    pub(super) chunks: Vec<ChunkBuffers>,
    pub(super) chunk_blocks: Buffer,
    pub(super) radiance: wgpu::ComputePipeline,
    pub(super) table: Option<RadianceTable>,
    /// The corners of a box around all positions that can be drawn; `None` if there are none.
    pub(super) bounds: Option<[[f32; 3]; 2]>,
    gpu: Gpu,
    path: ShPath,
    len: u32,
    degree: ShDegree,
    pub(super) antialiased: bool,
    bytes: SceneBytes,
    /// Those of the bytes for SH that all Gaussians share: dictionary and table.
    shared_bytes: u64,
}

/// The buffers of a part of the scene.
#[derive(Debug)]
pub(super) struct ChunkBuffers {
    pub(super) blocks: u32,
    pub(super) uniform: Buffer,
    pub(super) bodies: Buffer,
    pub(super) shapes: Buffer,
    /// What the radiance kernel has from binding 6 on: dense rows; or base colours, columns, nonzeros and atoms.
    pub(super) sh: Vec<Buffer>,
}

/// The number of the next scene. Numbers keep bindings made for one scene from being used for another.
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
    /// [`Error::Codec`] if the scene's arrays do not fit one another; [`Error::Parameter`] for a sparse path
    /// of a dense scene, or a dictionary too large for the path; [`Error::GpuLimit`] for more Gaussians than
    /// 2^32 - 2; [`Error::Gpu`] if memory runs out.
    pub async fn new_async(gpu: &Gpu, scene: &Scene<'_>, path: ShPath) -> Result<Self> {
        scene.validate()?;
        let len = u32::try_from(scene.len()).ok().filter(|&n| n < u32::MAX).ok_or_else(|| {
            let (found, limit) = (scene.len() as u64, u64::from(u32::MAX) - 1);
            Error::gpu_limit("Gaussians of a scene on the GPU", found, limit)
        })?;
        let sh = match scene {
            _ if !path.is_sparse() => ShData::Dense { scene, half: path == ShPath::DenseF16 },
            Scene::Sparse(model) => ShData::Codes(model),
            Scene::Dense(_) => {
                return Err(Error::parameter("path", path.name(), "a compressed scene for a sparse path"));
            }
        };
        let table = match (path, &sh) {
            (ShPath::SparseTable, ShData::Codes(model)) => {
                Some(RadianceTable::new(gpu, model.dictionary()).await?)
            }
            _ => None,
        };
        let radiance = radiance_pipeline(gpu, &sh, path).await?;
        let ranges = sh.chunks(scene.len(), gpu.max_binding())?;
        // Numbers of Gaussians fit in 32 bits, as checked above.
        let ends =
            ranges.iter().map(|range| u32::try_from(range.end.div_ceil(GROUP as usize)).unwrap_or(u32::MAX));
        let chunk_blocks: Vec<u32> = std::iter::once(0).chain(ends).collect();
        let shared_bytes = table.as_ref().map_or(0, |table| table.bytes.size);
        let mut this = Self {
            id: NEXT_ID.fetch_add(1, Relaxed),
            lives: Arc::default(),
            chunks: Vec::new(),
            chunk_blocks: gpu.upload("chunk blocks", &chunk_blocks).await?,
            radiance,
            bounds: None,
            gpu: gpu.clone(),
            path,
            len,
            degree: scene.degree(),
            antialiased: scene.meta().antialiased,
            bytes: SceneBytes { geometry: 0, sh: shared_bytes },
            shared_bytes,
            table,
        };
        let mut nonzero = 0;
        for range in ranges {
            this.add(scene.geometry(), &sh, range.clone(), nonzero).await?;
            if let ShData::Codes(model) = sh {
                nonzero +=
                    model.codes().counts()[range.clone()].iter().map(|&c| usize::from(c)).sum::<usize>();
            }
        }
        gpu.wait_async().await?;
        Ok(this)
    }

    /// Uploads one chunk, whose codes begin at nonzero `nonzero`.
    async fn add(
        &mut self,
        geometry: &Geometry,
        data: &ShData<'_>,
        range: Range<usize>,
        nonzero: usize,
    ) -> Result<()> {
        let gpu = self.gpu.clone();
        let bodies: Vec<[f32; 4]> =
            range.clone().into_par_iter().map(|i| body(geometry, data.finite(i), i)).collect();
        for body in bodies.iter().filter(|body| body[3] >= 0.0) {
            let at = [body[0], body[1], body[2]];
            let [low, high] = self.bounds.get_or_insert([at, at]);
            for k in 0..3 {
                low[k] = low[k].min(at[k]);
                high[k] = high[k].max(at[k]);
            }
        }
        let shapes: Vec<[f32; 8]> = range.clone().into_par_iter().map(|i| shape(geometry, i)).collect();
        let (bodies, shapes) = (gpu.upload("bodies", &bodies).await?, gpu.upload("shapes", &shapes).await?);
        let mut escapes = [0, 0];
        let sh = match data {
            ShData::Dense { scene, half } => vec![dense_rows(&gpu, scene, range.clone(), *half).await?],
            ShData::Codes(model) => {
                let columns = Columns::new(model.codes(), range.clone(), nonzero);
                escapes =
                    [columns.escapes_at, columns.escapes()].map(|v| u32::try_from(v).unwrap_or(u32::MAX));
                vec![
                    gpu.upload("base colours", &geometry.dc[range.clone()]).await?,
                    gpu.upload("columns", &columns.columns).await?,
                    gpu.upload("nonzeros", &columns.nonzeros).await?,
                    gpu.upload("atoms", &atoms(model, &range)).await?,
                ]
            }
        };
        // Numbers of Gaussians fit in 32 bits, as checked above.
        let number = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
        let first = number(range.start);
        let blocks = number(range.len().div_ceil(GROUP as usize));
        let uniform = ChunkUniform {
            first,
            count: number(range.len()),
            first_block: first / GROUP,
            blocks,
            escapes_at: escapes[0],
            escapes: escapes[1],
            padding: [0; 2],
        };
        let uniform = gpu.checked("chunk", || gpu.uniform("chunk", &uniform)).await?;
        // Where there are codes, the last buffer has the atoms.
        self.shared_bytes += sh.get(3).map_or(0, Buffer::bytes);
        self.bytes.geometry += bodies.bytes() + shapes.bytes();
        self.bytes.sh += sh.iter().map(Buffer::bytes).sum::<u64>();
        self.chunks.push(ChunkBuffers { blocks, uniform, bodies, shapes, sh });
        Ok(())
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.len
    }

    /// Whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.degree
    }

    /// How SH is held.
    #[must_use]
    pub fn path(&self) -> ShPath {
        self.path
    }

    /// Bytes on the GPU.
    #[must_use]
    pub fn bytes(&self) -> SceneBytes {
        self.bytes
    }

    /// Bytes that colouring one visible Gaussian moves on average: its slot, position, SH and colour. The
    /// dictionary or table is not counted, since caches hold it.
    #[must_use]
    pub fn shading_bytes(&self) -> f64 {
        let own = self.bytes.sh.saturating_sub(self.shared_bytes) as f64 / f64::from(self.len.max(1));
        let (slot, body, colour) = (size_of::<u32>(), size_of::<[f32; 4]>(), size_of::<[f32; 3]>());
        own + (slot + body + colour) as f64
    }

    /// Bytes of geometry that finding and projecting `visible` Gaussians reads: the positions of all, and the slots,
    /// positions and shapes of those.
    #[must_use]
    pub fn looking_bytes(&self, visible: f64) -> f64 {
        let (slot, body, shape) = (size_of::<u32>(), size_of::<[f32; 4]>(), size_of::<[f32; 8]>());
        body as f64 * f64::from(self.len) + visible * (slot + body + shape) as f64
    }

    /// The GPU that holds it.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub(super) fn blocks(&self) -> u32 {
        self.len.div_ceil(GROUP)
    }
}
