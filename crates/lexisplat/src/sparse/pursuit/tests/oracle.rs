//! A naive pursuit in f64, which projects every candidate afresh in every step, and random data for it.

use crate::sparse::atoms::Atoms;
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::greedy::{ANY, Plan};
use crate::support::rng::SplitMix64;

/// Squared distance to the chosen span below which the engine may refuse a candidate.
pub(super) const NEAR_SPAN: f64 = 1e-4;

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Returns the part of `vector` outside the span of an orthonormal `basis`. The vector is projected twice because of
/// rounding.
pub(super) fn off(basis: &[Vec<f64>], vector: &[f64]) -> Vec<f64> {
    let mut left = vector.to_vec();
    for _ in 0..2 {
        for direction in basis {
            let c = dot(direction, &left);
            for (l, d) in left.iter_mut().zip(direction) {
                *l -= c * d;
            }
        }
    }
    left
}

pub(super) fn normalised(mut vector: Vec<f64>) -> Vec<f64> {
    let norm = dot(&vector, &vector).sqrt();
    vector.iter_mut().for_each(|x| *x /= norm);
    vector
}

/// Returns an orthonormal basis of the span of the chosen atoms.
pub(super) fn basis_of(atoms: &[Vec<f64>], chosen: impl IntoIterator<Item = usize>) -> Vec<Vec<f64>> {
    let mut basis = Vec::new();
    for j in chosen {
        basis.push(normalised(off(&basis, &atoms[j])));
    }
    basis
}

/// Returns the score of each atom, by which a pursuit whose chosen atoms span `basis` prefers it. The score is `None` for
/// atoms too close to the span.
pub(super) fn scores(
    pursuit: Pursuit,
    atoms: &[Vec<f64>],
    basis: &[Vec<f64>],
    residual: &[f64],
) -> Vec<Option<f64>> {
    atoms
        .iter()
        .map(|atom| {
            let fresh = off(basis, atom);
            let distance = dot(&fresh, &fresh);
            let correlation = dot(atom, residual);
            (distance > NEAR_SPAN).then(|| match pursuit {
                Pursuit::Omp => correlation * correlation,
                Pursuit::Ols => correlation * correlation / distance,
            })
        })
        .collect()
}

/// Share of the best score. Two atoms whose scores differ by at most this share are equally good in f32.
pub(super) const CLOSE: f64 = 1e-3;
/// Squared rounding noise of f32 recurrences over at most 72 steps, as a share of the signal's energy.
pub(super) const NOISE: f64 = 1e-9;
/// Largest error of f32 recurrences, as a share of the signal. The tolerance is checked in f64, not by these recurrences.
pub(super) const ROUNDING: f64 = 1e-3;

#[expect(clippy::cast_possible_truncation, reason = "test data are small")]
pub(in crate::sparse) fn uniform(rng: &mut SplitMix64) -> f32 {
    ((rng.next() >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0) as f32
}

pub(in crate::sparse) fn random_atoms(dim: usize, atoms: usize, rng: &mut SplitMix64) -> Atoms {
    let mut values = Vec::new();
    for _ in 0..atoms {
        let atom: Vec<f32> = (0..dim).map(|_| uniform(rng)).collect();
        let norm = atom.iter().map(|x| x * x).sum::<f32>().sqrt();
        values.extend(atom.iter().map(|x| x / norm));
    }
    Atoms::new(dim, values).unwrap()
}

pub(super) fn random_rows(dim: usize, count: usize, scale: f32, rng: &mut SplitMix64) -> Vec<f32> {
    (0..count * dim).map(|_| scale * uniform(rng)).collect()
}

pub(super) fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&x| f64::from(x)).collect()
}

/// Checks the engine against the oracle. At every step, the engine must take the atom that the oracle would take after the
/// same choices, or an atom so close to it that f32 cannot tell. The engine's least-squares solution must be as good as the
/// oracle's.
pub(super) fn check_agreement(atoms: &Atoms, signal: &[f32], pursuit: Pursuit, tol: f64) {
    let all: Vec<Vec<f64>> = (0..atoms.len()).map(|j| wide(atoms.atom(j))).collect();
    let plan = Plan::new(atoms);
    let mut scratch = plan.scratch();
    let exact = wide(signal);
    let mut basis = Vec::new();
    let mut residual = exact.clone();
    plan.start::<ANY>(&mut scratch, signal, dot(&exact, &exact));
    while dot(&residual, &residual).sqrt() > tol {
        let scores = scores(pursuit, &all, &basis, &residual);
        let best = scores.iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
        let slack = CLOSE * best + NOISE * dot(&exact, &exact);
        if !plan.step::<ANY>(&mut scratch, pursuit) {
            assert!(best <= slack || scratch.len == atoms.dim(), "an atom of score {best} is left");
            break;
        }
        let (&taken, before) = scratch.chosen[..scratch.len].split_last().unwrap();
        // Noise about an atom in the span may be all that is left, and the engine may then choose that atom again.
        let again = before.contains(&taken);
        let taken = usize::from(taken);
        if let Some(score) = scores[taken].filter(|_| !again) {
            assert!(score >= best - slack, "{score} {best}");
        } else if again {
            assert!(best <= slack, "atom {taken} again, and one of score {best} is left");
            continue;
        }
        basis.push(normalised(off(&basis, &all[taken])));
        residual = off(&basis, &exact);
        let energy = dot(&residual, &residual);
        assert!((scratch.energy - energy).abs() <= ROUNDING * dot(&exact, &exact));
    }
    let mut code = Vec::new();
    plan.solve(&mut scratch, &mut code);
    let error = plan.error(&mut scratch, signal, &code);
    let least = dot(&residual, &residual).sqrt();
    assert!(error <= least + ROUNDING * dot(&exact, &exact).sqrt(), "{error} {least}");
}
