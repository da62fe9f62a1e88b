//! A scene as it is packed: each ellipsoid described in one of its 24 ways, in the order of its cells.

use super::morton;
use crate::maths::{Vec3, columns, cross, log_sigmoid};
use crate::sensitivity::Sensitivity;
use crate::splats::Splats;

/// Thinnest axis kept apart, as the logarithm of its ratio to the longest: thinner ones show as lines
/// all the same, since pictures blur by 0.3 squared pixels.
const MAX_THINNESS: f32 = 9.0;
/// Largest logarithm of a standard deviation, either sign: beyond it exp leaves f32.
const MAX_LOG_SCALE: f32 = 40.0;
/// Cells along the longest side of the bulk, for each Gaussian in it.
const CELLS_PER_GAUSSIAN: f64 = 3000.0;
/// Share of the Gaussians, at either end of each axis, that is not the bulk.
const TRIM: f64 = 0.01;

/// One Gaussian in canonical form.
#[derive(Debug, Clone, Copy)]
pub(super) struct Canonical {
    /// Its index in the scene.
    pub(super) source: u32,
    pub(super) cell: u64,
    /// Longest first.
    pub(super) scales: Vec3,
    /// In that order, right-handed.
    pub(super) axes: [Vec3; 3],
    pub(super) position: Vec3,
    pub(super) log_opacity: f32,
    pub(super) dc: Vec3,
    /// By colour, by opacity.
    pub(super) weights: [f32; 2],
    /// By each axis in the order above: moving, scaling, turning.
    pub(super) by_axis: [Vec3; 3],
}

/// The grid of cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grid {
    pub(super) origin: Vec3,
    pub(super) cell: f32,
}

impl Grid {
    /// A grid over all positions whose cells hold about one Gaussian where most are.
    pub(super) fn fit(positions: &[Vec3]) -> Self {
        let n = positions.len();
        let mut origin = [0.0; 3];
        let mut bulk = 0.0_f64;
        let mut whole = 0.0_f64;
        for k in 0..3 {
            let mut values: Vec<f32> = positions.iter().map(|p| p[k]).collect();
            values.sort_by(f32::total_cmp);
            let at = |share: f64| {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a share of a length"
                )]
                let index = ((n.max(1) - 1) as f64 * share) as usize;
                values.get(index).copied().unwrap_or(0.0)
            };
            origin[k] = at(0.0);
            bulk = bulk.max(f64::from(at(1.0 - TRIM)) - f64::from(at(TRIM)));
            whole = whole.max(f64::from(at(1.0)) - f64::from(at(0.0)));
        }
        let wanted = bulk / (CELLS_PER_GAUSSIAN * n.max(1) as f64).cbrt();
        // All coordinates must fit, and cells must be something.
        let least = whole / f64::from((1_u32 << morton::BITS) - 2);
        let cell = wanted.max(least).max(whole * 1e-6).max(1e-9);
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
        let cell = (cell * (1.0 + 1e-6)) as f32;
        Self { origin, cell }
    }

    fn cell(&self, position: Vec3) -> u64 {
        let most = f64::from((1_u32 << morton::BITS) - 1);
        morton::encode(std::array::from_fn(|k| {
            let at = (f64::from(position[k]) - f64::from(self.origin[k])) / f64::from(self.cell);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let at = at.floor().clamp(0.0, most) as u32;
            at
        }))
    }
}

/// All Gaussians in canonical form, in the order of their cells.
pub(super) fn canonical(splats: &Splats, sensitivity: &Sensitivity, grid: &Grid) -> Vec<Canonical> {
    let g = &splats.geometry;
    let one = |i: usize| {
        let scales = g.scales[i];
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| scales[b].total_cmp(&scales[a]));
        let given = columns(g.rotations[i]);
        let [first, second, third] = order.map(|k| given[k]);
        // Turning an axis around leaves the ellipsoid as it is.
        let right = cross(first, second);
        let third = if crate::maths::dot(right, third) < 0.0 { third.map(|v| -v) } else { third };
        let axes = [first, second, third];
        let longest = scales[order[0]].clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE);
        let scales = order.map(|k| scales[k].clamp(longest - MAX_THINNESS, longest));
        let p = sensitivity.position[i];
        let along = |a: Vec3| {
            p[0] * a[0] * a[0]
                + p[3] * a[1] * a[1]
                + p[5] * a[2] * a[2]
                + 2.0 * (p[1] * a[0] * a[1] + p[2] * a[0] * a[2] + p[4] * a[1] * a[2])
        };
        Canonical {
            source: u32::try_from(i).unwrap_or(u32::MAX),
            cell: grid.cell(g.positions[i]),
            scales,
            axes,
            position: g.positions[i],
            log_opacity: log_sigmoid(g.opacities[i]),
            dc: g.dc[i],
            weights: [sensitivity.colour[i], sensitivity.opacity[i]],
            by_axis: [
                axes.map(along),
                order.map(|k| sensitivity.scale[i][k]),
                order.map(|k| sensitivity.rotation[i][k]),
            ],
        }
    };
    let parts = crate::parallel::map_chunks(splats.len(), crate::parallel::CHUNK, |range| {
        range.map(one).collect::<Vec<_>>()
    });
    let mut all = parts.concat();
    all.sort_by_key(|c| (c.cell, c.source));
    all
}
