//! A dictionary that is learned from rows in several places, of which only sums travel.
//!
//! A round codes all rows with the atoms as they are. Each place sums up, for each atom, the residuals of its users times their
//! values. The sums of all places, added in a fixed order, move the atoms. All atoms move at once, while those of
//! [`learn`](super::learn) move one after the other and see the residuals that the ones before left: that needs the residuals
//! themselves. Files of either way are equally large (docs/METHOD.md, "Scenes larger than memory").

use serde::{Deserialize, Serialize};

use super::costs::{Costs, Usage};
use super::learn::{MIN_NORM, MIN_USERS, ROUNDS, SETTLING, first_atoms_of, most_used_first};
use super::{Codebook, StopRule};
use crate::sparse::learn::{axes_of_moments, ksvd_atom, take_first};

/// Directions of residuals that a place offers for unused atoms in a round.
const OFFERED: usize = 8;

/// A dictionary after some rounds.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Lesson {
    dim: usize,
    rounds: usize,
    atoms: Vec<f32>,
    costs: Costs,
    stop: StopRule,
}

/// What one place found out in a round.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Findings {
    usage: Usage,
    /// Of each atom the sum of its users' residuals times their values, and that of the squared values.
    sums: Vec<f32>,
    weights: Vec<f64>,
    /// Squared norms and directions of the largest residuals.
    farthest: Vec<(f32, Vec<f32>)>,
    /// Sum of all squared values.
    squares: f64,
}

impl Lesson {
    /// Begins with `atoms` atoms: principal axes of rows with these `moments`, sums of products of coordinates, and the
    /// directions of some `rows`.
    pub(in crate::packed) fn new(atoms: usize, moments: Vec<Vec<f64>>, rows: &[f32], stop: StopRule) -> Self {
        let dim = moments.len();
        let first = first_atoms_of(dim, atoms, &axes_of_moments(moments), rows);
        Self { dim, rounds: 0, atoms: first, costs: Costs::initial(atoms, dim), stop }
    }

    /// Whether all rounds are over but the one for [`Self::finish`].
    pub(in crate::packed) fn is_over(&self) -> bool {
        self.rounds >= ROUNDS
    }

    /// Number of rounds, and that of those to come.
    pub(in crate::packed) fn left(&self) -> usize {
        ROUNDS.saturating_sub(self.rounds)
    }

    /// Whether `found` is of these atoms.
    pub(in crate::packed) fn fits(&self, found: &Findings) -> bool {
        let count = self.atoms.len() / self.dim.max(1);
        let Findings { usage, sums, weights, farthest, .. } = found;
        usage.atoms.len() == count
            && sums.len() == self.atoms.len()
            && weights.len() == count
            && farthest.iter().all(|far| far.1.len() == self.dim)
    }

    /// What the `rows` of one place say of the atoms. `classes` has one entry a row.
    pub(in crate::packed) fn find(&self, rows: &[f32], classes: &[u8]) -> Findings {
        let (dim, count) = (self.dim, self.atoms.len() / self.dim.max(1));
        let book = Codebook::new(dim, self.atoms.clone(), self.costs.clone());
        let codes = book.encode(rows, classes, self.stop);
        let usage = Usage::of(&codes, classes, count, dim);
        let (mut sums, mut weights) = (vec![0.0_f64; count * dim], vec![0.0_f64; count]);
        let (mut residual, mut squares) = (vec![0.0_f32; dim], 0.0);
        let mut energies = Vec::with_capacity(classes.len());
        let left_by = |i: usize, residual: &mut [f32]| {
            residual.copy_from_slice(&rows[i * dim..(i + 1) * dim]);
            for &(atom, value) in codes.row(i) {
                #[expect(clippy::cast_precision_loss, reason = "values are small")]
                let value = value as f32;
                residual.iter_mut().zip(book.atom(atom.into())).for_each(|(r, a)| *r -= value * a);
            }
        };
        for i in 0..classes.len() {
            left_by(i, &mut residual);
            for &(atom, value) in codes.row(i) {
                let (j, value) = (usize::from(atom), f64::from(value));
                let own = sums[j * dim..(j + 1) * dim].iter_mut();
                own.zip(&residual).for_each(|(sum, r)| *sum += value * f64::from(*r));
                weights[j] += value * value;
                squares += value * value;
            }
            energies.push((residual.iter().map(|x| x * x).sum::<f32>(), i));
        }
        let offered = if self.rounds + SETTLING < ROUNDS { OFFERED } else { 0 };
        let largest = take_first(energies, offered, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let direction = |&(energy, i): &(f32, usize)| {
            left_by(i, &mut residual);
            (energy, residual.iter().map(|r| r / energy.sqrt()).collect())
        };
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let sums = sums.into_iter().map(|sum| sum as f32).collect();
        let farthest = largest.iter().filter(|far| far.0 > 0.0).map(direction).collect();
        Findings { usage, sums, weights, farthest, squares }
    }

    /// Moves the atoms by what all places found, in a fixed order.
    pub(in crate::packed) fn advance(&mut self, all: &[Findings]) {
        let Some(found) = Findings::sum(all) else { return };
        let dim = self.dim;
        let sums = found.sums.chunks_exact(dim).zip(&found.weights);
        for (atom, (sum, &weight)) in self.atoms.chunks_exact_mut(dim).zip(sums) {
            let sum = sum.iter().map(|&x| f64::from(x)).collect();
            if let Some(new) = ksvd_atom(sum, weight, atom, MIN_NORM) {
                atom.copy_from_slice(&new);
            }
        }
        self.costs = Costs::of(&found.usage, &self.costs);
        let unused = (0..found.weights.len()).filter(|&j| found.usage.atoms[j] < MIN_USERS);
        for (j, (_, direction)) in unused.zip(&found.farthest) {
            self.atoms[j * dim..(j + 1) * dim].copy_from_slice(direction);
        }
        self.rounds += 1;
    }

    /// The atoms most used first, without unused ones, the costs at which all places used them in the last round, and the mean
    /// square of their values.
    pub(in crate::packed) fn finish(&self, all: &[Findings]) -> Option<(Vec<f32>, Costs, f64)> {
        let found = Findings::sum(all).filter(|_| all.iter().all(|found| self.fits(found)))?;
        let count = self.atoms.len() / self.dim;
        let (atoms, costs) = most_used_first(self.dim, &self.atoms, count, &found.usage, &self.costs);
        let values: f64 = found.usage.atoms.iter().sum();
        Some((atoms, costs, found.squares / (1.0 + values)))
    }
}

impl Findings {
    /// The sum of all, one after the other; `None` if there are none.
    fn sum(all: &[Self]) -> Option<Self> {
        let (first, rest) = all.split_first()?;
        let mut out = first.clone();
        let mut sums: Vec<f64> = out.sums.iter().map(|&sum| f64::from(sum)).collect();
        for more in rest {
            out.usage.merge(&more.usage);
            sums.iter_mut().zip(&more.sums).for_each(|(sum, more)| *sum += f64::from(*more));
            out.weights.iter_mut().zip(&more.weights).for_each(|(sum, more)| *sum += more);
            out.squares += more.squares;
            out.farthest.extend(more.farthest.iter().cloned());
        }
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        out.sums.iter_mut().zip(sums).for_each(|(out, sum)| *out = sum as f32);
        out.farthest.sort_by(|a, b| b.0.total_cmp(&a.0));
        Some(out)
    }
}
