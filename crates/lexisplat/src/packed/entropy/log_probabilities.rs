//! Tables of probabilities as a file holds them: logarithms, whose differences are coded.

use crate::packed::bitstream::broken::{BrokenHead, must};
use crate::packed::entropy::adaptive_bits::{BitModel, Bits, SignedBitModel};

/// Number of levels of an octave. A level is a negative binary logarithm of a probability in this unit.
const LEVELS_PER_OCTAVE: u32 = 2;
/// Weights at the levels of the lowest octave: 32, and 32 times the root of 2.
const WEIGHTS: [u32; LEVELS_PER_OCTAVE as usize] = [32, 45];
/// Largest number of symbols of a table, and the number of its bits.
pub(in crate::packed) const MAX_SYMBOLS: usize = 256;
const COUNT_BITS: usize = 9;
/// Number of bits of the level of the first symbol.
const FIRST_BITS: u32 = 5;

/// The symbols of a table. The last symbol always occurs.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct LogProbabilities(Vec<LogProbability>);

/// A symbol of a table.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct LogProbability {
    /// The level of the symbol. A symbol that does not occur has the level of the symbol before.
    level: u32,
    occurs: bool,
}

/// The adaptive probabilities of the bits of tables.
#[derive(Debug, Default)]
pub(in crate::packed) struct TableBitModels {
    counts: [BitModel; COUNT_BITS + 1],
    /// Whether a symbol occurs, by whether the symbol before does.
    occurs: [BitModel; 2],
    delta: SignedBitModel,
}

/// Returns the largest level of probabilities of `precision` bits.
fn most_level(precision: u32) -> u32 {
    LEVELS_PER_OCTAVE * precision
}

impl LogProbabilities {
    /// Codes a table of probabilities of `precision` bits. A decoder codes an empty table and gets the decoded one.
    ///
    /// # Errors
    /// The broken rule for tables that no encoder writes.
    pub(in crate::packed) fn code(
        &self,
        bits: &mut dyn Bits,
        models: &mut TableBitModels,
        precision: u32,
    ) -> Result<Self, BrokenHead> {
        let count = bits.positive(&mut models.counts, self.0.len() as u32) as usize;
        must(count <= MAX_SYMBOLS, || {
            format!("the tables: a table has {count} symbols, above {MAX_SYMBOLS}")
        })?;
        let mut symbols: Vec<LogProbability> = Vec::with_capacity(count);
        for i in 0..count {
            let LogProbability { level, occurs } = self.0.get(i).copied().unwrap_or_default();
            let before = symbols.last().copied();
            let by = &mut models.occurs[usize::from(before.is_none_or(|before| before.occurs))];
            let occurs = i + 1 == count || bits.bit(by, occurs);
            let level = match before {
                None => bits.even(FIRST_BITS, level),
                Some(before) if !occurs => before.level,
                Some(before) => {
                    let delta =
                        bits.signed(&mut models.delta, level.cast_signed() - before.level.cast_signed());
                    before.level.checked_add_signed(delta).unwrap_or(u32::MAX)
                }
            };
            let most = most_level(precision);
            must(level <= most, || format!("the tables: the level of symbol {i} is not from 0 to {most}"))?;
            symbols.push(LogProbability { level, occurs });
        }
        Ok(Self(symbols))
    }

    /// Returns the probability of each symbol in units of `2^-precision`, 0 for symbols that do not occur. The sum of all
    /// is 1. `None` if no symbol occurs.
    pub(in crate::packed) fn shares(&self, precision: u32) -> Option<Vec<u32>> {
        // A weight is below 2^18, so the sum is below 2^26 and a product below 2^30.
        let weight = |level: u32| {
            let up = most_level(precision).saturating_sub(level);
            WEIGHTS[(up % LEVELS_PER_OCTAVE) as usize] << (up / LEVELS_PER_OCTAVE)
        };
        let occurring = self.0.iter().filter(|symbol| symbol.occurs);
        let sum: u32 = occurring.clone().map(|symbol| weight(symbol.level)).sum();
        let whole = 1 << precision;
        let free = whole - occurring.count() as u32;
        let share = |symbol: &LogProbability| match symbol.occurs {
            true => 1 + weight(symbol.level) * free / sum,
            false => 0,
        };
        let mut shares: Vec<u32> = self.0.iter().map(share).collect();
        // The most frequent symbol takes the rest of the rounding, which costs least there.
        let left = whole - shares.iter().sum::<u32>();
        let most = (0..shares.len()).max_by_key(|&k| (shares[k], std::cmp::Reverse(k)))?;
        shares[most] += left;
        Some(shares)
    }

