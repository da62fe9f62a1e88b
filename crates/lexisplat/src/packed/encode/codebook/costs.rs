//! Costs of symbols in bits, estimated from how often codes used them.

use serde::{Deserialize, Serialize};

use super::{COUNT_CLASSES, Codes};
use crate::support::maths;

/// Number of value sizes with a cost of their own. The costs of larger values are extrapolated.
const VALUE_COSTS: usize = 64;
/// Added to every count before a cost is computed, so that symbols that were never used have a finite cost.
const SMOOTHING: f64 = 0.25;

/// Costs of symbols, in bits.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Costs {
    /// Cost of an atom, by its number.
    pub(super) atoms: Vec<f32>,
    /// Cost of a value with its sign, by its size minus 1.
    pub(super) values: Vec<f32>,
    /// Cost of a number of nonzeros, by colour class and then by number.
    pub(super) counts: Vec<Vec<f32>>,
}

impl Costs {
    /// Returns costs to start with, for `atoms` atoms and rows of `dim` coefficients.
    pub(in crate::packed) fn initial(atoms: usize, dim: usize) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let bits = |x: f64| x as f32;
        let value = |k: usize| bits(1.0 + 2.0 * libm::log2((k + 1) as f64) + 1.0);
        let count = |n: usize| bits(0.5 + 0.8 * n as f64);
        Self {
            atoms: vec![bits(libm::log2(atoms as f64)); atoms],
            values: (0..VALUE_COSTS).map(value).collect(),
            counts: vec![(0..=dim + 1).map(count).collect(); COUNT_CLASSES],
        }
    }

    /// Computes costs from `usage`. A colour class that was not used keeps its costs of `previous`.
    pub(super) fn of(usage: &Usage, previous: &Self) -> Self {
        let bits = |counts: &[f64]| -> Vec<f32> {
            let total: f64 = counts.iter().map(|c| c + SMOOTHING).sum();
            #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
            let cost = |c: &f64| -libm::log2((c + SMOOTHING) / total) as f32;
            counts.iter().map(cost).collect()
        };
        let mut values = bits(&usage.values);
        values.iter_mut().for_each(|bits| *bits += 1.0);
        let counts = usage
            .counts
            .iter()
            .zip(&previous.counts)
            .map(|(now, before)| if now.iter().sum::<f64>() > 0.0 { bits(now) } else { before.clone() });
        Self { atoms: bits(&usage.atoms), values, counts: counts.collect() }
    }

    /// Returns the cost of a value with its sign. `size` is its magnitude, at least 1.
    pub(super) fn value(&self, size: f32) -> f32 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1")]
        let index = (size as usize).saturating_sub(1);
        match self.values.get(index) {
            Some(&bits) => bits,
            None => self.values[VALUE_COSTS - 1] + 2.0 * maths::log2(size / VALUE_COSTS as f32),
        }
    }

    /// Returns the cost of each number of nonzeros in a colour class.
    pub(super) fn counts(&self, class: u8) -> &[f32] {
        &self.counts[usize::from(class).min(COUNT_CLASSES - 1)]
    }
}

/// Counts of how often codes used each symbol.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Usage {
    pub(super) atoms: Vec<f64>,
    values: Vec<f64>,
    counts: Vec<Vec<f64>>,
}

impl Usage {
    pub(super) fn of(codes: &Codes, classes: &[u8], atoms: usize, dim: usize) -> Self {
        let mut usage = Self {
            atoms: vec![0.0; atoms],
            values: vec![0.0; VALUE_COSTS],
            counts: vec![vec![0.0; dim + 2]; COUNT_CLASSES],
        };
        for (i, &class) in classes.iter().enumerate() {
            let code = codes.row(i);
            usage.counts[usize::from(class).min(COUNT_CLASSES - 1)][code.len()] += 1.0;
            for &(atom, value) in code {
                usage.atoms[usize::from(atom)] += 1.0;
                usage.values[(value.unsigned_abs() as usize - 1).min(VALUE_COSTS - 1)] += 1.0;
            }
        }
        usage
    }
}
