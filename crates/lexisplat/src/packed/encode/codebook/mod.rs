//! Sparse codes that trade rate for distortion, and the dictionary that is learned for the same cost.
//!
//! A row is the SH-rest of a Gaussian in units of its value step. So values are integers, and the error of every Gaussian
//! counts the same. A code of the row `y` minimises `|y - D v|^2 + PRICE * bits(v)` over integer values `v`, greedily.
//!
//! This pursuit shares its lanes and its inner loops with that of the exact codec (`sparse::pursuit`). Its steps differ for
//! two reasons. The exact codec refits all values by least squares after every step, while values here are integers that
//! are corrected one by one. The exact codec compares atoms by the error that they remove, while this one also subtracts
//! their cost in bits.

mod choice;
mod costs;
mod learn;

use serde::{Deserialize, Serialize};

use crate::sparse::pursuit::lanes::{LANES, Lane, ZERO, accumulate, blocks_of, first_maximum, transposed};
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_chunks};
use crate::support::simd::Simd;

pub(in crate::packed) use choice::{Choice, choose};
pub(in crate::packed) use costs::Costs;
pub(in crate::packed) use learn::{first_atoms, learn};

/// Squared error, in squared steps, that one bit is worth. At high rates a quantiser's error falls by
/// 2 ln 2 / 12 = 0.116 squared steps a bit. Dead zones and short codes make a higher price pay.
pub(in crate::packed) const PRICE: f32 = 0.16;
/// Largest value, in steps. Rounding a residual never needs more.
const MAX_VALUE: f32 = 1e6;
/// Most atoms that are taken for each coefficient of a row, counting repeats. A row can be so long that subtracting an atom
/// does not change it in f32. Without this limit the loop would not end.
const TAKES_PER_VALUE: usize = 8;
/// Number of colour classes with costs of their own for the number of nonzeros. Higher classes share those of the last one.
const COUNT_CLASSES: usize = 12;

/// The codes of many rows, one after the other. A code is a list of pairs `(atom, value)`.
#[derive(Debug, Default, Clone)]
pub(in crate::packed) struct Codes {
    /// The end of each row's code in `pairs`.
    ends: Vec<usize>,
    pairs: Vec<(u16, i32)>,
}

impl Codes {
    pub(in crate::packed) fn row(&self, i: usize) -> &[(u16, i32)] {
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.pairs[start..self.ends[i]]
    }

    fn push(&mut self, code: &[(u16, i32)]) {
        self.pairs.extend_from_slice(code);
        self.ends.push(self.pairs.len());
    }

    fn append(&mut self, other: &Self) {
        let offset = self.pairs.len();
        self.pairs.extend_from_slice(&other.pairs);
        self.ends.extend(other.ends.iter().map(|end| end + offset));
    }
}

/// The rate and the distortion of codes.
struct RateAndDistortion {
    bits: f64,
    /// Sum of squared errors, in squared steps.
    error: f64,
}

/// A dictionary with its costs, prepared for coding.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Codebook {
    dim: usize,
    blocks: usize,
    /// The atoms, one after the other, of `dim` coefficients each.
    rows: Vec<f32>,
    /// `dim` rows of `blocks` lanes: entry `(d, j)` is coefficient `d` of atom `j`.
    transposed: Vec<Lane>,
    /// `atoms` rows of `blocks` lanes: entry `(i, j)` is the inner product of atoms `i` and `j`.
    gram: Vec<Lane>,
    pub(in crate::packed) costs: Costs,
}

/// Working memory for one row.
struct Scratch {
    correlations: Vec<Lane>,
    prices: Vec<Lane>,
    code: Vec<(u16, f32)>,
}

/// The rule by which the pursuit of a code stops.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(in crate::packed) enum StopRule {
    /// Stops when one more atom would cost more bits than its gain is worth.
    Balanced,
    /// Stops when the squared error, in squared steps, is at most this.
    Error(f32),
}

