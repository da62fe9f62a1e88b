//! Learns a dictionary for codes of least cost: codes the rows, refits each atom to the rows that use it, and repeats.

use super::costs::{Costs, Usage};
use super::{Codebook, StopRule};
use crate::sparse::learn::{ksvd_atom, principal_axes, take_first, unit_axis};
use crate::support::error::Result;
use crate::support::progress::{Progress, Stage};

/// Rounds of coding and refitting.
const ROUNDS: usize = 14;
/// Least number of users of an atom. An atom with fewer is replaced. The exact codec replaces atoms with fewer than 4
/// users, and the less used of two similar atoms. Files depend on both rules.
const MIN_USERS: f64 = 3.0;
/// Number of last rounds in which no atoms are replaced.
const SETTLING: usize = 4;
/// Shortest sum that gives an atom a new direction.
const MIN_NORM: f64 = 0.0;

/// Learns unit-norm atoms from `rows`, starting with the atoms `first`. The last `fixed` of these stay as they are. Returns
/// the learned atoms, most used first and without unused ones, followed by the fixed ones. Returns also the costs of
/// symbols.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` cancels.
pub(crate) fn learn(
    dim: usize,
    rows: &[f32],
    classes: &[u8],
    first: Vec<f32>,
    fixed: usize,
    stop: StopRule,
    progress: &dyn Progress,
) -> Result<(Vec<f32>, Costs)> {
    let count = first.len() / dim;
    let learned = count - fixed.min(count);
    let mut book = Codebook::new(dim, first, Costs::initial(count, dim));
    progress.begin(Stage::Learn, ROUNDS as u64);
    for round in 0..ROUNDS {
        let codes = book.encode(rows, classes, stop);
        let usage = Usage::of(&codes, classes, count, dim);
        let mut residuals = rows.to_vec();
        let mut users: Vec<Vec<(u32, f32)>> = vec![Vec::new(); count];
        for (i, residual) in (0_u32..).zip(residuals.chunks_exact_mut(dim)) {
            for &(atom, value) in codes.row(i as usize) {
                #[expect(clippy::cast_precision_loss, reason = "values are small")]
                let value = value as f32;
                users[usize::from(atom)].push((i, value));
                for (r, a) in residual.iter_mut().zip(book.atom(usize::from(atom))) {
                    *r -= value * a;
                }
            }
        }
        let mut atoms = book.rows.clone();
        for (users, atom) in users.iter().zip(atoms.chunks_exact_mut(dim)).take(learned) {
            refit(users, atom, &mut residuals);
        }
        let costs = Costs::of(&usage, &book.costs);
        if round + SETTLING < ROUNDS {
            replace_unused(dim, &usage.atoms[..learned], &mut atoms, &residuals);
        }
        book = Codebook::new(dim, atoms, costs);
        progress.advance(1);
        progress.check()?;
    }
    progress.end();
    let codes = book.encode(rows, classes, stop);
    let usage = Usage::of(&codes, classes, count, dim);
    Ok(most_used_first(dim, &book.rows, learned, &usage, &book.costs))
}

/// Sorts the first `learned` of `atoms` by use, most used first, and drops unused ones. The other atoms follow. Returns the
/// atoms and the costs for this `usage`. `before` are the costs with which the codes were found.
fn most_used_first(
    dim: usize,
    atoms: &[f32],
    learned: usize,
    usage: &Usage,
    before: &Costs,
) -> (Vec<f32>, Costs) {
    let mut order: Vec<usize> = (0..learned).filter(|&j| usage.atoms[j] > 0.0).collect();
    order.sort_by(|&a, &b| usage.atoms[b].total_cmp(&usage.atoms[a]).then(a.cmp(&b)));
    order.extend(learned..atoms.len() / dim);
    if order.is_empty() {
        order.push(0);
    }
    let kept = order.iter().flat_map(|&j| &atoms[j * dim..(j + 1) * dim]).copied().collect();
    let costs = Costs::of(usage, before);
    let of_kept = order.iter().map(|&j| costs.atoms[j]).collect();
    (kept, Costs { atoms: of_kept, ..costs })
}

