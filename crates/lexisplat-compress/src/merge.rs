//! Makes fewer Gaussians of many: some are removed, and some pairs become one Gaussian.
//!
//! The one Gaussian has the mean and the covariance of both (docs/METHOD.md, "At most so many").

use glam::{DMat3, DQuat, DVec3};
use lexisplat::packed::curve_order;
use lexisplat::{Geometry, Sensitivity, Splats};
use rayon::prelude::*;

/// Number of Gaussians with which each one may be merged: those that follow it along the curve of the coder.
const NEIGHBOURS: usize = 12;
/// Least overlap of two Gaussians that may be merged. 1 is that of two equal ones.
const LEAST_OVERLAP: f64 = 0.2;
/// Smallest and largest opacity of a merged Gaussian.
const OPACITIES: [f64; 2] = [1e-3, 0.99];
/// Passes over the three pairs of axes that make a covariance diagonal. Each squares the error, about.
const SWEEPS: usize = 8;
/// Mean squared value of an SH basis function over all directions: `1 / 4π`.
const MEAN_SQUARED_BASIS: f64 = 1.0 / (4.0 * std::f64::consts::PI);

/// Makes `count` fewer Gaussians of `splats`: removes one, or merges two, whichever changes pictures least, and no Gaussian twice.
/// Returns false for the Gaussians that are left to remove. `sensitivity` is the sensitivity of `splats`.
pub(crate) fn lessened(splats: &mut Splats, sensitivity: &Sensitivity, count: usize) -> Vec<bool> {
    let shapes: Vec<Shape> =
        (0..splats.len()).into_par_iter().map(|i| Shape::of(&splats.geometry, i)).collect();
    let (mut free, mut keep) = (vec![true; splats.len()], vec![true; splats.len()]);
    let ways = ways(splats, &shapes, sensitivity);
    let mut gone = 0;
    for Way { one, other, .. } in ways {
        if gone == count {
            break;
        }
        let [i, j] = [one as usize, other as usize];
        if free[i] && free[j] {
            (free[i], free[j], keep[j]) = (false, false, false);
            gone += 1;
            if i != j {
                merge(splats, [i, j], Shape::merged([&shapes[i], &shapes[j]]));
            }
        }
    }
    keep
}

/// A way to make one Gaussian less.
struct Way {
    /// Squared error of pictures, about.
    cost: f64,
    /// The Gaussians that are merged. If they are the same, it is removed.
    one: u32,
    other: u32,
}

/// Returns the ways to make one Gaussian less, those of least cost first.
fn ways(splats: &Splats, shapes: &[Shape], sensitivity: &Sensitivity) -> Vec<Way> {
    let order = curve_order(&splats.geometry);
    let removed = |i: u32| Way { cost: f64::from(sensitivity.opacity[i as usize]), one: i, other: i };
    let of = |(at, &i): (usize, &u32)| {
        let neighbours = order[at + 1..].iter().take(NEIGHBOURS);
        let merged = neighbours.filter_map(move |&j| {
            let cost = cost_of_merging(splats, shapes, sensitivity, [i as usize, j as usize])?;
            Some(Way { cost, one: i, other: j })
        });
        std::iter::once(removed(i)).chain(merged).collect::<Vec<_>>()
    };
    let mut ways: Vec<Way> = order.par_iter().enumerate().flat_map_iter(of).collect();
    ways.sort_by(|a, b| a.cost.total_cmp(&b.cost).then((a.one, a.other).cmp(&(b.one, b.other))));
    ways
}