impl Codebook {
    pub(in crate::packed) fn new(dim: usize, rows: Vec<f32>, costs: Costs) -> Self {
        let atoms = rows.len() / dim.max(1);
        let blocks = blocks_of(atoms);
        let transposed = transposed(dim, &rows);
        let mut gram = vec![ZERO; atoms * blocks];
        for (atom, products) in rows.chunks_exact(dim.max(1)).zip(gram.chunks_exact_mut(blocks.max(1))) {
            accumulate(products, |_| ZERO, atom, &transposed, |sum, x, t| sum + x * t);
        }
        Self { dim, blocks, rows, transposed, gram, costs }
    }

    fn atom(&self, j: usize) -> &[f32] {
        &self.rows[j * self.dim..(j + 1) * self.dim]
    }

    /// Returns the codes of all rows. `classes` has one colour class a row.
    pub(in crate::packed) fn encode(&self, rows: &[f32], classes: &[u8], stop: StopRule) -> Codes {
        let tasks = map_chunks(classes.len(), GAUSSIANS_PER_TASK, |range| {
            let mut codes = Codes::default();
            Simd::current().run(Job {
                book: self,
                rows: &rows[range.start * self.dim..range.end * self.dim],
                classes: &classes[range],
                stop,
                codes: &mut codes,
            });
            codes
        });
        let mut all = Codes::default();
        for codes in &tasks {
            all.append(codes);
        }
        all
    }

    /// Returns the sums over the codes of all rows.
    fn rate_and_distortion(&self, rows: &[f32], classes: &[u8]) -> RateAndDistortion {
        let codes = self.encode(rows, classes, StopRule::Balanced);
        let (mut error, mut bits) = (0.0, 0.0);
        for (i, (row, &class)) in rows.chunks_exact(self.dim).zip(classes).enumerate() {
            let mut left = row.to_vec();
            let code = codes.row(i);
            bits += f64::from(self.costs.counts(class)[code.len()]);
            for &(atom, value) in code {
                bits += f64::from(self.costs.atoms[usize::from(atom)]);
                bits += f64::from(self.costs.value(value.unsigned_abs() as f32));
                #[expect(clippy::cast_precision_loss, reason = "values are small")]
                let value = value as f32;
                left.iter_mut().zip(self.atom(usize::from(atom))).for_each(|(x, a)| *x -= value * a);
            }
            error += f64::from(left.iter().map(|x| x * x).sum::<f32>());
        }
        RateAndDistortion { bits, error }
    }

    fn scratch(&self) -> Scratch {
        let mut prices = vec![Lane([f32::INFINITY; LANES]); self.blocks];
        for (j, bits) in self.costs.atoms.iter().enumerate() {
            prices[j / LANES].0[j % LANES] = PRICE * bits;
        }
        Scratch { correlations: vec![ZERO; self.blocks], prices, code: Vec::new() }
    }

    #[inline(always)]
    fn encode_row(&self, s: &mut Scratch, row: &[f32], class: u8, stop: StopRule, out: &mut Vec<(u16, i32)>) {
        s.code.clear();
        out.clear();
        let mut energy: f32 = row.iter().map(|x| x * x).sum();
        let counts = self.costs.counts(class);
        let goal = match stop {
            StopRule::Balanced => 0.0,
            StopRule::Error(most) => most,
        };
        // A code cannot gain more than the whole error, so a smaller error needs no search.
        let cheapest = PRICE * (counts[1] - counts[0]).max(0.0);
        if energy <= goal || (stop == StopRule::Balanced && energy <= cheapest) || !energy.is_finite() {
            return;
        }
        accumulate(&mut s.correlations, |_| ZERO, row, &self.transposed, |sum, x, t| sum + x * t);
        for _ in 0..TAKES_PER_VALUE * self.dim {
            if s.code.len() >= self.dim || energy <= goal {
                break;
            }
            let Some(best) = best(&s.correlations, &s.prices) else { break };
            let correlation = s.correlations[best / LANES].0[best % LANES];
            let value = correlation.round().clamp(-MAX_VALUE, MAX_VALUE);
            let value = if value == 0.0 { 1.0_f32.copysign(correlation) } else { value };
            let gain = value * (2.0 * correlation - value);
            let n = s.code.len();
            let bits = self.costs.atoms[best] + self.costs.value(value.abs()) + counts[n + 1] - counts[n];
            let worth = gain - PRICE * bits;
            if gain <= 0.0 || (stop == StopRule::Balanced && worth <= 0.0) {
                break;
            }
            energy -= gain;
            self.take(s, best, value);
            #[expect(clippy::cast_possible_truncation, reason = "at most 1024 atoms")]
            match s.code.iter_mut().find(|c| usize::from(c.0) == best) {
                Some(pair) => pair.1 += value,
                None => s.code.push((best as u16, value)),
            }
            energy -= self.round_again(s);
        }
        if stop == StopRule::Balanced {
            self.drop_costly(s, counts);
        }
        #[expect(clippy::cast_possible_truncation, reason = "clamped to a million")]
        out.extend(s.code.iter().filter(|c| c.1 != 0.0).map(|&(atom, value)| (atom, value as i32)));
        out.sort_by_key(|&(atom, value)| (std::cmp::Reverse(value.unsigned_abs()), atom));
    }

