//! The principal axes of a sample.

use crate::scene::sh::MAX_REST;

/// Largest number of vectors that the axes are computed from.
const MAX_VECTORS: usize = 16_384;
/// Number of passes over all pairs of coordinates. Convergence is quadratic, so few passes are needed.
const SWEEPS: usize = 12;
/// Correlation below which two coordinates are not rotated, in vectors longer than SH-rest. Passes that would only correct
/// the rounding of earlier passes then cost next to nothing.
const UNCORRELATED: f64 = 1e-9;

/// Returns the eigenvectors of the second moments of `sample` (about zero, not the mean), largest eigenvalue first. Only
/// the first [`MAX_VECTORS`] vectors count. An empty sample has no eigenvectors.
///
/// The method is cyclic Jacobi rotations in f64. A library would be faster, but these operations have a fixed order and
/// rounding, so the result is the same on every machine.
pub(crate) fn principal_axes(dim: usize, sample: &[f32]) -> Vec<Vec<f64>> {
    if sample.is_empty() {
        return Vec::new();
    }
    let mut moments = vec![vec![0.0_f64; dim]; dim];
    for vector in sample.chunks_exact(dim).take(MAX_VECTORS) {
        for (i, row) in moments.iter_mut().enumerate() {
            let x = f64::from(vector[i]);
            for (m, y) in row.iter_mut().zip(vector) {
                *m += x * f64::from(*y);
            }
        }
    }
    axes_of_moments(moments)
}

/// Returns the principal axes of vectors, strongest first. `moments` are the sums of products of their coordinates: entry
/// (i, j) is the sum of `x_i x_j`.
pub(crate) fn axes_of_moments(mut moments: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let dim = moments.len();
    let mut axes: Vec<Vec<f64>> =
        (0..dim).map(|i| (0..dim).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect();
    let uncorrelated = if dim > MAX_REST { UNCORRELATED } else { 0.0 };
    for _ in 0..SWEEPS {
        for p in 0..dim {
            for q in p + 1..dim {
                rotate(&mut moments, &mut axes, [p, q], uncorrelated);
            }
        }
    }
    let mut order: Vec<usize> = (0..dim).collect();
    order.sort_by(|&a, &b| moments[b][b].total_cmp(&moments[a][a]));
    order.into_iter().map(|i| axes[i].clone()).collect()
}

/// Rotates coordinates `p < q` so that their mixed moment becomes zero, unless their correlation is below `uncorrelated`.
fn rotate(moments: &mut [Vec<f64>], axes: &mut [Vec<f64>], [p, q]: [usize; 2], uncorrelated: f64) {
    let off = moments[p][q];
    if off.abs() < uncorrelated * (moments[p][p] * moments[q][q]).sqrt() {
        return;
    }
    let theta = (moments[q][q] - moments[p][p]) / (2.0 * off);
    let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    // The mixed moment is zero already, or no finite rotation makes it zero.
    if off == 0.0 || !tangent.is_finite() {
        return;
    }
    let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
    let sine = tangent * cosine;
    let turn = |a: f64, b: f64| (cosine * a - sine * b, sine * a + cosine * b);
    for row in moments.iter_mut() {
        (row[p], row[q]) = turn(row[p], row[q]);
    }
    for matrix in [moments, axes] {
        let (before, after) = matrix.split_at_mut(q);
        for (a, b) in before[p].iter_mut().zip(&mut after[0]) {
            (*a, *b) = turn(*a, *b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    #[test]
    fn axes_are_orthonormal_and_diagonalise_the_moments() {
        let dim = 9;
        let mut rng = SplitMix64::new(1);
        let mut noise = || f32::from(u16::try_from(rng.below(2001)).unwrap()) / 1000.0 - 1.0;
        let mut sample = Vec::new();
        for _ in 0..500 {
            let (a, b) = (noise(), noise());
            sample.extend((0..dim).map(|d| if d % 2 == 0 { a } else { 3.0 * b } + 0.1 * noise()));
        }
        let axes = principal_axes(dim, &sample);
        let energy = |u: &[f64], v: &[f64]| -> f64 {
            let along = |x: &[f32], w: &[f64]| x.iter().zip(w).map(|(x, w)| f64::from(*x) * w).sum::<f64>();
            sample.chunks_exact(dim).map(|x| along(x, u) * along(x, v)).sum()
        };
        let mut last = f64::INFINITY;
        for (i, u) in axes.iter().enumerate() {
            for (j, v) in axes.iter().enumerate() {
                let dot: f64 = u.iter().zip(v).map(|(x, y)| x * y).sum();
                assert!((dot - if i == j { 1.0 } else { 0.0 }).abs() < 1e-12, "{i} {j} {dot}");
                assert!(i == j || energy(u, v).abs() < 1e-6, "{i} {j} {}", energy(u, v));
            }
            assert!(energy(u, u) <= last, "most energy comes first");
            last = energy(u, u);
        }
    }

    #[test]
    fn odd_samples_have_axes() {
        assert!(principal_axes(9, &[]).is_empty());
        for sample in [vec![0.0; 18], vec![1e-30; 18], vec![1e19; 9]] {
            let axes = principal_axes(9, &sample);
            assert!(axes.iter().flatten().all(|v| v.is_finite()), "{axes:?}");
        }
    }
}
