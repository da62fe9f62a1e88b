//! The canonical form of a scene: each ellipsoid in one of its 24 descriptions, and the Gaussians in the order of cells.

use serde::{Deserialize, Serialize};

use crate::packed::bitstream::morton;
use crate::scene::offset::{Offset, shift};
use crate::scene::splats::Geometry;
use crate::support::maths::{Vec3, at_share};

/// Number of cells for each Gaussian, in a cube whose side is the longest side of the bulk of the scene.
const CELLS_PER_GAUSSIAN: f64 = 3000.0;
/// Share of the positions at each end of each axis that are not part of the bulk.
const TRIM: f64 = 0.01;

/// The key by which the Gaussians of a packed scene are sorted. Keys are compared by cell, then by index.
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

/// Returns the indices of the Gaussians of `geometry` in the order of packed files, along a Morton curve. Gaussians that
/// follow one another are near one another in space, so pictures of a scene in this order are drawn faster.
#[must_use]
pub fn curve_order(geometry: &Geometry) -> Vec<u32> {
    let mut keys = Grid::fit(&geometry.positions).keys(geometry);
    keys.sort_unstable();
    keys.iter().map(|key| key.source).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_are_put_in_order_and_back() {
        let splats = crate::support::testing::scene(500, 3);
        let order = curve_order(&splats.geometry);
        let ordered = splats.gathered(&order);
        let apart = |geometry: &Geometry| {
            let pairs = geometry.positions.windows(2);
            pairs.map(|p| (0..3).map(|k| (p[0][k] - p[1][k]).abs()).sum::<f32>()).sum::<f32>()
        };
        assert!(apart(&ordered.geometry) < 0.5 * apart(&splats.geometry));
        let mut back = vec![0; order.len()];
        (0..).zip(&order).for_each(|(k, &i)| back[i as usize] = k);
        assert_eq!(ordered.gathered(&back), splats);
        let sensitivity = crate::Sensitivity::guess(&splats.geometry);
        let of_ordered = crate::Sensitivity::guess(&ordered.geometry);
        let scattered = of_ordered.scattered(&order);
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-4 * b.abs();
        assert!(scattered.colour.iter().zip(&sensitivity.colour).all(close));
        let flat = |s: &crate::Sensitivity| s.position.as_flattened().to_vec();
        assert!(flat(&scattered).iter().zip(&flat(&sensitivity)).all(close));
    }
}
