//! Estimates from view-dependent colours the places from which a scene was seen.
//!
//! Training begins with view-dependent colours of 0. Each photograph changes them in the direction from which it was taken.
//! The square of a Gaussian's view-dependent colour is therefore larger on average in directions that were seen. In other
//! directions it has no meaning: it follows from the coefficients that fit the seen directions.

use lexisplat::packed::curve_order;
use lexisplat::sh::rest_basis;
use lexisplat::{ShDegree, Splats};

/// Smallest opacity of a Gaussian that counts, 30 %, before the sigmoid.
const FAINT: f32 = -0.85;
/// Number of groups of neighbours.
const GROUPS: usize = 256;
/// Approximate number of Gaussians over which the median of squared colours is taken.
const ASKED: usize = 16_384;
/// Solid angle of the sphere.
const SPHERE: f32 = 4.0 * std::f32::consts::PI;

/// The view-dependent colours of a scene, by groups of neighbours.
pub(crate) struct ObservedDirections {
    groups: Vec<Group>,
    degree: ShDegree,
}

/// The view-dependent colours of neighbours.
struct Group {
    middle: [f32; 3],
    count: f32,
    /// Sums over Gaussians and channels of the products of two coefficients of a channel, row by row. The products of each
    /// Gaussian are divided by the sum of its squared coefficients.
    products: Vec<f32>,
}

/// A group seen from a position.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    /// Unit vector from the position to the group.
    pub(crate) direction: [f32; 3],
    /// Mean squared view-dependent colour in this direction, as a multiple of its mean over all directions.
    pub(crate) focus: f32,
    /// Number of Gaussians of the group.
    pub(crate) count: f32,
}

impl ObservedDirections {
    /// Groups the Gaussians of `splats`. Gaussians whose view-dependent colour is below the median do not count.
    pub(crate) fn of(splats: &Splats) -> Self {
        let (dim, each) = (splats.degree.rest(), splats.degree.rest_per_channel());
        let rest = |i: usize| &splats.sh_rest[i * dim..(i + 1) * dim];
        let squares = |i: usize| -> f32 { rest(i).iter().map(|v| v * v).sum() };
        let geometry = &splats.geometry;
        let counts = |i: &usize| {
            geometry.opacities[*i] > FAINT && squares(*i) > 0.0 && squares(*i).recip().is_normal()
        };
        let order = curve_order(geometry).into_iter().map(|i| i as usize);
        let mut seen: Vec<usize> = order.filter(counts).collect();
        let step = seen.len().div_ceil(ASKED).max(1);
        let mut some: Vec<f32> = seen.iter().step_by(step).map(|&i| squares(i)).collect();
        let half = some.len() / 2;
        if !some.is_empty() {
            let median = *some.select_nth_unstable_by(half, f32::total_cmp).1;
            seen.retain(|&i| squares(i) >= median);
        }
        let group = |own: &[usize]| {
            let mut middle = [0.0_f64; 3];
            let mut products = vec![0.0_f32; each * each];
            for &i in own {
                (0..3).for_each(|k| middle[k] += f64::from(geometry.positions[i][k]));
                let share = squares(i).recip();
                for channel in rest(i).chunks_exact(each) {
                    for (row, value) in products.chunks_exact_mut(each).zip(channel) {
                        row.iter_mut().zip(channel).for_each(|(sum, other)| *sum += share * value * other);
                    }
                }
            }
            let count = own.len() as f64;
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            Group { middle: middle.map(|sum| (sum / count) as f32), count: count as f32, products }
        };
        let groups = seen.chunks(seen.len().div_ceil(GROUPS).max(1)).map(group).collect();
        Self { groups, degree: splats.degree }
    }

