//! Base colours that are averages over points of points.
//!
//! In the source, the base colour of a Gaussian is the average of its colour over all directions. A Gaussian is seen from
//! few directions, so a file holds the average colour from a few points of points. The decoder subtracts the share of the
//! decoded SH-rest in that average. So a Gaussian has its best colour with and without its SH-rest.

use super::bytes::nearest_f24;
use super::halves::doubled;
use crate::packed::bitstream::sh_codes::Nonzero;
use crate::packed::entropy::lanes::{LANES, Lanes};
use crate::scene::sh::{C0, CHANNELS, MAX_COEFFICIENTS, ShDegree, rest_basis};
use crate::scene::splats::Splats;
use crate::sparse::dictionary::Dictionary;
use crate::support::maths::{Vec3, at_share};
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_chunks};

/// Largest number of points of points.
pub(in crate::packed) const MAX_POINTS: usize = 15;
/// Largest number of coefficients of one channel of SH-rest.
pub(in crate::packed) const MOST: usize = MAX_COEFFICIENTS - 1;

/// The points of view of a file. Without points, base colours are those of the source. Coordinates of points are f24.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct PointsOfView {
    pub(in crate::packed) points: Vec<Vec3>,
    /// Distance from a point, in world units, below which directions shrink towards zero.
    pub(in crate::packed) softening: f32,
}

/// Softening as a share of the median distance of the points from their mean.
const SOFTENING: f32 = 0.02;
/// Least softening that an encoder chooses.
const LEAST_SOFTENING: f32 = 1e-15;
/// Largest difference of a coordinate of a position and of a point that counts, 2^60. Sums of its squares are finite.
const MOST_DIFFERENCE: f32 = f32::from_bits((127 + 60) << 23);
/// Limits of the softening of a file, 2^-60 to 2^60. Its square is a normal number.
pub(in crate::packed) const SOFTENINGS: std::ops::RangeInclusive<f32> =
    f32::from_bits((127 - 60) << 23)..=MOST_DIFFERENCE;

/// Returns the difference of a coordinate of a position and of a point, limited to [`MOST_DIFFERENCE`].
#[inline(always)]
fn difference(position: f32, point: f32) -> f32 {
    (position - point).clamp(-MOST_DIFFERENCE, MOST_DIFFERENCE)
}

