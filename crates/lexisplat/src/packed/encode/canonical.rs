//! The canonical form of a scene: each ellipsoid in one of its 24 descriptions, and the Gaussians in the order of cells.

use serde::{Deserialize, Serialize};

use crate::packed::bitstream::morton;
use crate::scene::offset::{Offset, shift};
use crate::scene::splats::Geometry;
use crate::support::maths::{Vec3, at_share, columns, cross, dot, log_sigmoid, longest_first};

/// Largest logarithm of the ratio of the longest axis to another. Thinner ellipsoids look the same, since pictures blur by
/// 0.3 squared pixels.
const MAX_THINNESS: f32 = 9.0;
/// Largest magnitude of the logarithm of a standard deviation. The exponential of a larger one leaves f32.
const MAX_LOG_SCALE: f32 = 40.0;
/// Half the logarithm of the largest f32. The variance of a larger scale leaves f32, and no rasteriser draws such a
/// Gaussian. A file limits the scale to [`MAX_LOG_SCALE`], with which the Gaussian might be drawn, so its opacity becomes
/// the smallest one.
const MAX_DRAWN_LOG_SCALE: f32 = 44.361_42;
/// Smallest logarithm of an opacity. The exponential of a smaller one is about 0 in f32.
pub(in crate::packed) const MIN_LOG_OPACITY: f32 = -100.0;
/// Number of cells for each Gaussian, in a cube whose side is the longest side of the bulk of the scene.
const CELLS_PER_GAUSSIAN: f64 = 3000.0;
/// Share of the positions at each end of each axis that are not part of the bulk.
const TRIM: f64 = 0.01;

/// One Gaussian in canonical form.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::packed) struct Canonical {
    /// Natural logarithms of the standard deviations, longest first.
    pub(in crate::packed) scales: Vec3,
    /// The axis of the source that each of `scales` belongs to.
    pub(in crate::packed) order: [usize; 3],
    /// The directions of the axes in the order of `scales`, as a right-handed system.
    pub(in crate::packed) axes: [Vec3; 3],
    pub(in crate::packed) position: Vec3,
    /// Natural logarithm of the opacity after the sigmoid.
    pub(in crate::packed) log_opacity: f32,
    pub(in crate::packed) dc: Vec3,
}

/// The place of a Gaussian in a packed scene. Keys are compared by cell, then by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct MortonKey {
    pub(crate) cell: u64,
    /// The index of the Gaussian in the scene.
    pub(crate) source: u32,
}

impl MortonKey {
    pub(in crate::packed) fn index(self) -> usize {
        self.source as usize
    }
}

/// Smallest and largest coordinates of positions. Both are 0 if there are no positions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bounds {
    least: Vec3,
    most: Vec3,
}

impl Bounds {
    pub(crate) fn of(positions: &[Vec3]) -> Self {
        let mut positions = positions.iter();
        let Some(&first) = positions.next() else { return Self { least: [0.0; 3], most: [0.0; 3] } };
        let mut bounds = Self { least: first, most: first };
        positions.for_each(|&p| bounds.add(Self { least: p, most: p }));
        bounds
    }

    /// Returns the bounds of the same positions, which are relative to the offset `from`, relative to the offset `to`.
    pub(in crate::packed) fn rebased(mut self, from: Option<Offset>, to: Option<Offset>) -> Self {
        // Shifting and rounding keep the order of numbers, so the smallest coordinate stays the smallest.
        shift(std::slice::from_mut(&mut self.least), from, to);
        shift(std::slice::from_mut(&mut self.most), from, to);
        self
    }

    /// Extends the bounds so that they include `other`.
    pub(crate) fn add(&mut self, other: Self) {
        for k in 0..3 {
            // `total_cmp` orders -0 before 0. The corner of the grid depends on this, and files depend on the corner.
            self.least[k] = std::cmp::min_by(self.least[k], other.least[k], f32::total_cmp);
            self.most[k] = std::cmp::max_by(self.most[k], other.most[k], f32::total_cmp);
        }
    }
}

/// The grid of cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Grid {
    pub(in crate::packed) origin: Vec3,
    pub(in crate::packed) cell: f32,
}

impl Grid {
    /// Fits a grid that covers all positions.
    pub(in crate::packed) fn fit(positions: &[Vec3]) -> Self {
        Self::fit_sample(positions, Bounds::of(positions), positions.len())
    }

    /// Fits a grid as [`Self::fit`] does for `total` positions within `bounds`, from a sample of the positions.
    pub(crate) fn fit_sample(sample: &[Vec3], bounds: Bounds, total: usize) -> Self {
        let mut bulk = 0.0_f64;
        for k in 0..3 {
            let mut values: Vec<f32> = sample.iter().map(|p| p[k]).collect();
            values.sort_by(f32::total_cmp);
            let at = |share| f64::from(at_share(&values, share));
            bulk = bulk.max(at(1.0 - TRIM) - at(TRIM));
        }
        let Bounds { least: origin, most } = bounds;
        let whole = (0..3).map(|k| f64::from(most[k]) - f64::from(origin[k])).fold(0.0, f64::max);
        let wanted = bulk / libm::cbrt(CELLS_PER_GAUSSIAN * total.max(1) as f64);
        // All coordinates must fit in `morton::BITS` bits, and a cell must have a side above 0.
        let least = whole / f64::from((1_u32 << morton::BITS) - 2);
        let cell = wanted.max(least).max(whole * 1e-6).max(1e-9);
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
        let cell = (cell * (1.0 + 1e-6)) as f32;
        Self { origin, cell }
    }

    /// Returns the number of the cell of `position` on the Morton curve.
    pub(crate) fn cell(&self, position: Vec3) -> u64 {
        let most = f64::from((1_u32 << morton::BITS) - 1);
        morton::encode(std::array::from_fn(|k| {
            let at = (f64::from(position[k]) - f64::from(self.origin[k])) / f64::from(self.cell);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let at = at.floor().clamp(0.0, most) as u32;
            at
        }))
    }

    /// Returns the key of each Gaussian, in the order of `geometry`.
    pub(in crate::packed) fn keys(&self, geometry: &Geometry) -> Vec<MortonKey> {
        // Scenes have at most 2^32 - 2 Gaussians.
        let key = |(source, &position)| MortonKey { cell: self.cell(position), source };
        (0_u32..).zip(&geometry.positions).map(key).collect()
    }
}

/// Returns Gaussian `i` in canonical form.
pub(in crate::packed) fn canonical(geometry: &Geometry, i: usize) -> Canonical {
    let scales = geometry.scales[i];
    let order = longest_first(scales);
    let given = columns(geometry.rotations[i]);
    let [first, second, third] = order.map(|k| given[k]);
    // An ellipsoid does not change when one of its axes is reversed.
    let third = if dot(cross(first, second), third) < 0.0 { third.map(|v| -v) } else { third };
    let drawn = scales[order[0]] <= MAX_DRAWN_LOG_SCALE;
    let log_opacity = if drawn { log_sigmoid(geometry.opacities[i]) } else { MIN_LOG_OPACITY };
    let longest = scales[order[0]].clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE);
    Canonical {
        scales: order.map(|k| scales[k].clamp(longest - MAX_THINNESS, longest)),
        order,
        axes: [first, second, third],
        position: geometry.positions[i],
        log_opacity: log_opacity.max(MIN_LOG_OPACITY),
        dc: geometry.dc[i],
    }
}