/// Returns the squared error of pictures, about, if two Gaussians become one. Returns `None` if they overlap little, or if to
/// remove one of them costs less.
///
/// A picture is taken for the space around the Gaussians. Each is a function whose squared norm is the sensitivity to its opacity.
/// The error is the part of their sum that the merged Gaussian cannot show. Their colours move to the merged one's.
fn cost_of_merging(
    splats: &Splats,
    shapes: &[Shape],
    sensitivity: &Sensitivity,
    pair: [usize; 2],
) -> Option<f64> {
    let squared = pair.map(|i| f64::from(sensitivity.opacity[i]));
    let both = pair.map(|i| &shapes[i]);
    let overlap = both[0].overlap(both[1]);
    if overlap.is_nan() || overlap < LEAST_OVERLAP {
        return None;
    }
    let (merged, [one, other]) = Shape::merged(both);
    let shown: f64 = squared.iter().zip(both).map(|(s, shape)| s.sqrt() * shape.overlap(&merged)).sum();
    let all = squared[0] + squared[1] + 2.0 * (squared[0] * squared[1]).sqrt() * overlap;
    let apart = MEAN_SQUARED_BASIS * squared_distance_of_colours(splats, pair);
    let [colour, of_other] = pair.map(|i| f64::from(sensitivity.colour[i]));
    let cost = (all - shown * shown).max(0.0) + apart * (colour * other * other + of_other * one * one);
    (cost < squared[0].min(squared[1])).then_some(cost)
}

/// Returns the sum of the squared differences of the SH coefficients of two Gaussians.
fn squared_distance_of_colours(splats: &Splats, pair: [usize; 2]) -> f64 {
    let rest = splats.degree.rest();
    let [one, other] =
        pair.map(|i| splats.geometry.dc[i].iter().chain(&splats.sh_rest[i * rest..(i + 1) * rest]).copied());
    one.zip(other).map(|(a, b)| f64::from(a - b) * f64::from(a - b)).sum()
}

/// Gives Gaussian `one` of a pair the values of the `merged` Gaussian. `weights` are the shares of the two in it. Extra properties
/// stay those of `one`.
#[expect(clippy::cast_possible_truncation, reason = "values of single precision")]
fn merge(splats: &mut Splats, [one, other]: [usize; 2], (merged, weights): (Shape, [f64; 2])) {
    let rest = splats.degree.rest();
    let [by_one, by_other] = weights.map(|weight| weight as f32);
    let mean = |a: f32, b: f32| by_one * a + by_other * b;
    for k in 0..rest {
        splats.sh_rest[one * rest + k] =
            mean(splats.sh_rest[one * rest + k], splats.sh_rest[other * rest + k]);
    }
    let (variances, axes) = principal(merged.covariance);
    let scales = variances.map(|v| 0.5 * libm::log(v.max(f64::MIN_POSITIVE)));
    let opacity = (merged.weight / area(scales)).clamp(OPACITIES[0], OPACITIES[1]);
    let turned = DQuat::from_mat3(&axes);
    let g = &mut splats.geometry;
    g.dc[one] = std::array::from_fn(|c| mean(g.dc[one][c], g.dc[other][c]));
    g.positions[one] = merged.mean.to_array().map(|v| v as f32);
    g.scales[one] = scales.map(|v| v as f32);
    g.rotations[one] = [turned.w, turned.x, turned.y, turned.z].map(|v| v as f32);
    g.opacities[one] = libm::log(opacity / (1.0 - opacity)) as f32;
}

/// A Gaussian in space.
#[derive(Debug)]
struct Shape {
    mean: DVec3,
    covariance: DMat3,
    determinant: f64,
    /// Opacity times the product of the two longer standard deviations.
    weight: f64,
}

impl Shape {
    fn of(geometry: &Geometry, i: usize) -> Self {
        let [w, x, y, z] = geometry.rotations[i].map(f64::from);
        let axes = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
        let scales = geometry.scales[i].map(f64::from);
        let half = axes * DMat3::from_diagonal(DVec3::from_array(scales.map(libm::exp)));
        let opacity = 1.0 / (1.0 + libm::exp(-f64::from(geometry.opacities[i])));
        Self {
            mean: DVec3::from_array(geometry.positions[i].map(f64::from)),
            covariance: half * half.transpose(),
            determinant: libm::exp(2.0 * scales.iter().sum::<f64>()),
            weight: opacity * area(scales),
        }
    }

