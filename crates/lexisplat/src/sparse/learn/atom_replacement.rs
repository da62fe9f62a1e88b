//! The first atoms, the replacement of useless ones, and the canonical form of a finished dictionary.

use std::cmp::{Ordering, Reverse};

use super::LearnOptions;
use super::axes::principal_axes;
use super::training::Training;
use super::update::{dot, normalised};
use crate::sparse::atoms::Atoms;
use crate::support::rng::SplitMix64;

/// Two atoms whose |cos| is above this count as one (KSVD-Box, `muthresh`).
const DUPLICATE_COS: f32 = 0.99;
/// An atom with fewer users is replaced (KSVD-Box, `cleardict`).
const MIN_USERS: usize = 4;
/// Largest |cos| of two first atoms, as long as enough dissimilar vectors can be found.
const FIRST_COS: f32 = 0.9;
/// Draws for each first atom that keep to [`FIRST_COS`], and draws altogether.
const DRAWS_PER_ATOM: [usize; 2] = [20, 40];
/// Mixed into the seed, so that the first atoms do not depend on the sample's random numbers.
const FIRST_STREAM: u64 = 0x46;

fn direction(vector: &[f32]) -> Option<Vec<f32>> {
    let wide: Vec<f64> = vector.iter().map(|&x| f64::from(x)).collect();
    normalised(&wide)
}

/// Returns `atoms` unit vectors: principal axes, then directions of dissimilar random vectors of `sample`, then of any
/// others, then coordinate axes, then random directions.
///
/// Without the principal axes learning ends in worse optima. Vectors of the sample share their strongest directions,
/// and the weak ones, which small tolerances need, would be found late or never.
pub(super) fn first_atoms(dim: usize, sample: &[f32], atoms: usize, options: &LearnOptions) -> Vec<f32> {
    let vectors = sample.len() / dim;
    let mut rng = SplitMix64::new(options.seed ^ FIRST_STREAM);
    let mut out: Vec<f32> = Vec::with_capacity(atoms * dim);
    // At least half of the atoms are vectors of the sample, because axes alone do not tell vectors apart.
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

/// Returns coordinate axis `axis`.
pub(crate) fn unit_axis(dim: usize, axis: usize) -> impl Iterator<Item = f32> {
    (0..dim).map(move |d| if d == axis { 1.0 } else { 0.0 })
}

/// Returns the first `wanted` of `list` in the order of `compare`, or all if there are fewer. No two may be equal.
pub(crate) fn take_first<T>(mut list: Vec<T>, wanted: usize, compare: impl Fn(&T, &T) -> Ordering) -> Vec<T> {
    if wanted > 0 && wanted < list.len() {
        list.select_nth_unstable_by(wanted - 1, &compare);
    }
    list.truncate(wanted);
    list.sort_unstable_by(compare);
    list
}

/// Replaces atoms with few users, and the less used of two similar atoms, by the vectors that cost most.
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
    // With a tolerance all residuals have about the same norm. A vector that the atoms fit badly has many nonzeros.
    let costs: Vec<(Reverse<usize>, Reverse<u64>, usize)> = (0..training.len())
        .map(|i| {
            let residual = &training.residuals[i * dim..][..dim];
            // Squared norms are not negative, so their bits have the same order.
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

/// Returns the atoms most used first, each with its largest entry positive.
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
