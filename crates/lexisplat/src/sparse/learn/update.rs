//! Moves the atoms: approximate K-SVD, and momentum over rounds.

use super::training::Training;
use crate::sparse::atoms::Atoms;

/// Number of users whose residuals are summed in f32 before their sum is added to the sum in f64.
const PARTIAL: usize = 64;
/// Number of partial sums of a dot product. It is fixed, so that results do not depend on the CPU.
const PARTS: usize = 8;
/// Norm that a vector must exceed to have a direction.
const MIN_NORM: f64 = 1e-12;

/// Returns `vector` scaled to unit norm; `None` if its norm is not finite or not above `min_norm`.
pub(super) fn normalised_over(vector: &[f64], min_norm: f64) -> Option<Vec<f32>> {
    let norm = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    #[expect(clippy::cast_possible_truncation, reason = "atoms are f32")]
    (norm.is_finite() && norm > min_norm).then(|| vector.iter().map(|x| (x / norm) as f32).collect())
}

/// Returns `vector` scaled to unit norm; `None` if its norm is not finite or not above [`MIN_NORM`].
pub(super) fn normalised(vector: &[f64]) -> Option<Vec<f32>> {
    normalised_over(vector, MIN_NORM)
}

/// Returns the new direction of `atom` in K-SVD: the normalised `sum + energy * atom`. With values `g_i` and residuals
/// `r_i` of the users of the atom, `sum` is the sum of `g_i r_i`, and `energy` is the sum of `g_i^2`. Returns `None` if the
/// norm of `sum + energy * atom` is not finite or not above `min_norm`.
pub(crate) fn ksvd_atom(mut sum: Vec<f64>, energy: f64, atom: &[f32], min_norm: f64) -> Option<Vec<f32>> {
    for (s, a) in sum.iter_mut().zip(atom) {
        *s += energy * f64::from(*a);
    }
    normalised_over(&sum, min_norm)
}

/// Refits every atom in turn to its users' residuals, and the users' values to the new atom.
///
/// Step j refits an atom `d` whose users `i` have values `g_i` and residuals `r_i`. It replaces `d` by the normalised
/// `sum_i g_i (r_i + g_i d)`. It then replaces each `g_i` by the projection of `r_i + g_i d` on the new atom. Later steps
/// see the new residuals. Returns the new atoms; `training` is changed to match.
pub(super) fn refit(old: &Atoms, training: &mut Training) -> Vec<f32> {
    let dim = old.dim();
    let uses = training.uses(old.len());
    let mut atoms = old.as_slice().to_vec();
    let mut partial = vec![0.0_f32; dim];
    for (uses, atom) in uses.iter().zip(atoms.chunks_exact_mut(dim)) {
        let mut sum = vec![0.0_f64; dim];
        let mut energy = 0.0_f64;
        for group in uses.chunks(PARTIAL) {
            partial.fill(0.0);
            for u in group {
                let value = training.values[u.entry];
                energy += f64::from(value) * f64::from(value);
                let residual = &training.residuals[u.vector * dim..][..dim];
                for (p, r) in partial.iter_mut().zip(residual) {
                    *p += value * r;
                }
            }
            for (s, p) in sum.iter_mut().zip(&partial) {
                *s += f64::from(*p);
            }
        }
        let Some(new) = ksvd_atom(sum, energy, atom, MIN_NORM) else { continue };
        for u in uses {
            let value = &mut training.values[u.entry];
            let residual = &mut training.residuals[u.vector * dim..][..dim];
            for (r, a) in residual.iter_mut().zip(&*atom) {
                *r += *value * a;
            }
            *value = dot(residual, &new);
            for (r, a) in residual.iter_mut().zip(&new) {
                *r -= *value * a;
            }
        }
        atom.copy_from_slice(&new);
    }
    atoms
}

/// Adds momentum to `atoms`. The new velocity of an atom is its step from `old` plus `momentum` times its velocity. The
/// atom becomes the normalised sum of its old value and the new velocity.
pub(super) fn accelerate(old: &Atoms, atoms: &mut [f32], velocity: &mut [f32], momentum: f32) {
    let dim = old.dim();
    let moving = atoms.chunks_exact_mut(dim).zip(velocity.chunks_exact_mut(dim));
    for ((atom, velocity), old) in moving.zip(old.as_slice().chunks_exact(dim)) {
        for ((v, new), old) in velocity.iter_mut().zip(&*atom).zip(old) {
            *v = momentum * *v + (new - old);
        }
        let target: Vec<f64> =
            old.iter().zip(&*velocity).map(|(o, v)| f64::from(*o) + f64::from(*v)).collect();
        if let Some(new) = normalised(&target) {
            atom.copy_from_slice(&new);
        }
    }
}

/// Returns the dot product of `a` and `b`, summed in [`PARTS`] partial sums.
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; PARTS];
    let (a_chunks, b_chunks) = (a.chunks_exact(PARTS), b.chunks_exact(PARTS));
    for ((s, x), y) in sums.iter_mut().zip(a_chunks.remainder()).zip(b_chunks.remainder()) {
        *s = x * y;
    }
    for (x, y) in a_chunks.zip(b_chunks) {
        for i in 0..PARTS {
            sums[i] += x[i] * y[i];
        }
    }
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))
}

#[cfg(test)]
mod tests {
    use super::super::training::Beyond;
    use super::*;
    use crate::scene::sh::ShDegree;
    use crate::sparse::dictionary::Dictionary;
    use crate::sparse::model::Pursuit;
    use crate::sparse::pursuit::{Coder, StopRule, ValueType};
    use crate::support::rng::SplitMix64;

    fn noise(rng: &mut SplitMix64, len: usize) -> Vec<f32> {
        (0..len).map(|_| f32::from(u16::try_from(rng.below(2001)).unwrap()) / 1000.0 - 1.0).collect()
    }

    /// K-SVD lowers the squared error. The residuals in `training` become those of the new atoms and values.
    #[test]
    fn refit_lowers_the_error_and_keeps_residuals_true() {
        let degree = ShDegree::new(2).unwrap();
        let dim = degree.rest();
        let mut rng = SplitMix64::new(5);
        let vectors = noise(&mut rng, 300 * dim);
        let atoms: Vec<f32> = (0..40)
            .flat_map(|_| {
                let v: Vec<f64> = noise(&mut rng, dim).iter().map(|&x| f64::from(x)).collect();
                normalised(&v).unwrap()
            })
            .collect();
        let dictionary = Dictionary::new(degree, atoms).unwrap();
        let stop = StopRule::new(None, Some(4)).unwrap();
        let coder = Coder::new(&dictionary, Pursuit::Omp, stop, ValueType::F32);
        let mut training = Training::code(&coder, &vectors, Beyond::Exact);
        let energy = |t: &Training| t.residuals.iter().map(|r| f64::from(r * r)).sum::<f64>();
        let before = energy(&training);
        let new = refit(dictionary.atoms(), &mut training);
        assert!(energy(&training) < before * 0.999, "{} {before}", energy(&training));
        for vector in 0..training.len() {
            let mut expected = vectors[vector * dim..][..dim].to_vec();
            for entry in training.starts[vector]..training.starts[vector + 1] {
                let atom = &new[usize::from(training.atoms[entry]) * dim..][..dim];
                for (e, a) in expected.iter_mut().zip(atom) {
                    *e -= training.values[entry] * a;
                }
            }
            for (e, r) in expected.iter().zip(&training.residuals[vector * dim..][..dim]) {
                assert!((e - r).abs() < 1e-4, "vector {vector}: {e} {r}");
            }
        }
    }
}
