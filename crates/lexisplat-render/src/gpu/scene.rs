//! A scene on the GPU.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use half::f16;
use lexisplat::sh::CHANNELS;
use lexisplat::{Dictionary, Geometry, Model, ShDegree};
use rayon::prelude::*;

use crate::conventions::ALPHA_MIN;
use crate::error::{Error, Result};
use crate::scene::Scene;

use super::columns::{Columns, group_words};
use super::constants::{COLUMN_GROUP, GROUP, atom_terms, dense_terms, shared_atom_terms, vectors};
use super::device::{Buffer, Counted, Gpu};
use super::shaders::{Bound, compile, pipeline};
use super::table;
use super::uniforms::Chunk;

/// How SH is held and evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ShPath {
    /// Every coefficient in 32 bits.
    DenseF32,
    /// Every coefficient in 16 bits.
    DenseF16,
    /// Sparse codes, the dictionary read through the cache.
    Sparse,
    /// As [`Self::Sparse`], each group's Gaussians ordered by nonzeros before they are shaded.
    SparseOrdered,
    /// Sparse codes, the dictionary in workgroup memory. For dictionaries that fit there.
    SparseShared,
    /// Sparse codes, each atom's radiance from a table over directions: an approximation.
    SparseTable,
}

impl ShPath {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::DenseF32,
        Self::DenseF16,
        Self::Sparse,
        Self::SparseOrdered,
        Self::SparseShared,
        Self::SparseTable,
    ];

    /// Its name in reports and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DenseF32 => "dense-f32",
            Self::DenseF16 => "dense-f16",
            Self::Sparse => "sparse",
            Self::SparseOrdered => "sparse-ordered",
            Self::SparseShared => "sparse-shared",
            Self::SparseTable => "sparse-table",
        }
    }

    /// Whether it needs a compressed scene.
    #[must_use]
    pub fn is_sparse(self) -> bool {
        !matches!(self, Self::DenseF32 | Self::DenseF16)
    }

    /// What draws `scene` as it is stored, exactly.
    #[must_use]
    pub fn of(scene: &Scene<'_>) -> Self {
        match scene {
            Scene::Dense(_) => Self::DenseF32,
            Scene::Sparse(_) => Self::SparseOrdered,
        }
    }
}

impl std::str::FromStr for ShPath {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|path| path.name() == text);
        found.ok_or_else(|| Error::parameter("path", text, format!("one of {}", names())))
    }
}

/// Bytes of a scene on the GPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SceneBytes {
    /// Positions, shapes and opacities.
    pub geometry: u64,
    /// Everything colour needs: base colours, coefficients or codes, dictionary, table.
    pub sh: u64,
}

/// A scene uploaded for one [`ShPath`]. Of its own size on the GPU; the source may be dropped.
#[derive(Debug)]
pub struct GpuScene {
    pub(super) id: u64,
    pub(super) chunks: Vec<ChunkBuffers>,
    pub(super) chunk_blocks: Buffer,
    pub(super) radiance: wgpu::ComputePipeline,
    pub(super) table: Option<Table>,
    /// Corners of what can be seen, if anything.
    pub(super) bounds: Option<[[f32; 3]; 2]>,
    gpu: Gpu,
    path: ShPath,
    len: u32,
    degree: ShDegree,
    antialiased: bool,
    bytes: SceneBytes,
    /// Of those for SH, what all Gaussians share.
    shared_bytes: u64,
}

/// Buffers of a part of the scene.
#[derive(Debug)]
pub(super) struct ChunkBuffers {
    pub(super) blocks: u32,
    pub(super) uniform: Buffer,
    pub(super) bodies: Buffer,
    pub(super) shapes: Buffer,
    /// From binding 6 of radiance: dense rows; or base colours, columns, nonzeros, atoms.
    pub(super) sh: Vec<Buffer>,
}

#[derive(Debug)]
pub(super) struct Table {
    pub(super) view: wgpu::TextureView,
    pub(super) sampler: wgpu::Sampler,
    bytes: Counted,
}

/// Numbers scenes, so that bindings made for one are not used for another.
static NEXT_ID: AtomicU64 = AtomicU64::new(0);
/// Log scales below this, whose exponential is no normal number, count as this.
const LEAST_SCALE: f32 = -87.0;
/// Opacity logits are clamped to this: beyond it the opacity is 0 or 1 in f32.
const MOST_LOGIT: f32 = 80.0;
/// Logits this far below that of `ALPHA_MIN` are surely invisible.
const LOGIT_SLACK: f32 = 0.01;
/// Standard deviations stay below this, so that squares of them overflow in the kernels' own tests.
const MOST_SIGMA: f32 = 1e30;

