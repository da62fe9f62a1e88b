//! Changes of Gaussians with which pictures are nearest to others, by the method of conjugate gradients.

use lexisplat::Progress;
use lexisplat_render::{GaussianChange, PictureAdjoint};

use crate::error::Result;

/// Share of the sums of rows in the preconditioner of colours. The diagonal of the matrix is smaller than those.
pub(crate) const ROW: f32 = 0.2;

/// Changes that are the same for all colours: of colours, opacities and sizes.
pub(crate) fn kinds<const N: usize, const KINDS: usize>(of: [f32; KINDS]) -> GaussianChange<N> {
    std::array::from_fn(|k| of[k.saturating_sub(2)])
}

/// The change with which the squared errors of pictures, and the ridge, are least: the solution by conjugate gradients, with a
/// diagonal preconditioner. `errors` are the products of the adjoint with the errors of pictures. In each step `progress` is
/// told of drawing all views.
pub(crate) fn solve<const N: usize>(
    adjoint: &mut PictureAdjoint<'_>,
    mut errors: Vec<GaussianChange<N>>,
    ridge: &[GaussianChange<N>],
    diagonal: &[GaussianChange<N>],
    steps: usize,
    progress: &dyn Progress,
) -> Result<Vec<GaussianChange<N>>> {
    let scaled = |rows: &[GaussianChange<N>]| -> Vec<GaussianChange<N>> {
        let divided = |(row, by): (&GaussianChange<N>, &GaussianChange<N>)| {
            std::array::from_fn(|k| row[k] / by[k].max(f32::MIN_POSITIVE))
        };
        rows.iter().zip(diagonal).map(divided).collect()
    };
    let mut found = vec![[0.0_f32; N]; ridge.len()];
    let mut direction = scaled(&errors);
    let mut norm = dot(&errors, &direction);
    for _ in 0..steps {
        let mut product = adjoint.of_changes(&direction, progress)?;
        for ((product, direction), ridge) in product.iter_mut().zip(&direction).zip(ridge) {
            (0..N).for_each(|k| product[k] += ridge[k] * direction[k]);
        }
        let along = dot(&direction, &product);
        if along <= 0.0 {
            break;
        }
        let length = single(norm / along);
        for i in 0..found.len() {
            add(&mut found[i], length, &direction[i]);
            add(&mut errors[i], -length, &product[i]);
        }
        let next = scaled(&errors);
        let before = std::mem::replace(&mut norm, dot(&errors, &next));
        let share = single(norm / before);
        for (direction, next) in direction.iter_mut().zip(next) {
            let old = std::mem::replace(direction, next);
            add(direction, share, &old);
        }
    }
    Ok(found)
}

/// Adds `factor` times `row` to `sum`.
fn add<const N: usize>(sum: &mut GaussianChange<N>, factor: f32, row: &GaussianChange<N>) {
    sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += factor * value);
}

fn dot<const N: usize>(a: &[GaussianChange<N>], b: &[GaussianChange<N>]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

#[expect(clippy::cast_possible_truncation, reason = "a factor, to single precision")]
fn single(x: f64) -> f32 {
    x as f32
}
