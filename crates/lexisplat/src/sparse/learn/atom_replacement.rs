//! The first atoms, the replacement of useless atoms, and the canonical form of a finished dictionary.

use std::cmp::{Ordering, Reverse};

use super::LearnOptions;
use super::axes::principal_axes;
use super::training::Training;
use super::update::{dot, normalised};
use crate::sparse::atoms::Atoms;
use crate::support::rng::SplitMix64;

/// Largest |cos| of two atoms that do not count as one (KSVD-Box, `muthresh`).
const DUPLICATE_COS: f32 = 0.99;
/// Number of users below which an atom is replaced (KSVD-Box, `cleardict`).
const MIN_USERS: usize = 4;
/// Largest |cos| of two first atoms, as long as enough dissimilar vectors can be found.
const FIRST_COS: f32 = 0.9;
/// Numbers of draws for each first atom: draws with the limit [`FIRST_COS`], and all draws. Further draws have the limit
/// [`DUPLICATE_COS`].
const DRAWS_PER_ATOM: [usize; 2] = [20, 40];
/// Number mixed into the seed, so that the first atoms do not depend on the random numbers of the sample.
const FIRST_STREAM: u64 = 0x46;

fn direction(vector: &[f32]) -> Option<Vec<f32>> {
    let wide: Vec<f64> = vector.iter().map(|&x| f64::from(x)).collect();
    normalised(&wide)
}

/// Returns `atoms` unit vectors: principal axes, then directions of random vectors of `sample`, then coordinate axes, then
/// random directions. Directions of vectors have a |cos| of at most [`FIRST_COS`] with the atoms before them, as long as
/// enough of them are found, and of at most [`DUPLICATE_COS`] afterwards.
///
/// Without the principal axes, learning ends in worse optima. The vectors of the sample share their strongest directions.
/// Weak directions, which small tolerances need, would be found late or never.
pub(super) fn first_atoms(dim: usize, sample: &[f32], atoms: usize, options: &LearnOptions) -> Vec<f32> {
    let vectors = sample.len() / dim;
    let mut rng = SplitMix64::new(options.seed ^ FIRST_STREAM);
    let mut out: Vec<f32> = Vec::with_capacity(atoms * dim);
    // At most half of the atoms are principal axes, because axes alone do not tell vectors apart.
    for axis in principal_axes(dim, sample).iter().take(atoms / 2) {
        out.extend(normalised(axis).into_iter().flatten());
    }
    if vectors > 0 {
        for draw in 0..DRAWS_PER_ATOM[1] * atoms {
            if out.len() >= atoms * dim {
                break;
            }
            let i = rng.below(vectors);
            let Some(candidate) = direction(&sample[i * dim..][..dim]) else { continue };
            let limit = if draw < DRAWS_PER_ATOM[0] * atoms { FIRST_COS } else { DUPLICATE_COS };
            if out.chunks_exact(dim).all(|atom| dot(atom, &candidate).abs() <= limit) {
                out.extend(candidate);
            }
        }
    }
    let missing = (atoms - out.len() / dim).min(dim);
    out.extend((0..missing).flat_map(|axis| unit_axis(dim, axis)));
    while out.len() < atoms * dim {
        #[expect(clippy::cast_precision_loss, reason = "any direction will do")]
        let random: Vec<f64> = (0..dim).map(|_| (rng.next() >> 11) as f64 - (1_u64 << 52) as f64).collect();
        out.extend(normalised(&random).into_iter().flatten());
    }
    out
}

/// Returns the unit vector of `dim` values along coordinate `axis`.
pub(crate) fn unit_axis(dim: usize, axis: usize) -> impl Iterator<Item = f32> {
    (0..dim).map(move |d| if d == axis { 1.0 } else { 0.0 })
}

/// Returns the first `wanted` items of `list` in the order of `compare`, or all items if there are fewer. No two items may
/// be equal.
pub(crate) fn take_first<T>(mut list: Vec<T>, wanted: usize, compare: impl Fn(&T, &T) -> Ordering) -> Vec<T> {
    if wanted > 0 && wanted < list.len() {
        list.select_nth_unstable_by(wanted - 1, &compare);
    }
    list.truncate(wanted);
    list.sort_unstable_by(compare);
    list
}

/// Replaces useless atoms by the directions of the vectors that cost most, and sets the velocities of the new atoms to 0.
///
/// An atom is useless if it has fewer than [`MIN_USERS`] users. It is also useless if its |cos| with an atom that has more
/// users, or with an earlier atom that has as many, is above [`DUPLICATE_COS`].
pub(super) fn replace_useless(atoms: &mut [f32], velocity: &mut [f32], training: &Training, vectors: &[f32]) {
    let dim = training.dim;
    let count = atoms.len() / dim;
    let users = training.usage(count);
    let useless: Vec<usize> = (0..count)
        .filter(|&j| {
            let rank = |k: usize| (users[k], Reverse(k));
            let alike = |k: usize| dot(&atoms[j * dim..][..dim], &atoms[k * dim..][..dim]).abs();
            users[j] < MIN_USERS || (0..count).any(|k| rank(k) > rank(j) && alike(k) > DUPLICATE_COS)
        })
        .collect();
    if useless.is_empty() {
        return;
    }
    // Costs compare nonzeros first. With a tolerance, all residuals have about the same norm, but a vector that the atoms
    // fit badly has many nonzeros.
    let costs: Vec<(Reverse<usize>, Reverse<u64>, usize)> = (0..training.len())
        .map(|i| {
            let residual = &training.residuals[i * dim..][..dim];
            // Squared norms are not negative, so their bits have the same order as the numbers.
            let error = f64::from(dot(residual, residual).max(0.0)).to_bits();
            (Reverse(training.starts[i + 1] - training.starts[i]), Reverse(error), i)
        })
        .collect();
    let worst = take_first(costs, useless.len(), Ord::cmp);
    for (j, (_, _, i)) in useless.into_iter().zip(worst) {
        if let Some(new) = direction(&vectors[i * dim..][..dim]) {
            atoms[j * dim..][..dim].copy_from_slice(&new);
            velocity[j * dim..][..dim].fill(0.0);
        }
    }
}

/// Returns the values of `atoms`, with the most used atom first. The entry of the largest absolute value of each atom is
/// positive.
pub(super) fn canonical(atoms: &Atoms, usage: &[usize]) -> Vec<f32> {
    let mut order: Vec<usize> = (0..atoms.len()).collect();
    order.sort_by_key(|&j| Reverse(usage[j]));
    let mut out = Vec::with_capacity(atoms.as_slice().len());
    for j in order {
        let atom = atoms.atom(j);
        let larger = |largest: f32, &x: &f32| if x.abs() > largest.abs() { x } else { largest };
        let largest = atom.iter().fold(0.0, larger);
        let sign = if largest < 0.0 { -1.0 } else { 1.0 };
        out.extend(atom.iter().map(|x| sign * x));
    }
    out
}