impl GpuScene {
    /// Uploads `scene`.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a sparse path of a dense scene, or a dictionary too large for the path;
    /// [`Error::Limit`] for more Gaussians than 2^32 - 2; [`Error::Gpu`] if memory runs out.
    pub fn new(gpu: &Gpu, scene: &Scene<'_>, path: ShPath) -> Result<Self> {
        let len = u32::try_from(scene.len()).ok().filter(|&n| n < u32::MAX).ok_or_else(|| Error::Limit {
            what: "Gaussians of a scene on the GPU".to_owned(),
            found: scene.len() as u64,
            limit: u64::from(u32::MAX) - 1,
        })?;
        let model = match scene {
            Scene::Sparse(model) => Some(*model),
            Scene::Dense(_) => None,
        };
        let source = match (path.is_sparse(), model) {
            (false, _) => Source::Dense { scene, half: path == ShPath::DenseF16 },
            (true, Some(model)) => Source::Codes(model),
            (true, None) => {
                return Err(Error::parameter("path", path.name(), "a compressed scene for a sparse path"));
            }
        };
        let table = match (path, model) {
            (ShPath::SparseTable, Some(model)) => Some(Table::new(gpu, &model.dictionary)?),
            _ => None,
        };
        let radiance = radiance_pipeline(gpu, &source, path)?;
        let mut this = Self {
            id: NEXT_ID.fetch_add(1, Relaxed),
            chunks: Vec::new(),
            chunk_blocks: gpu.upload::<u32>("chunk blocks", &[0])?,
            radiance,
            bounds: None,
            gpu: gpu.clone(),
            path,
            len,
            degree: scene.degree(),
            antialiased: scene.meta().antialiased,
            bytes: SceneBytes { geometry: 0, sh: table.as_ref().map_or(0, |t| t.bytes.size()) },
            shared_bytes: table.as_ref().map_or(0, |t| t.bytes.size()),
            table,
        };
        let mut chunk_blocks = vec![0];
        let mut nonzero = 0;
        for range in source.chunks(scene.len(), gpu.max_binding())? {
            this.add(scene.geometry(), &source, range.clone(), nonzero)?;
            if let Source::Codes(model) = source {
                nonzero += model.codes.counts()[range.clone()].iter().map(|&c| usize::from(c)).sum::<usize>();
            }
            chunk_blocks.push(u32::try_from(range.end.div_ceil(GROUP as usize)).unwrap_or(u32::MAX));
        }
        this.chunk_blocks = gpu.upload("chunk blocks", &chunk_blocks)?;
        gpu.wait()?;
        Ok(this)
    }

    /// Uploads one chunk.
    fn add(
        &mut self,
        geometry: &Geometry,
        source: &Source<'_>,
        range: Range<usize>,
        nonzero: usize,
    ) -> Result<()> {
        let gpu = self.gpu.clone();
        let bodies: Vec<[f32; 4]> =
            range.clone().into_par_iter().map(|i| body(geometry, source.finite(i), i)).collect();
        for body in bodies.iter().filter(|body| body[3] >= 0.0) {
            let at = [body[0], body[1], body[2]];
            let [low, high] = self.bounds.get_or_insert([at, at]);
            for k in 0..3 {
                low[k] = low[k].min(at[k]);
                high[k] = high[k].max(at[k]);
            }
        }
        let shapes: Vec<[f32; 8]> = range.clone().into_par_iter().map(|i| shape(geometry, i)).collect();
        let (bodies, shapes) = (gpu.upload("bodies", &bodies)?, gpu.upload("shapes", &shapes)?);
        let mut escapes = [0, 0];
        let sh = match source {
            Source::Dense { scene, half } => vec![dense_rows(&gpu, scene, range.clone(), *half)?],
            Source::Codes(model) => {
                let columns = Columns::new(&model.codes, range.clone(), nonzero);
                escapes =
                    [columns.escapes_at, columns.escapes()].map(|v| u32::try_from(v).unwrap_or(u32::MAX));
                vec![
                    gpu.upload("base colours", &geometry.dc[range.clone()])?,
                    gpu.upload("columns", &columns.columns)?,
                    gpu.upload("nonzeros", &columns.nonzeros)?,
                    gpu.upload("atoms", &atoms(model, &range))?,
                ]
            }
        };
        // Numbers of Gaussians fit in 32 bits, as checked above.
        let number = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
        let first = number(range.start);
        let blocks = number(range.len().div_ceil(GROUP as usize));
        let uniform = gpu.uniform(
            "chunk",
            &Chunk {
                first,
                count: number(range.len()),
                first_block: first / GROUP,
                blocks,
                escapes_at: escapes[0],
                escapes: escapes[1],
                index: number(self.chunks.len()),
                padding: 0,
            },
        )?;
        // Of codes, the last buffer is the atoms.
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

    /// Bytes that shading one visible Gaussian moves on average: its slot, position, SH and colour. The
    /// dictionary or table, which caches hold, is not counted.
    #[must_use]
    pub fn shading_bytes(&self) -> f64 {
        let shared: u64 = self.shared_bytes;
        let own = self.bytes.sh.saturating_sub(shared) as f64 / f64::from(self.len.max(1));
        let (slot, body, colour) = (size_of::<u32>(), size_of::<[f32; 4]>(), size_of::<[f32; 3]>());
        own + (slot + body + colour) as f64
    }

    /// The GPU that holds it.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    pub(super) fn antialiased(&self) -> bool {
        self.antialiased
    }