    /// Adds `value` of atom `j` to the code, and updates the correlations with the residual.
    #[inline(always)]
    fn take(&self, s: &mut Scratch, j: usize, value: f32) {
        let gram = &self.gram[j * self.blocks..(j + 1) * self.blocks];
        for (correlations, products) in s.correlations.iter_mut().zip(gram) {
            *correlations = correlations.zip(*products, |r, g| r - value * g);
        }
    }

    /// Rounds every value again, since later atoms changed the residual. Returns the decrease of the squared error.
    #[inline(always)]
    fn round_again(&self, s: &mut Scratch) -> f32 {
        let mut gained = 0.0;
        for k in 0..s.code.len() {
            let atom = usize::from(s.code[k].0);
            let correlation = s.correlations[atom / LANES].0[atom % LANES];
            let change = correlation.round();
            if change != 0.0 && change.abs() < MAX_VALUE {
                gained += change * (2.0 * correlation - change);
                self.take(s, atom, change);
                s.code[k].1 += change;
            }
        }
        gained
    }

    /// Drops atoms that cost more bits than their gain is worth.
    #[inline(always)]
    fn drop_costly(&self, s: &mut Scratch, counts: &[f32]) {
        for k in (0..s.code.len()).rev() {
            let (atom, value) = s.code[k];
            let j = usize::from(atom);
            let n = s.code.iter().filter(|c| c.1 != 0.0).count();
            if value == 0.0 || n == 0 {
                continue;
            }
            let loss = value * (value + 2.0 * s.correlations[j / LANES].0[j % LANES]);
            let bits = self.costs.atoms[j] + self.costs.value(value.abs()) + counts[n] - counts[n - 1];
            if loss < PRICE * bits {
                self.take(s, j, -value);
                s.code[k].1 = 0.0;
            }
        }
    }
}

/// Returns the atom whose squared correlation most exceeds its price.
#[inline(always)]
fn best(correlations: &[Lane], prices: &[Lane]) -> Option<usize> {
    let mut most = [f32::NEG_INFINITY; LANES];
    let mut block = [0_u32; LANES];
    for (number, (c, p)) in (0_u32..).zip(correlations.iter().zip(prices)) {
        for i in 0..LANES {
            let worth = c.0[i] * c.0[i] - p.0[i];
            // A mask instead of a branch, as in the exact codec's pursuit.
            let better = if worth > most[i] { u32::MAX } else { 0 };
            most[i] = f32::from_bits((worth.to_bits() & better) | (most[i].to_bits() & !better));
            block[i] = (number & better) | (block[i] & !better);
        }
    }
    first_maximum(&most, &block).filter(|(worth, _)| worth.is_finite()).map(|(_, atom)| atom)
}

/// The loop of [`Codebook::encode`], which is compiled once for each vector width.
struct Job<'a> {
    book: &'a Codebook,
    rows: &'a [f32],
    classes: &'a [u8],
    stop: StopRule,
    codes: &'a mut Codes,
}

impl pulp::NullaryFnOnce for Job<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let mut scratch = self.book.scratch();
        let mut code = Vec::new();
        for (row, &class) in self.rows.chunks_exact(self.book.dim).zip(self.classes) {
            self.book.encode_row(&mut scratch, row, class, self.stop, &mut code);
            self.codes.push(&code);
        }
    }
}