    /// Returns whether no colour depends on the view.
    pub(crate) fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Returns the groups as seen from `position`.
    pub(crate) fn from(&self, position: [f32; 3]) -> impl Iterator<Item = Seen> + '_ {
        let each = self.degree.rest_per_channel();
        self.groups.iter().filter_map(move |Group { middle, count, products }| {
            let way: [f32; 3] = std::array::from_fn(|k| middle[k] - position[k]);
            let length = way.iter().map(|v| v * v).sum::<f32>().sqrt();
            let direction = way.map(|v| v / length);
            if !direction.iter().all(|v| v.is_finite()) {
                return None;
            }
            let basis = rest_basis(self.degree, direction);
            let row = |(value, row): (&f32, &[f32])| {
                value * row.iter().zip(&basis).map(|(product, other)| product * other).sum::<f32>()
            };
            let sum: f32 = basis.iter().zip(products.chunks_exact(each.max(1))).map(row).sum();
            Some(Seen { direction, focus: SPHERE * sum / count, count: *count })
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use lexisplat::Geometry;

    use super::*;

    /// Gaussians on a wall of 8 by 8 by 1 around `middle`, of which each has the view-dependent colours that one step of training
    /// from each of `cameras` leaves.
    pub(crate) fn trained(middle: [f32; 3], cameras: &[[f32; 3]], count: u16) -> Splats {
        let degree = ShDegree::new(3).unwrap();
        let mut geometry = Geometry::default();
        let mut sh_rest = Vec::new();
        for i in 0..count {
            let wave = |k: f32| (f32::from(i) * k).sin();
            let position: [f32; 3] =
                [0, 1, 2].map(|k| middle[k] + [4.0, 4.0, 0.5][k] * wave([1.3, 2.1, 0.7][k]));
            let mut rest = vec![0.0_f32; degree.rest()];
            for (v, camera) in cameras.iter().enumerate() {
                let way: [f32; 3] = std::array::from_fn(|k| position[k] - camera[k]);
                let length = way.iter().map(|v| v * v).sum::<f32>().sqrt();
                let basis = rest_basis(degree, way.map(|v| v / length));
                for (channel, values) in rest.chunks_exact_mut(degree.rest_per_channel()).enumerate() {
                    let gradient = wave(3.7 + v as f32 * 0.9 + channel as f32 * 1.7);
                    values.iter_mut().zip(&basis).for_each(|(value, basis)| *value += gradient * basis);
                }
            }
            sh_rest.extend(rest);
            geometry.positions.push(position);
            geometry.scales.push([-4.0; 3]);
            geometry.rotations.push([1.0, 0.0, 0.0, 0.0]);
            geometry.opacities.push(2.0);
            geometry.dc.push([0.5; 3]);
        }
        Splats { geometry, degree, sh_rest, meta: lexisplat::SceneMeta::default() }
    }

    fn focus(observed: &ObservedDirections, from: [f32; 3]) -> f32 {
        let (sums, counts): (Vec<f32>, Vec<f32>) =
            observed.from(from).map(|seen| (seen.focus * seen.count, seen.count)).unzip();
        sums.iter().sum::<f32>() / counts.iter().sum::<f32>()
    }

    #[test]
    fn colours_are_largest_where_they_were_seen_from() {
        let cameras = [[-3.0, 0.5, -9.0], [2.0, -1.0, -8.0], [0.5, 1.0, -10.0]];
        let observed = ObservedDirections::of(&trained([0.0; 3], &cameras, 6000));
        for camera in cameras {
            let here = focus(&observed, camera);
            assert!(here > 1.5, "{here}");
            for other in [[-9.0, 0.0, 2.0], [9.0, 1.0, -1.0], [0.0, 9.0, 2.0], [1.0, -9.0, 1.0]] {
                assert!(focus(&observed, other) < 0.7 * here, "{} {here}", focus(&observed, other));
            }
        }
        // All directions together have the mean, which is 1.
        let around = (0..400_u16).map(|k| {
            let [turn, y] = [f32::from(k) * 2.4, 1.0 - f32::from(k) / 200.0 - 0.0025];
            let flat = (1.0 - y * y).sqrt();
            focus(&observed, [1e4 * flat * turn.sin(), 1e4 * y, 1e4 * flat * turn.cos()])
        });
        let mean = around.sum::<f32>() / 400.0;
        assert!((mean - 1.0).abs() < 0.03, "{mean}");
    }

    #[test]
    fn scenes_without_view_dependent_colours_say_nothing() {
        let splats = trained([0.0; 3], &[[0.0, 0.0, -9.0]], 60);
        assert!(ObservedDirections::of(&splats.with_degree_cut(ShDegree::ZERO)).is_empty());
        assert!(ObservedDirections::of(&trained([0.0; 3], &[], 60)).is_empty());
        assert!(ObservedDirections::of(&trained([0.0; 3], &[], 0)).is_empty());
        let mut odd = splats;
        odd.sh_rest.fill(f32::MAX);
        assert!(ObservedDirections::of(&odd).is_empty());
    }
}