    pub(super) fn blocks(&self) -> u32 {
        self.len.div_ceil(GROUP)
    }
}

/// Where SH comes from.
pub(super) enum Source<'a> {
    Dense { scene: &'a Scene<'a>, half: bool },
    Codes(&'a Model),
}

impl Source<'_> {
    /// Whether the SH-rest of Gaussian `i` is finite. Codes always are.
    fn finite(&self, i: usize) -> bool {
        match self {
            Self::Dense { scene: Scene::Dense(splats), .. } => {
                let dim = splats.degree.rest();
                splats.sh_rest[i * dim..(i + 1) * dim].iter().all(|v| v.is_finite())
            }
            _ => true,
        }
    }

    /// Cuts `len` Gaussians into runs each of whose arrays fits in `limit` bytes. All but the last are whole
    /// blocks.
    pub(super) fn chunks(&self, len: usize, limit: u64) -> Result<Vec<Range<usize>>> {
        let block = GROUP as usize;
        let mut chunks = Vec::new();
        let mut start = 0;
        let mut used = self.fixed();
        for first in (0..len).step_by(block) {
            let range = first..(first + block).min(len);
            let more = self.block_bytes(range);
            let with = |used: [u64; 4]| -> [u64; 4] { std::array::from_fn(|k| used[k] + more[k]) };
            let fits = |bytes: [u64; 4]| bytes.iter().all(|&bytes| bytes <= limit);
            if first > start && !fits(with(used)) {
                chunks.push(start..first);
                start = first;
                used = self.fixed();
            }
            used = with(used);
            if !fits(used) {
                let found = used.into_iter().max().unwrap_or(0);
                let what = "bytes of 256 Gaussians on the GPU".to_owned();
                return Err(Error::Limit { what, found, limit });
            }
        }
        if start < len {
            chunks.push(start..len);
        }
        Ok(chunks)
    }

    /// Bytes that every chunk's arrays have: shapes, rows or nonzeros, atoms, columns.
    fn fixed(&self) -> [u64; 4] {
        match self {
            Self::Dense { .. } => [0; 4],
            Self::Codes(model) => [0, 0, (model.dictionary.len() * atom_bytes(model)) as u64, 0],
        }
    }

    /// Bytes that a block of Gaussians adds to them.
    fn block_bytes(&self, range: Range<usize>) -> [u64; 4] {
        let shapes = range.len() as u64 * size_of::<[f32; 8]>() as u64;
        match self {
            Self::Dense { scene, half } => {
                let vector = if *half { size_of::<[f16; 4]>() } else { size_of::<[f32; 4]>() };
                let row = vectors(scene.degree().coefficients()) * vector;
                [shapes, (range.len() * row) as u64, 0, 0]
            }
            Self::Codes(model) => {
                let codes = &model.codes;
                let words: usize = codes.counts()[range.clone()]
                    .chunks(COLUMN_GROUP as usize)
                    .map(|counts| group_words(codes, counts))
                    .sum();
                let escapes = escapes_in(model, &range).len();
                let row = escapes * atom_bytes(model);
                let columns = range.len() * size_of::<u32>();
                [shapes, 4 * words as u64, row as u64, columns as u64]
            }
        }
    }
}

/// Which of the escapes lie in `range`.
fn escapes_in(model: &Model, range: &Range<usize>) -> Range<usize> {
    let before = |end: usize| model.codes.escapes().gaussians.partition_point(|&g| (g as usize) < end);
    before(range.start)..before(range.end)
}