    /// Returns the Gaussian of the mean and the covariance of both, and the shares of the two in it.
    fn merged(both: [&Self; 2]) -> (Self, [f64; 2]) {
        let weight = both[0].weight + both[1].weight;
        let shares = both.map(|shape| shape.weight / weight);
        let mean = shares[0] * both[0].mean + shares[1] * both[1].mean;
        let [a, b] = [0, 1].map(|k| {
            let apart = both[k].mean - mean;
            let spread = DMat3::from_cols(apart * apart.x, apart * apart.y, apart * apart.z);
            shares[k] * (both[k].covariance + spread)
        });
        let covariance = a + b;
        (Self { mean, covariance, determinant: covariance.determinant(), weight }, shares)
    }

    /// Returns the inner product of two Gaussians of norm 1. It is not finite if both are flat.
    fn overlap(&self, other: &Self) -> f64 {
        let sum = self.covariance + other.covariance;
        let apart = other.mean - self.mean;
        let squared = apart.dot(sum.inverse() * apart);
        let widths = 8.0 * (self.determinant * other.determinant).sqrt() / sum.determinant();
        widths.sqrt() * libm::exp(-0.5 * squared)
    }
}

/// Returns the product of the two longer standard deviations, from the logarithms of all three.
fn area(scales: [f64; 3]) -> f64 {
    let least = scales.into_iter().fold(f64::INFINITY, f64::min);
    libm::exp(scales.iter().sum::<f64>() - least)
}

/// Returns the variances along the principal axes of a covariance, and the rotation to these axes, by Jacobi's rotations.
fn principal(mut covariance: DMat3) -> ([f64; 3], DMat3) {
    let mut axes = DMat3::IDENTITY;
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = covariance.col(p)[q];
            if off != 0.0 {
                let theta = (covariance.col(q)[q] - covariance.col(p)[p]) / (2.0 * off);
                let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
                let mut turn = DMat3::IDENTITY;
                turn.col_mut(p)[p] = cosine;
                turn.col_mut(q)[q] = cosine;
                turn.col_mut(q)[p] = tangent * cosine;
                turn.col_mut(p)[q] = -tangent * cosine;
                covariance = turn.transpose() * covariance * turn;
                axes *= turn;
            }
        }
    }
    ([0, 1, 2].map(|k| covariance.col(k)[k]), axes)
}