impl PointsOfView {
    /// Takes the first [`MAX_POINTS`] of `points`, rounded as a file holds them.
    pub(in crate::packed) fn new(points: &[Vec3]) -> Self {
        if points.is_empty() {
            return Self::default();
        }
        let points: Vec<Vec3> = points.iter().take(MAX_POINTS).map(|point| point.map(nearest_f24)).collect();
        let middle: Vec3 =
            std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f32>() / points.len() as f32);
        let far = |p: &Vec3| (0..3).map(|k| (p[k] - middle[k]).powi(2)).sum::<f32>().sqrt();
        let mut distances: Vec<f32> = points.iter().map(far).collect();
        distances.sort_by(f32::total_cmp);
        let softening = SOFTENING * at_share(&distances, 0.5);
        Self { softening: softening.max(LEAST_SOFTENING).min(*SOFTENINGS.end()), points }
    }

    /// Returns the average of each basis function over the directions from all points to `position`, divided by the basis
    /// function of degree 0.
    #[inline(always)]
    pub(in crate::packed) fn weights(&self, degree: ShDegree, position: Vec3) -> [f32; MOST] {
        let mut sums = [0.0; MOST];
        for point in &self.points {
            let [x, y, z]: Vec3 = std::array::from_fn(|k| difference(position[k], point[k]));
            let scale = 1.0 / (x * x + y * y + z * z + self.softening * self.softening).sqrt();
            let basis = rest_basis(degree, [x * scale, y * scale, z * scale]);
            for (sum, b) in sums.iter_mut().zip(basis) {
                *sum += b;
            }
        }
        let share = 1.0 / (C0 * self.points.len().max(1) as f32);
        sums.map(|sum| sum * share)
    }

    /// Returns the base colours of `splats` as a file holds them.
    pub(in crate::packed) fn colours(&self, splats: &Splats) -> Vec<Vec3> {
        if self.points.is_empty() || splats.degree.rest() == 0 {
            return splats.geometry.dc.clone();
        }
        let per_channel = splats.degree.rest_per_channel();
        let tasks = map_chunks(splats.len(), GAUSSIANS_PER_TASK, |range| {
            let colour = |i: usize| {
                let weights = self.weights(splats.degree, splats.geometry.positions[i]);
                let added = seen_row(splats.rest(i), weights.get(..per_channel).unwrap_or_default());
                std::array::from_fn(|c| splats.geometry.dc[i][c] + added[c])
            };
            range.map(colour).collect::<Vec<Vec3>>()
        });
        tasks.concat()
    }

    /// Stores in `out` the [`Self::weights`] of the positions of all lanes. Entries beyond the coefficients of the degree
    /// are not set.
    // WebAssembly has few registers. Code is slower there if the values of several such functions are kept in them.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(in crate::packed) fn lanes(
        &self,
        degree: ShDegree,
        positions: &[Lanes<f32>; 3],
        out: &mut [Lanes<f32>; MOST],
    ) {
        // Where the degree is a constant, the compiler computes all lanes at once.
        match degree.rest_per_channel() {
            ..=3 => self.lanes_of::<3>(ShDegree::ONE, positions, out),
            4..=8 => self.lanes_of::<8>(ShDegree::TWO, positions, out),
            9..=15 => self.lanes_of::<15>(ShDegree::THREE, positions, out),
            _ => self.lanes_of::<24>(ShDegree::FOUR, positions, out),
        }
    }

    /// Computes [`Self::lanes`] for a degree with `PER_CHANNEL` coefficients a channel.
    #[inline(always)]
    fn lanes_of<const PER_CHANNEL: usize>(
        &self,
        degree: ShDegree,
        positions: &[Lanes<f32>; 3],
        out: &mut [Lanes<f32>; MOST],
    ) {
        let mut sums = [[0.0; LANES]; PER_CHANNEL];
        let softening = self.softening * self.softening;
        for point in &self.points {
            for l in 0..LANES {
                let [x, y, z]: Vec3 = std::array::from_fn(|k| difference(positions[k][l], point[k]));
                let scale = 1.0 / (x * x + y * y + z * z + softening).sqrt();
                let basis = rest_basis(degree, [x * scale, y * scale, z * scale]);
                for k in 0..PER_CHANNEL {
                    sums[k][l] += basis[k];
                }
            }
        }
        let share = 1.0 / (C0 * self.points.len().max(1) as f32);
        for (out, sums) in out.iter_mut().zip(&sums) {
            for l in 0..LANES {
                out[l] = sums[l] * share;
            }
        }
    }
}

/// The atoms of a dictionary with the channels of a coefficient side by side, so that all are weighted at once.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct SeenAtoms {
    per_channel: usize,
    /// The coefficients of each atom. Each has its channels, and a zero.
    rows: Vec<[f32; CHANNELS + 1]>,
}

impl SeenAtoms {
    /// Prepares the atoms of `dictionary`. The result is empty if there are no points of points.
    pub(in crate::packed) fn new(points: &PointsOfView, dictionary: &Dictionary) -> Self {
        let per_channel = dictionary.degree().rest_per_channel();
        if points.points.is_empty() || per_channel == 0 {
            return Self::default();
        }
        let row = |atom: &[f32]| -> Vec<[f32; CHANNELS + 1]> {
            let channel = |c: usize, k: usize| atom.get(c * per_channel + k).copied().unwrap_or(0.0);
            (0..per_channel)
                .map(|k| std::array::from_fn(|c| if c < CHANNELS { channel(c, k) } else { 0.0 }))
                .collect()
        };
        let rows = dictionary.as_slice().chunks_exact(dictionary.dim()).flat_map(row).collect();
        Self { per_channel, rows }
    }

    /// Returns the sum that a code adds to a base colour, by the weights of lane `l`. The last number has no meaning.
    ///
    /// It must not be inlined. Where the compiler knows that the last number is unused, it computes the other three one by
    /// one.
    #[inline(never)]
    pub(in crate::packed) fn seen(
        &self,
        code: &[Nonzero],
        weights: &[Lanes<f32>; MOST],
        l: usize,
    ) -> [f32; CHANNELS + 1] {
        let l = l % LANES;
        let mut sums = [0.0; CHANNELS + 1];
        for nonzero in code {
            let start = usize::from(nonzero.atom) * self.per_channel;
            let row = self.rows.get(start..start + self.per_channel).unwrap_or_default();
            let mut dots = [0.0; CHANNELS + 1];
            for (channels, weights) in row.iter().zip(weights) {
                for c in 0..CHANNELS + 1 {
                    dots[c] += channels[c] * weights[l];
                }
            }
            let value = doubled(nonzero.value);
            for c in 0..CHANNELS + 1 {
                sums[c] += value * dots[c];
            }
        }
        sums
    }
}