/// Position and the largest standard deviation, or -1 for what is never drawn.
fn body(geometry: &Geometry, rest_finite: bool, i: usize) -> [f32; 4] {
    let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
    let (position, scales) = (geometry.positions[i], geometry.scales[i]);
    let drawn = rest_finite
        && finite(&position)
        && finite(&geometry.rotations[i])
        && finite(&geometry.dc[i])
        && scales.iter().all(|&s| s < f32::INFINITY)
        && geometry.opacities[i] >= (ALPHA_MIN / (1.0 - ALPHA_MIN)).ln() - LOGIT_SLACK;
    let largest = scales.iter().copied().fold(LEAST_SCALE, f32::max).exp().min(MOST_SIGMA);
    [position[0], position[1], position[2], if drawn { largest } else { -1.0 }]
}

/// Log scales, opacity logit, quaternion.
fn shape(geometry: &Geometry, i: usize) -> [f32; 8] {
    let [a, b, c] = geometry.scales[i].map(|s| s.max(LEAST_SCALE));
    let [w, x, y, z] = geometry.rotations[i];
    [a, b, c, geometry.opacities[i].clamp(-MOST_LOGIT, MOST_LOGIT), w, x, y, z]
}

/// Dense rows of a run of Gaussians: coefficients in order, DC first, three channels side by side.
fn dense_rows(gpu: &Gpu, scene: &Scene<'_>, range: Range<usize>, half: bool) -> Result<Buffer> {
    let per_channel = scene.degree().rest_per_channel();
    let dim = scene.degree().rest();
    let row_len = 4 * vectors(per_channel + 1);
    let mut rows = vec![0.0_f32; range.len() * row_len];
    rows.par_chunks_exact_mut(row_len).zip(range).for_each(|(row, i)| {
        row[..CHANNELS].copy_from_slice(&scene.geometry().dc[i]);
        let mut decoded;
        let rest = match scene {
            Scene::Dense(splats) => &splats.sh_rest[i * dim..(i + 1) * dim],
            Scene::Sparse(model) => {
                decoded = vec![0.0; dim];
                model.codes.reconstruct(&model.dictionary, i, &mut decoded);
                &decoded
            }
        };
        interleave(rest, per_channel, &mut row[CHANNELS..]);
    });
    if half {
        let halves: Vec<f16> = rows.par_iter().map(|&v| f16::from_f32(v)).collect();
        let bits: &[u16] =
            bytemuck::cast_slice(half::slice::HalfFloatSliceExt::reinterpret_cast(&halves[..]));
        return gpu.upload("dense rows", bits);
    }
    gpu.upload("dense rows", &rows)
}

/// A channel-major row with the channels of each coefficient side by side.
fn interleave(row: &[f32], per_channel: usize, out: &mut [f32]) {
    for (k, out) in out.chunks_exact_mut(CHANNELS).take(per_channel).enumerate() {
        for (c, out) in out.iter_mut().enumerate() {
            *out = row[c * per_channel + k];
        }
    }
}

/// Bytes of an atom or exact row as kernels read them.
fn atom_bytes(model: &Model) -> usize {
    vectors(model.dictionary.degree().rest_per_channel()) * size_of::<[f32; 4]>()
}

/// The atoms, and the exact rows of the escaped Gaussians in `range`, each filled up to whole vectors.
fn atoms(model: &Model, range: &Range<usize>) -> Vec<f32> {
    let dictionary = &model.dictionary;
    let (dim, per_channel) = (dictionary.dim(), dictionary.degree().rest_per_channel());
    let escapes = escapes_in(model, range);
    let rows = &model.codes.escapes().rows[escapes.start * dim..escapes.end * dim];
    let row_len = 4 * vectors(per_channel);
    let mut out = vec![0.0; (dictionary.len() + escapes.len()) * row_len];
    if dim > 0 {
        let all = dictionary.as_slice().chunks_exact(dim).chain(rows.chunks_exact(dim));
        for (row, out) in all.zip(out.chunks_exact_mut(row_len)) {
            interleave(row, per_channel, out);
        }
    }
    out
}

/// Bytes that the shared path leaves of workgroup memory for the compiler's own use.
const SHARED_RESERVE: usize = 64;

