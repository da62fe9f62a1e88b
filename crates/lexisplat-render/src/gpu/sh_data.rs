//! Makes the arrays of a scene for the GPU, Gaussian by Gaussian.

use half::f16;
use lexisplat::sh::CHANNELS;
use lexisplat::{Geometry, Model};

use crate::conventions::ALPHA_MIN;
use crate::error::{Error, Result};
use crate::scene::Scene;

use super::constants::vectors;
use super::part_layout::{ShKind, ShLayout};
use crate::sh_path::ShPath;

/// Smallest log scale. Smaller ones are raised to this, because their exponential is not a normal number.
const LEAST_SCALE: f32 = -87.0;
/// Largest absolute opacity logit. Logits are clamped to it, because the opacity beyond it is 0 or 1 in `f32`.
const MOST_LOGIT: f32 = 80.0;
/// A Gaussian whose opacity logit is this far below that of `ALPHA_MIN` is certainly invisible.
const LOGIT_SLACK: f32 = 0.01;
/// Largest standard deviation. Larger ones are lowered to this. Their squares overflow, and the kernels test for that.
const MOST_SIGMA: f32 = 1e30;

/// The SH of a scene, in the form in which the GPU will hold it.
pub(super) enum ShData<'a> {
    Dense { scene: &'a Scene<'a>, half: bool },
    Codes(&'a Model),
}

impl<'a> ShData<'a> {
    /// Returns the SH of `scene` for `path`. Returns an error for a sparse path of a dense scene.
    pub(super) fn new(scene: &'a Scene<'a>, path: ShPath) -> Result<Self> {
        match scene {
            _ if !path.is_sparse() => Ok(Self::Dense { scene, half: path == ShPath::DenseF16 }),
            Scene::Sparse(model) => Ok(Self::Codes(model)),
            Scene::Dense(_) => {
                Err(Error::parameter("path", path.name(), "a compressed scene for a sparse path"))
            }
        }
    }

    /// Returns the layout of the SH.
    pub(super) fn layout(&self) -> ShLayout {
        // Numbers of bytes are at most 4, and numbers of atoms at most `lexisplat::MAX_ATOMS`.
        let number = |v: usize| u32::try_from(v).unwrap_or(u32::MAX);
        match self {
            Self::Dense { scene, half } => {
                ShLayout { degree: scene.degree(), kind: ShKind::Dense { half: *half } }
            }
            Self::Codes(model) => {
                let (codes, atoms) = (model.codes(), number(model.dictionary().len()));
                let (index, value) = (number(codes.indices().width()), number(codes.values().width()));
                ShLayout { degree: model.degree(), kind: ShKind::Codes { index, value, atoms } }
            }
        }
    }

    /// Returns whether the SH-rest of Gaussian `i` is finite. Codes are always finite.
    pub(super) fn finite(&self, i: usize) -> bool {
        match self {
            Self::Dense { scene: Scene::Dense(splats), .. } => {
                let dim = splats.degree.rest();
                splats.sh_rest[i * dim..(i + 1) * dim].iter().all(|v| v.is_finite())
            }
            _ => true,
        }
    }
}

/// Returns the position and the largest standard deviation of Gaussian `i`. The standard deviation is -1 for a Gaussian
/// that is never drawn.
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

/// Writes the dense row of Gaussian `i` of `scene` to `out`, in 32 or 16 bits: coefficients in order, DC first, with
/// the three channels side by side.
pub(super) fn dense_row(scene: &Scene<'_>, i: usize, half: bool, out: &mut [u32]) {
    let dim = scene.degree().rest();
    let decoded: Vec<f32>;
    let rest = match scene {
        Scene::Dense(splats) => &splats.sh_rest[i * dim..(i + 1) * dim],
        Scene::Sparse(model) => {
            let mut row = vec![0.0; dim];
            model.codes().reconstruct(model.dictionary(), i, &mut row);
            decoded = row;
            &decoded
        }
    };
    let mut row = vec![0; 4 * vectors(scene.degree().coefficients())];
    row[..CHANNELS].copy_from_slice(&scene.geometry().dc[i].map(f32::to_bits));
    exact_row(rest, &mut row[CHANNELS..CHANNELS + dim]);
    if half {
        let bits = |word: u32| u32::from(f16::from_f32(f32::from_bits(word)).to_bits());
        for (out, pair) in out.iter_mut().zip(row.chunks_exact(2)) {
            *out = bits(pair[0]) | bits(pair[1]) << 16;
        }
    } else {
        out.copy_from_slice(&row);
    }
}

/// Copies a channel-major row to `out`, which has the same length. In `out` the channels of each coefficient are side by
/// side.
pub(super) fn exact_row(row: &[f32], out: &mut [u32]) {
    let per_channel = row.len() / CHANNELS;
    for (k, out) in out.chunks_exact_mut(CHANNELS).enumerate() {
        for (c, out) in out.iter_mut().enumerate() {
            *out = row[c * per_channel + k].to_bits();
        }
    }
}