#[cfg(test)]
mod tests {
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    /// Far Gaussians of equal size, and the same Gaussians in two halves each.
    #[expect(clippy::cast_possible_truncation, reason = "values of single precision")]
    fn whole_and_halves() -> (Splats, Splats) {
        let mut whole = scene(&SampleOptions::new(40, 5));
        let far = |p: [f32; 3]| p.map(|v| 1e3 * v);
        let g = &mut whole.geometry;
        g.positions.iter_mut().for_each(|p| *p = far(*p));
        (g.scales, g.opacities) = (vec![[-1.0, -2.0, -3.0]; 40], vec![-0.5; 40]);
        let mut halves = whole.gathered(&(0..40).flat_map(|i| [i, i]).collect::<Vec<_>>());
        let apart = 0.5 * libm::exp(-1.0);
        let alpha = 0.5 / (1.0 + libm::exp(0.5)) / 0.75_f64.sqrt();
        for i in 0..80 {
            let g = &mut halves.geometry;
            let [w, x, y, z] = g.rotations[i].map(f64::from);
            let axis = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()).col(0);
            let moved = (if i % 2 == 0 { apart } else { -apart }) * axis;
            let moved = moved.to_array().map(|v| v as f32);
            g.positions[i] = std::array::from_fn(|k| g.positions[i][k] + moved[k]);
            // The variance along the axis is less by the squared distance.
            g.scales[i][0] += 0.5 * 0.75_f32.ln();
            g.opacities[i] = libm::log(alpha / (1.0 - alpha)) as f32;
        }
        (whole, halves)
    }

    fn evenly(splats: &Splats) -> Sensitivity {
        let mut sensitivity = Sensitivity::guess(&splats.geometry);
        sensitivity.opacity.fill(1.0);
        sensitivity
    }

    #[test]
    fn halves_become_whole() {
        let (whole, mut halves) = whole_and_halves();
        let sensitivity = evenly(&halves);
        let keep = lessened(&mut halves, &sensitivity, 40);
        assert!(keep.chunks_exact(2).all(|pair| pair[0] != pair[1]), "{keep:?}");
        halves.retain(&keep);
        let (a, b) = (&whole.geometry, &halves.geometry);
        for i in 0..40 {
            let [one, other] = [a, b].map(|g| Shape::of(g, i));
            let off = (one.covariance - other.covariance).abs_diff_eq(DMat3::ZERO, 1e-3);
            assert!(off && one.mean.distance(other.mean) < 2e-3, "{i}: {one:?} {other:?}");
            assert!((one.weight - other.weight).abs() < 1e-3 * one.weight, "{i}: {one:?} {other:?}");
            assert!((one.overlap(&other) - 1.0).abs() < 1e-3);
            assert!(a.dc[i].iter().zip(b.dc[i]).all(|(a, b)| (a - b).abs() < 1e-5));
        }
        let far = whole.sh_rest.iter().zip(&halves.sh_rest).any(|(a, b)| (a - b).abs() > 1e-5);
        assert!(!far);
    }

    #[test]
    fn far_gaussians_and_those_of_other_colours_are_removed() {
        let (mut whole, mut halves) = whole_and_halves();
        let mut sensitivity = evenly(&whole);
        sensitivity.opacity.iter_mut().enumerate().for_each(|(i, s)| *s = (i * 7 % 40) as f32);
        let before = whole.clone();
        let keep = lessened(&mut whole, &sensitivity, 10);
        assert_eq!(whole, before);
        assert!(keep.iter().enumerate().all(|(i, keep)| *keep == (i * 7 % 40 >= 10)), "{keep:?}");
        halves.geometry.dc.iter_mut().step_by(2).for_each(|dc| *dc = dc.map(|v| v + 9.0));
        let mut sensitivity = evenly(&halves);
        sensitivity.colour.fill(1.0);
        let before = halves.clone();
        lessened(&mut halves, &sensitivity, 40);
        assert_eq!(halves, before);
    }

    #[test]
    fn strange_gaussians_are_not_merged() {
        let (_, mut halves) = whole_and_halves();
        let g = &mut halves.geometry;
        (g.rotations[0], g.rotations[3]) = ([0.0; 4], [f32::NAN; 4]);
        (g.scales[4], g.scales[7]) = ([f32::NEG_INFINITY; 3], [300.0; 3]);
        (g.opacities[8], g.opacities[9]) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
        let sensitivity = evenly(&halves);
        let keep = lessened(&mut halves, &sensitivity, 35);
        for pair in [0, 2, 4, 6, 8].map(|i| &keep[i..i + 2]) {
            assert_eq!(pair, [true; 2]);
        }
        assert_eq!(keep.iter().filter(|keep| !*keep).count(), 35);
    }

    #[test]
    fn principal_axes_give_the_covariance() {
        for (x, y, z, w) in [(0.1, 0.7, -0.3, 0.5), (0.0, 0.0, 0.0, 1.0), (-0.9, 0.2, 0.4, 0.1)] {
            let turn = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
            let covariance = turn * DMat3::from_diagonal(DVec3::new(9.0, 1e-4, 2.0)) * turn.transpose();
            let (variances, axes) = principal(covariance);
            let back = axes * DMat3::from_diagonal(DVec3::from_array(variances)) * axes.transpose();
            assert!(back.abs_diff_eq(covariance, 1e-9), "{back} {covariance}");
            assert!((axes.determinant() - 1.0).abs() < 1e-9);
            assert!((variances.iter().product::<f64>() - 18e-4).abs() < 1e-9, "{variances:?}");
        }
    }
}