fn radiance_pipeline(gpu: &Gpu, source: &Source<'_>, path: ShPath) -> Result<wgpu::ComputePipeline> {
    if let (Source::Codes(model), ShPath::SparseShared) = (source, path) {
        let shared = size_of_val(model.dictionary.as_slice());
        let most = gpu.limits().max_compute_workgroup_storage_size as usize;
        if shared + SHARED_RESERVE > most {
            let expected = format!("a dictionary of at most {most} bytes for this GPU's workgroup memory");
            return Err(Error::parameter("dictionary", format!("{shared} bytes"), expected));
        }
    }
    pipeline(gpu, &compile(gpu, path.name(), &radiance_text(source, path))?, "radiance")
}

/// The kernel that colours scenes like `source`.
pub(super) fn radiance_text(source: &Source<'_>, path: ShPath) -> String {
    let common = concat!(include_str!("kernels/frame.wgsl"), include_str!("kernels/radiance.wgsl"));
    let codes = include_str!("kernels/radiance_sparse.wgsl");
    match source {
        Source::Dense { scene, half } => {
            let per_channel = scene.degree().rest_per_channel();
            let load = |v: usize| {
                let at = format!("rows[row + {v}u]");
                if *half {
                    format!("vec4<f32>(unpack2x16float({at}.x), unpack2x16float({at}.y))")
                } else {
                    at
                }
            };
            let terms = dense_terms(per_channel, load);
            let row = if *half { "vec2<u32>" } else { "vec4<f32>" };
            let vectors = vectors(per_channel + 1);
            let dense = include_str!("kernels/radiance_dense.wgsl")
                .replace("ROW_TYPE", row)
                .replace("// DENSE_TERMS", &terms);
            format!("const ROW_VECTORS: u32 = {vectors}u;\n{common}{dense}")
        }
        Source::Codes(model) => {
            let dictionary = &model.dictionary;
            let entry = match path {
                ShPath::SparseOrdered => include_str!("kernels/radiance_ordered.wgsl"),
                ShPath::SparseShared => include_str!("kernels/radiance_shared.wgsl"),
                ShPath::SparseTable => include_str!("kernels/radiance_table.wgsl"),
                _ => include_str!("kernels/radiance_codes.wgsl"),
            };
            let (index, value) = (model.codes.indices().width(), model.codes.values().width());
            let per_channel = dictionary.degree().rest_per_channel();
            let codes = codes.replace("// ATOM_TERMS", &atom_terms(per_channel));
            let entry = entry.replace("// SHARED_TERMS", &shared_atom_terms(per_channel));
            format!(
                "const INDEX_BYTES: u32 = {index}u;\nconst INDEX_MASK: u32 = {}u;\n\
                 const VALUE_BYTES: u32 = {value}u;\nconst ATOMS: u32 = {}u;\nconst DIM: u32 = {}u;\n\
                 const ATOM_VECTORS: u32 = {}u;\nconst DICTIONARY: u32 = {}u;\n{common}{codes}{entry}",
                if index == 1 { 0xff } else { 0xffff },
                dictionary.len(),
                dictionary.dim().max(1),
                vectors(per_channel),
                dictionary.as_slice().len().max(1),
            )
        }
    }
}

impl Table {
    fn new(gpu: &Gpu, dictionary: &Dictionary) -> Result<Self> {
        let side = super::constants::TABLE_SIDE;
        let layers = u32::try_from(dictionary.len()).unwrap_or(u32::MAX).max(1);
        let most = gpu.limits().max_texture_array_layers;
        if layers > most {
            let expected = format!("at most {most} atoms for this GPU's texture layers");
            return Err(Error::parameter("dictionary", format!("{layers} atoms"), expected));
        }
        let size = wgpu::Extent3d { width: table::FACES * side, height: side, depth_or_array_layers: layers };
        let texel = size_of::<[f16; 4]>();
        let texture = gpu.checked("table", || {
            gpu.device().create_texture(&wgpu::TextureDescriptor {
                label: Some("atom radiance"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba16Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            })
        })?;
        let texels: Vec<u16> = table::texels(dictionary).iter().flatten().map(|v| v.to_bits()).collect();
        let per_row = u32::try_from(texel).unwrap_or(0) * size.width;
        if !dictionary.is_empty() {
            gpu.queue().write_texture(
                texture.as_image_copy(),
                bytemuck::cast_slice(&texels),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(per_row),
                    rows_per_image: Some(side),
                },
                size,
            );
        }
        let bytes = gpu.count(u64::from(per_row) * u64::from(side) * u64::from(layers));
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        let sampler = gpu.device().create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        Ok(Self { view, sampler, bytes })
    }

    /// What radiance is given after the buffers.
    pub(super) fn bound(&self) -> [(u32, Bound<'_>); 2] {
        [(10, Bound::Texture(&self.view)), (11, Bound::Sampler(&self.sampler))]
    }
}
