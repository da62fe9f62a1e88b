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

    /// Number of rounds to come.
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
        let found = Findings::sum(all)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;
    use crate::packed::codebook::{first_atoms, learn};
    use crate::support::rng::SplitMix64;

    const DIM: usize = 9;
    const ATOMS: usize = 20;

    /// Rows of few of some hidden atoms, with noise, and their classes.
    fn rows(count: usize, seed: u64) -> (Vec<f32>, Vec<u8>) {
        let mut random = SplitMix64::new(seed);
        let mut unit = move || (random.next() >> 40) as f32 / (1_u64 << 24) as f32 - 0.5;
        let mut hidden = SplitMix64::new(99);
        let hidden: Vec<f32> =
            (0..ATOMS * DIM).map(|_| (hidden.next() % 2001) as f32 / 1000.0 - 1.0).collect();
        let mut rows = Vec::new();
        for i in 0..count {
            let mut row = [0.0; DIM];
            for k in [i % ATOMS, (i / 3) % ATOMS] {
                let value = 40.0 * unit();
                row.iter_mut().zip(&hidden[k * DIM..]).for_each(|(r, a)| *r += value * a);
            }
            row.iter_mut().for_each(|r| *r += unit());
            rows.extend(row);
        }
        (rows, (0..5_u8).cycle().take(count).collect())
    }

    fn begun(rows: &[f32]) -> Lesson {
        let mut moments = vec![vec![0.0; DIM]; DIM];
        for row in rows.chunks_exact(DIM) {
            for i in 0..DIM {
                (0..DIM).for_each(|j| moments[i][j] += f64::from(row[i]) * f64::from(row[j]));
            }
        }
        Lesson::new(ATOMS, moments, rows, StopRule::Balanced)
    }

    #[test]
    fn findings_are_sums_over_rows() {
        let (rows, classes) = rows(600, 1);
        let lesson = begun(&rows);
        let found = lesson.find(&rows, &classes);
        let book = Codebook::new(DIM, lesson.atoms.clone(), lesson.costs.clone());
        let codes = book.encode(&rows, &classes, lesson.stop);
        let (mut sums, mut weights) = (vec![0.0_f64; ATOMS * DIM], [0.0_f64; ATOMS]);
        for i in 0..classes.len() {
            let mut residual: Vec<f64> = rows[i * DIM..(i + 1) * DIM].iter().map(|&x| x.into()).collect();
            for &(atom, value) in codes.row(i) {
                let atom = &lesson.atoms[usize::from(atom) * DIM..][..DIM];
                residual.iter_mut().zip(atom).for_each(|(r, a)| *r -= f64::from(value) * f64::from(*a));
            }
            for &(atom, value) in codes.row(i) {
                let own = &mut sums[usize::from(atom) * DIM..][..DIM];
                own.iter_mut().zip(&residual).for_each(|(sum, r)| *sum += f64::from(value) * r);
                weights[usize::from(atom)] += f64::from(value).powi(2);
            }
        }
        assert_eq!(found.weights, weights);
        for (found, expected) in found.sums.iter().zip(&sums) {
            assert!(
                (f64::from(*found) - expected).abs() < 1e-3 * (1.0 + expected.abs()),
                "{found} {expected}"
            );
        }
        let half = classes.len() / 2;
        let parts = [
            lesson.find(&rows[..half * DIM], &classes[..half]),
            lesson.find(&rows[half * DIM..], &classes[half..]),
        ];
        let sum = Findings::sum(&parts).unwrap();
        assert_eq!(
            (sum.weights, sum.usage.atoms, sum.squares),
            (found.weights, found.usage.atoms, found.squares)
        );
        for (a, b) in sum.sums.iter().zip(&found.sums) {
            assert!((a - b).abs() <= 1e-4 * (1.0 + a.abs()), "{a} {b}");
        }
        assert_eq!(sum.farthest[..OFFERED], found.farthest[..]);
    }

    #[test]
    fn atoms_from_sums_are_as_good_as_from_residuals() {
        let (rows, classes) = rows(3000, 2);
        let cost = |atoms: Vec<f32>, costs: Costs| {
            let (error, bits) = Codebook::new(DIM, atoms, costs).spent(&rows, &classes);
            error + f64::from(super::super::PRICE) * bits
        };
        let mut lesson = begun(&rows);
        let before = cost(lesson.atoms.clone(), lesson.costs.clone());
        let places = [0..1000, 1000..1100, 1100..3000];
        let find = |lesson: &Lesson| -> Vec<Findings> {
            let of = |place: &std::ops::Range<usize>| {
                lesson.find(&rows[place.start * DIM..place.end * DIM], &classes[place.clone()])
            };
            places.iter().map(of).collect()
        };
        while !lesson.is_over() {
            assert_eq!(lesson.left(), ROUNDS - lesson.rounds);
            lesson.advance(&find(&lesson));
        }
        let (atoms, costs, _) = lesson.finish(&find(&lesson)).unwrap();
        let after = cost(atoms, costs);
        let first = first_atoms(DIM, ATOMS, &rows);
        let (atoms, costs) = learn(DIM, &rows, &classes, first, 0, StopRule::Balanced, &Silent).unwrap();
        let one_by_one = cost(atoms, costs);
        assert!(after < 0.8 * before && after < 1.03 * one_by_one, "{before} {after} {one_by_one}");
    }
}
