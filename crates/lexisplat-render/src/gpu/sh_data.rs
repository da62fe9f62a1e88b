//! The arrays of a scene on the GPU, and how the scene is cut into chunks whose arrays fit in a binding.

use std::ops::Range;

use crate::conventions::ALPHA_MIN;
use crate::error::{Error, Result};
use crate::parallel::*;
use crate::scene::Scene;
use half::f16;
use lexisplat::sh::CHANNELS;
use lexisplat::{Geometry, Model};

use super::buffer::Buffer;
use super::columns::{escapes_in, group_words};
use super::constants::{COLUMN_GROUP, GROUP, vectors};
use super::device::Gpu;

/// Smaller log scales are raised to this: the exponential of a smaller one is not a normal number.
const LEAST_SCALE: f32 = -87.0;
/// Opacity logits are clamped to this on both sides: beyond it the opacity is 0 or 1 in f32.
const MOST_LOGIT: f32 = 80.0;
/// A Gaussian whose opacity logit is this far below that of `ALPHA_MIN` is invisible for sure.
const LOGIT_SLACK: f32 = 0.01;
/// Larger standard deviations are lowered to this. Their squares overflow, which the kernels test for.
const MOST_SIGMA: f32 = 1e30;

/// The SH of a scene, as the GPU will hold it.
pub(super) enum ShData<'a> {
    Dense { scene: &'a Scene<'a>, half: bool },
    Codes(&'a Model),
}

impl ShData<'_> {
    /// Whether the SH-rest of Gaussian `i` is finite. Codes always are.
    pub(super) fn finite(&self, i: usize) -> bool {
        match self {
            Self::Dense { scene: Scene::Dense(splats), .. } => {
                let dim = splats.degree.rest();
                splats.sh_rest[i * dim..(i + 1) * dim].iter().all(|v| v.is_finite())
            }
            _ => true,
        }
    }

    /// Cuts `len` Gaussians into runs. Each array of a run fits in `limit` bytes, and all runs but the last are
    /// whole blocks.
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
                return Err(Error::gpu_limit("bytes of 256 Gaussians on the GPU", found, limit));
            }
        }
        if start < len {
            chunks.push(start..len);
        }
        Ok(chunks)
    }

    /// Bytes that the arrays of every chunk have: of shapes, of rows or nonzeros, of atoms, and of columns.
    fn fixed(&self) -> [u64; 4] {
        match self {
            Self::Dense { .. } => [0; 4],
            Self::Codes(model) => [0, 0, (model.dictionary().len() * atom_bytes(model)) as u64, 0],
        }
    }

    /// Bytes that a block of Gaussians adds to those arrays.
    fn block_bytes(&self, range: Range<usize>) -> [u64; 4] {
        let shapes = range.len() as u64 * size_of::<[f32; 8]>() as u64;
        match self {
            Self::Dense { scene, half } => {
                let vector = if *half { size_of::<[f16; 4]>() } else { size_of::<[f32; 4]>() };
                let row = vectors(scene.degree().coefficients()) * vector;
                [shapes, (range.len() * row) as u64, 0, 0]
            }
            Self::Codes(model) => {
                let codes = model.codes();
                let words: usize = codes.counts()[range.clone()]
                    .chunks(COLUMN_GROUP as usize)
                    .map(|counts| group_words(codes, counts))
                    .sum();
                let escapes = escapes_in(model.codes(), &range).len();
                let row = escapes * atom_bytes(model);
                let columns = range.len() * size_of::<u32>();
                [shapes, 4 * words as u64, row as u64, columns as u64]
            }
        }
    }
}

/// Returns the position and the largest standard deviation of Gaussian `i`. The latter is -1 for one that is
/// never drawn.
pub(super) fn body(geometry: &Geometry, rest_finite: bool, i: usize) -> [f32; 4] {
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

/// Returns the log scales, the opacity logit and the quaternion of Gaussian `i`.
pub(super) fn shape(geometry: &Geometry, i: usize) -> [f32; 8] {
    let [a, b, c] = geometry.scales[i].map(|s| s.max(LEAST_SCALE));
    let [w, x, y, z] = geometry.rotations[i];
    [a, b, c, geometry.opacities[i].clamp(-MOST_LOGIT, MOST_LOGIT), w, x, y, z]
}

/// Uploads the dense rows of a run of Gaussians: coefficients in order, DC first, with the three channels side by
/// side.
pub(super) async fn dense_rows(
    gpu: &Gpu,
    scene: &Scene<'_>,
    range: Range<usize>,
    half: bool,
) -> Result<Buffer> {
    let per_channel = scene.degree().rest_per_channel();
    let dim = scene.degree().rest();
    let row_len = 4 * vectors(per_channel + 1);
    let mut rows = vec![0.0_f32; range.len() * row_len];
    rows.par_chunks_mut(row_len).zip(range).for_each(|(row, i)| {
        row[..CHANNELS].copy_from_slice(&scene.geometry().dc[i]);
        let mut decoded;
        let rest = match scene {
            Scene::Dense(splats) => &splats.sh_rest[i * dim..(i + 1) * dim],
            Scene::Sparse(model) => {
                decoded = vec![0.0; dim];
                model.codes().reconstruct(model.dictionary(), i, &mut decoded);
                &decoded
            }
        };
        interleave(rest, per_channel, &mut row[CHANNELS..]);
    });
    if half {
        let bits: Vec<u16> = rows.par_iter().map(|&v| f16::from_f32(v).to_bits()).collect();
        return gpu.upload("dense rows", &bits).await;
    }
    gpu.upload("dense rows", &rows).await
}

/// Copies a channel-major row to `out`, with the channels of each coefficient side by side.
fn interleave(row: &[f32], per_channel: usize, out: &mut [f32]) {
    for (k, out) in out.chunks_exact_mut(CHANNELS).take(per_channel).enumerate() {
        for (c, out) in out.iter_mut().enumerate() {
            *out = row[c * per_channel + k];
        }
    }
}

/// Bytes of an atom or exact row as kernels read them.
fn atom_bytes(model: &Model) -> usize {
    vectors(model.dictionary().degree().rest_per_channel()) * size_of::<[f32; 4]>()
}

/// Returns the atoms, and the exact rows of the escaped Gaussians in `range`. Each is filled up to whole
/// vectors.
pub(super) fn atoms(model: &Model, range: &Range<usize>) -> Vec<f32> {
    let dictionary = model.dictionary();
    let (dim, per_channel) = (dictionary.dim(), dictionary.degree().rest_per_channel());
    let escapes = escapes_in(model.codes(), range);
    let rows = &model.codes().escapes().rows[escapes.start * dim..escapes.end * dim];
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