/// Returns the sum that a row adds to a base colour. `weights` has one weight for each coefficient of a channel.
#[inline(always)]
pub(in crate::packed) fn seen_row(row: &[f32], weights: &[f32]) -> [f32; CHANNELS] {
    let mut sums = [0.0; CHANNELS];
    for (sum, channel) in sums.iter_mut().zip(row.chunks_exact(weights.len().max(1))) {
        *sum = channel.iter().zip(weights).fold(0.0, |sum, (a, w)| sum + a * w);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point of view may be at the position of a Gaussian, and may be the only point.
    #[test]
    fn weights_are_finite_wherever_points_are() {
        let degree = ShDegree::THREE;
        for points in [vec![[1.0, 2.0, 3.0]], vec![[1.0, 2.0, 3.0]; 8], vec![[0.0; 3], [1.0, 2.0, 3.0]]] {
            let points = PointsOfView::new(&points);
            for position in
                [[1.0, 2.0, 3.0], [0.0; 3], [1e30; 3], [f32::MAX, 0.0, f32::MIN], [1.0, 2.0, 3.000_001]]
            {
                assert!(
                    points.weights(degree, position).iter().all(|w| w.is_finite()),
                    "{points:?} {position:?}"
                );
            }
        }
        assert_eq!(PointsOfView::new(&[]), PointsOfView::default());
    }

    /// Coordinates of any size give the weights of directions in f64, with differences limited to 2^60.
    #[test]
    fn weights_of_extreme_points_are_those_of_f64() {
        let degree = ShDegree::new(2).unwrap();
        let points = [[1e19, 0.0, 1e18], [-3e19, 1e19, 0.0], [0.0, f32::MAX, -1e30], [0.0, 0.0, 1e-20]];
        for point in points {
            for position in [[0.0; 3], [1e18, -2e18, 5e17], [f32::MAX, f32::MIN, 1.0], [3e19, 1e19, -1e19]] {
                let points = PointsOfView { points: vec![point], softening: *SOFTENINGS.start() };
                let limit = f64::from(MOST_DIFFERENCE);
                let d: [f64; 3] = std::array::from_fn(|k| {
                    (f64::from(position[k]) - f64::from(point[k])).clamp(-limit, limit)
                });
                let squares = d.iter().map(|x| x * x).sum::<f64>() + f64::from(*SOFTENINGS.start()).powi(2);
                let [x, y, z] = d.map(|x| x / squares.sqrt());
                // Degree 1, and two of degree 2, in docs/FORMAT.md.
                let wanted = [
                    (0, -0.488_602_51 * y),
                    (1, 0.488_602_51 * z),
                    (2, -0.488_602_51 * x),
                    (3, 1.092_548_4 * x * y),
                    (5, 0.315_391_57 * (2.0 * z * z - x * x - y * y)),
                ];
                let found = points.weights(degree, position);
                for (k, b) in wanted {
                    let off = f64::from(found[k]) - b / f64::from(C0);
                    assert!(off.abs() < 1e-5, "{point:?} {position:?} {k}: {off}");
                }
            }
        }
    }

    /// The weights of a far point are the basis functions in its direction.
    #[test]
    fn weights_are_those_of_directions() {
        let degree = ShDegree::new(2).unwrap();
        let points = PointsOfView::new(&[[3.0, 0.0, 0.0], [0.0, -4.0, 0.0]]);
        let found = points.weights(degree, [0.0; 3]);
        let (a, b) = (rest_basis(degree, [-1.0, 0.0, 0.0]), rest_basis(degree, [0.0, 1.0, 0.0]));
        for ((found, a), b) in found.iter().zip(a).zip(b) {
            assert!((found * C0 - 0.5 * (a + b)).abs() < 1e-3, "{found} {a} {b}");
        }
        assert!(
            seen_row(&[1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, -1.0], &[0.5, 0.25, 0.125])
                == [0.5, 0.5, -0.125]
        );
    }
}