    /// Returns the table for which `counts` and the table itself take the fewest bits of probabilities of `precision` bits,
    /// and an estimate of these bits. The last count must not be 0.
    pub(in crate::packed) fn fit(counts: &[u32], precision: u32) -> (Self, f64) {
        Fit::new(counts, precision).best()
    }
}

/// Returns an estimate of the bits of a difference of levels. [`OCCURS`] has estimates of the bits that say whether a
/// symbol occurs, by whether the symbol before occurs and whether it does.
fn delta_bits(delta: usize) -> f32 {
    let length = (usize::BITS - delta.leading_zeros()) as f32;
    if delta == 0 { 0.8 } else { 2.3 + 2.2 * (length - 1.0) }
}
const OCCURS: [[f32; 2]; 2] = [[0.5, 1.8], [3.0, 0.2]];
/// Estimate of the bits of a table that do not depend on its symbols.
const TABLE_BITS: f32 = 9.0;

/// The search for the best levels. The levels of the last symbols are found first.
struct Fit<'a> {
    counts: &'a [u32],
    levels: usize,
    /// For each symbol, each level, and whether the symbol occurs: the bits of the symbol and of all symbols after it.
    bits: Vec<Vec<[f32; 2]>>,
}

impl<'a> Fit<'a> {
    fn new(counts: &'a [u32], precision: u32) -> Self {
        let levels = most_level(precision) as usize + 1;
        let octaves = |level: usize| level as f32 / LEVELS_PER_OCTAVE as f32;
        let total: f32 = counts.iter().map(|&count| count as f32).sum();
        // Probabilities are divided by their sum, so a probability lowers all others. This is its cost in bits.
        let share: Vec<f32> = (0..levels)
            .map(|level| total * libm::exp2f(-octaves(level)) * std::f32::consts::LOG2_E)
            .collect();
        let own = |&count: &u32| -> Vec<[f32; 2]> {
            let absent = if count == 0 { 0.0 } else { f32::INFINITY };
            let bits = |level: usize| count as f32 * octaves(level) + share[level];
            (0..levels).map(|level| [absent, bits(level)]).collect()
        };
        let mut fit = Self { counts, levels, bits: counts.iter().map(own).collect() };
        for i in (1..counts.len()).rev() {
            let add: Vec<[f32; 2]> =
                (0..levels).map(|level| [0, 1].map(|there| fit.choice(i, level, there).0)).collect();
            for (bits, add) in fit.bits[i - 1].iter_mut().zip(add) {
                bits[0] += add[0];
                bits[1] += add[1];
            }
        }
        fit
    }

    /// Returns the best choice of symbol `i` and of all symbols after it, if the symbol before has the level `before` and
    /// occurs if `there` is 1: the bits, the level, and whether symbol `i` occurs.
    fn choice(&self, i: usize, before: usize, there: usize) -> (f32, usize, bool) {
        let absent = self.bits[i][before][0] + OCCURS[there][0];
        let mut best = (absent, before, false);
        if self.counts[i] == 0 && i + 1 == self.counts.len() {
            best.0 = f32::INFINITY;
        }
        for level in 0..self.levels {
            let bits = self.bits[i][level][1] + OCCURS[there][1] + delta_bits(level.abs_diff(before));
            if bits < best.0 {
                best = (bits, level, true);
            }
        }
        best
    }

    fn best(&self) -> (LogProbabilities, f64) {
        let Some(first) = self.bits.first() else {
            return (LogProbabilities::default(), 0.0);
        };
        let all = (0..self.levels)
            .flat_map(|level| [(first[level][0], level, false), (first[level][1], level, true)]);
        let root = all.reduce(|best, next| if next.0 < best.0 { next } else { best }).unwrap_or_default();
        let mut symbols = vec![LogProbability { level: root.1 as u32, occurs: root.2 }];
        for i in 1..self.counts.len() {
            let before = symbols[i - 1];
            let (_, level, occurs) = self.choice(i, before.level as usize, usize::from(before.occurs));
            symbols.push(LogProbability { level: level as u32, occurs });
        }
        let total = f64::from(root.0 + TABLE_BITS)
            - self.counts.iter().map(|&count| f64::from(count)).sum::<f64>() * std::f64::consts::LOG2_E;
        (LogProbabilities(symbols), total)
    }
}