/// Moves `atom` to the unit vector with the least error if the values of `users` stay as they are. Updates the residuals.
///
/// The exact codec's `refit` sums residuals in f32 in groups of 64 users before it goes on in f64, and then refits the
/// values too. Here all sums are f64, and the values, which are integers, stay. Files depend on both, so only the new
/// direction is computed by shared code.
fn refit(users: &[(u32, f32)], atom: &mut [f32], residuals: &mut [f32]) {
    let dim = atom.len();
    let mut sum = vec![0.0_f64; dim];
    let mut weight = 0.0_f64;
    for &(i, value) in users {
        let residual = &residuals[i as usize * dim..(i as usize + 1) * dim];
        for (s, r) in sum.iter_mut().zip(residual) {
            *s += f64::from(value) * f64::from(*r);
        }
        weight += f64::from(value) * f64::from(value);
    }
    let Some(new) = ksvd_atom(sum, weight, atom, MIN_NORM) else { return };
    for &(i, value) in users {
        let residual = &mut residuals[i as usize * dim..(i as usize + 1) * dim];
        for ((r, a), n) in residual.iter_mut().zip(atom.iter()).zip(&new) {
            *r += value * (a - n);
        }
    }
    atom.copy_from_slice(&new);
}

/// Replaces atoms with too few users by the directions of the largest residuals.
fn replace_unused(dim: usize, users: &[f64], atoms: &mut [f32], residuals: &[f32]) {
    let unused: Vec<usize> = (0..users.len()).filter(|&j| users[j] < MIN_USERS).collect();
    if unused.is_empty() {
        return;
    }
    let energy = |row: &[f32]| row.iter().map(|x| x * x).sum::<f32>();
    let energies: Vec<(f32, usize)> =
        residuals.chunks_exact(dim).enumerate().map(|(i, row)| (energy(row), i)).collect();
    let largest = take_first(energies, unused.len(), |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for (&j, &(energy, i)) in unused.iter().zip(&largest) {
        if energy > 0.0 {
            let norm = energy.sqrt();
            for (a, r) in atoms[j * dim..(j + 1) * dim].iter_mut().zip(&residuals[i * dim..(i + 1) * dim]) {
                *a = r / norm;
            }
        }
    }
}

/// Returns `atoms` atoms to start with: principal axes, then directions of `rows`, then coordinate axes.
///
/// The exact codec draws dissimilar vectors at random and normalises in f64. Here `rows` are in random order already,
/// similar rows are not skipped, and norms are f32. Files depend on both, so only the principal axes are shared.
pub(crate) fn first_atoms(dim: usize, atoms: usize, rows: &[f32]) -> Vec<f32> {
    first_atoms_of(dim, atoms, &principal_axes(dim, rows), rows)
}

/// Returns [`first_atoms`], given the principal axes of `rows`.
fn first_atoms_of(dim: usize, atoms: usize, axes: &[Vec<f64>], rows: &[f32]) -> Vec<f32> {
    let mut out = Vec::with_capacity(atoms * dim);
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
    for axis in axes.iter().take(atoms / 2) {
        out.extend(axis.iter().map(|&x| x as f32));
    }
    let mut rows = rows.chunks_exact(dim);
    while out.len() < atoms * dim {
        let Some(row) = rows.next() else { break };
        let norm = row.iter().map(|x| x * x).sum::<f32>().sqrt();
        if norm > 1.0 && norm.is_finite() {
            out.extend(row.iter().map(|x| x / norm));
        }
    }
    let missing = atoms - out.len() / dim;
    out.extend((0..missing).flat_map(|k| unit_axis(dim, k % dim)));
    out
}
