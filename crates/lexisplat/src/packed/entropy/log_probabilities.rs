//! Tables of probabilities as a file holds them: logarithms, whose differences are coded.

use crate::packed::bitstream::streams::Stream;
use crate::packed::entropy::adaptive_bits::{BitModel, Bits, SignedBitModel};

/// Binary logarithms of the numbers of levels an octave that a table may have.
const GRAINS: std::ops::RangeInclusive<u32> = 0..=3;
const FINEST: u32 = *GRAINS.end();
/// Weights at the 8 finest levels of the lowest octave.
const WEIGHTS: [u32; 1 << FINEST] = [32, 35, 38, 41, 45, 49, 54, 59];
/// Integers below this are their own symbols. The next symbol stands for 8 integers, which are 3 octaves.
const DIRECT: usize = 16;
const FIRST_OF_MANY: u32 = 3;
/// Largest number of symbols of a table, and the number of its bits.
pub(in crate::packed) const MAX_SYMBOLS: usize = 256;
const COUNT_BITS: usize = 9;
/// Number of bits of the level of the first symbol, at one level an octave.
const FIRST_BITS: u32 = 4;
/// Largest difference of levels that the encoder tries.
const MOST_DELTA: usize = 24;

/// The meaning of the symbols of a stream: names without order, integers, integers with a sign, or gaps between cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::packed) enum Kind {
    Names,
    Whole,
    Signed,
    Gaps,
}

impl Kind {
    pub(in crate::packed) fn of(stream: Stream) -> Self {
        use Stream::{
            Atom0, Atom1, Atom2, AtomPage, Cell, ColourClass, Count0, Count1, Count2, Value0, Value1, Value2,
        };
        match stream {
            ColourClass | Atom0 | Atom1 | Atom2 | AtomPage => Self::Names,
            Count0 | Count1 | Count2 | Value0 | Value1 | Value2 => Self::Whole,
            Cell => Self::Gaps,
            _ => Self::Signed,
        }
    }

    /// Returns the symbol from which the probability of symbol `i` is predicted.
    fn parent(self, i: usize) -> usize {
        if self == Self::Signed && (2..DIRECT).contains(&i) { i - 2 } else { i.saturating_sub(1) }
    }

    /// Returns the number of octaves by which symbol `i` is expected to be likelier than its parent.
    fn gain(self, i: usize) -> u32 {
        if i == DIRECT && self != Self::Names { FIRST_OF_MANY } else { 0 }
    }
}

/// A table: the negative binary logarithms of probabilities, in levels.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct LogProbabilities {
    /// Binary logarithm of the number of levels an octave.
    grain: u32,
    /// The level of each symbol, and whether the symbol occurs. The last symbol always occurs. A symbol that does not occur
    /// has the level that is predicted for it, since levels of later symbols are predicted from it.
    symbols: Vec<(u32, bool)>,
}

/// The adaptive probabilities of the parts of tables.
#[derive(Debug, Default)]
pub(in crate::packed) struct LevelBitModels {
    counts: [[BitModel; COUNT_BITS + 1]; 4],
    grain: [BitModel; 4],
    occurs: [[[BitModel; 2]; 2]; 4],
    deltas: [[[SignedBitModel; 3]; 2]; 4],
}

impl LogProbabilities {
    /// Codes a table of probabilities of `precision` bits. A decoder codes an empty table and gets the decoded one. `None`
    /// for tables that no encoder writes.
    pub(in crate::packed) fn code(
        &self,
        bits: &mut dyn Bits,
        odds: &mut LevelBitModels,
        kind: Kind,
        precision: u32,
    ) -> Option<Self> {
        let of = kind as usize;
        let count = bits.positive(&mut odds.counts[of], self.symbols.len() as u32) as usize;
        if count > MAX_SYMBOLS {
            return None;
        }
        let high = u32::from(bits.bit(&mut odds.grain[0], self.grain > 1));
        let grain = 2 * high + u32::from(bits.bit(&mut odds.grain[1 + high as usize], self.grain & 1 == 1));
        let most = precision << grain;
        let mut symbols: Vec<(u32, bool)> = Vec::with_capacity(count);
        let mut last = 0;
        for i in 0..count {
            let (level, occurs) = self.symbols.get(i).copied().unwrap_or_default();
            let parent = symbols.get(kind.parent(i)).copied();
            let before = symbols.last().is_none_or(|before| before.1);
            let by =
                &mut odds.occurs[of][usize::from(parent.is_none_or(|parent| parent.1))][usize::from(before)];
            let occurs = i + 1 == count || bits.bit(by, occurs);
            let level = match parent {
                None => bits.even(FIRST_BITS + grain, level),
                Some((parent, _)) => {
                    let expected = parent.saturating_sub(kind.gain(i) << grain);
                    let delta = match occurs {
                        false => 0,
                        true => {
                            let odds = &mut odds.deltas[of][usize::from(i >= DIRECT)][last];
                            let delta = bits.signed(odds, level.cast_signed() - expected.cast_signed());
                            last = if delta == 0 { 0 } else { 1 + usize::from(delta < 0) };
                            delta
                        }
                    };
                    expected.checked_add_signed(delta)?
                }
            };
            if level > most {
                return None;
            }
            symbols.push((level, occurs));
        }
        Some(Self { grain, symbols })
    }

    /// Returns the weight of each symbol, which is below 2^19. The probabilities have `precision` bits. A symbol that does
    /// not occur has the weight 0.
    pub(in crate::packed) fn weights(&self, precision: u32) -> Vec<u32> {
        let weight = |level: u32| {
            let up = (precision << FINEST) - (level << (FINEST - self.grain)).min(precision << FINEST);
            WEIGHTS[(up & ((1 << FINEST) - 1)) as usize] << (up >> FINEST)
        };
        self.symbols.iter().map(|&(level, occurs)| if occurs { weight(level) } else { 0 }).collect()
    }

    /// Returns the table for which `counts` and the table itself take the fewest bits, and an estimate of these bits. The
    /// last count must not be 0. Only numbers of levels in `grains` are tried.
    pub(in crate::packed) fn fit(
        counts: &[u32],
        kind: Kind,
        precision: u32,
        grains: std::ops::RangeInclusive<u32>,
    ) -> (Self, f64) {
        let of = |grain| Fit::new(counts, kind, precision, grain).best();
        let all = grains.map(of).reduce(|best, next| if next.1 < best.1 { next } else { best });
        all.unwrap_or((Self { grain: 0, symbols: Vec::new() }, 0.0))
    }

    /// Returns the numbers of levels an octave that are worth trying for `counts`, as binary logarithms.
    pub(in crate::packed) fn grains(counts: &[u32]) -> std::ops::RangeInclusive<u32> {
        let used = counts.iter().filter(|&&count| count > 0).count().max(1);
        let each = counts.iter().map(|&count| u64::from(count)).sum::<u64>() / used as u64;
        let finest = match each {
            0..10 => 1,
            10..400 => 2,
            _ => FINEST,
        };
        finest - 1..=finest
    }
}

/// Returns an estimate of the bits of a difference of levels. [`OCCURS`] has estimates of the bits that say whether a
/// symbol occurs, by whether its parent occurs and whether it does.
fn delta_bits(delta: usize) -> f32 {
    let length = (usize::BITS - delta.leading_zeros()) as f32;
    if delta == 0 { 0.8 } else { 2.3 + 2.2 * (length - 1.0) }
}
const OCCURS: [[f32; 2]; 2] = [[0.5, 1.8], [3.0, 0.2]];
/// Estimate of the bits of a table that do not depend on its symbols.
const TABLE_BITS: f32 = 9.0;

/// The search for the best levels. Symbols are a tree by their parents, and the best levels below each symbol are found
/// first.
struct Fit<'a> {
    counts: &'a [u32],
    kind: Kind,
    grain: u32,
    levels: usize,
    /// For each symbol, each level, and whether the symbol occurs: the bits of the symbol and of all symbols below it.
    bits: Vec<Vec<[f32; 2]>>,
}

impl<'a> Fit<'a> {
    fn new(counts: &'a [u32], kind: Kind, precision: u32, grain: u32) -> Self {
        let levels = ((precision << grain) + 1) as usize;
        let total: f32 = counts.iter().map(|&count| count as f32).sum();
        // Probabilities are divided by the sum of all, so the probability at a level takes a part of all others.
        let part: Vec<f32> = (0..levels)
            .map(|level| {
                total * libm::exp2f(-(level as f32) / (1_u32 << grain) as f32) * std::f32::consts::LOG2_E
            })
            .collect();
        let own = |&count: &u32| -> Vec<[f32; 2]> {
            let absent = if count == 0 { 0.0 } else { f32::INFINITY };
            let bits = |level: usize| count as f32 * level as f32 / (1_u32 << grain) as f32 + part[level];
            (0..levels).map(|level| [absent, bits(level)]).collect()
        };
        let mut fit = Self { counts, kind, grain, levels, bits: counts.iter().map(own).collect() };
        for i in (1..counts.len()).rev() {
            let add: Vec<[f32; 2]> =
                (0..levels).map(|level| [0, 1].map(|there| fit.choice(i, level, there).0)).collect();
            for (bits, add) in fit.bits[kind.parent(i)].iter_mut().zip(add) {
                bits[0] += add[0];
                bits[1] += add[1];
            }
        }
        fit
    }

    /// Returns the best choice of symbol `i` and of all symbols below it, if its parent has the level `parent` and occurs
    /// if `there` is 1: the bits, the level, and whether symbol `i` occurs.
    fn choice(&self, i: usize, parent: usize, there: usize) -> (f32, usize, bool) {
        let expected = parent.saturating_sub((self.kind.gain(i) << self.grain) as usize);
        let absent = self.bits[i][expected][0] + OCCURS[there][0];
        let mut best = (absent, expected, false);
        if self.counts[i] == 0 && i + 1 == self.counts.len() {
            best.0 = f32::INFINITY;
        }
        let range = expected.saturating_sub(MOST_DELTA)..(expected + MOST_DELTA + 1).min(self.levels);
        for level in range {
            let bits = self.bits[i][level][1] + OCCURS[there][1] + delta_bits(level.abs_diff(expected));
            if bits < best.0 {
                best = (bits, level, true);
            }
        }
        best
    }

    fn best(&self) -> (LogProbabilities, f64) {
        let Some(first) = self.bits.first() else {
            return (LogProbabilities { grain: self.grain, symbols: Vec::new() }, 0.0);
        };
        let all = (0..self.levels)
            .flat_map(|level| [(first[level][0], level, false), (first[level][1], level, true)]);
        let root = all.reduce(|best, next| if next.0 < best.0 { next } else { best }).unwrap_or_default();
        let mut symbols: Vec<(u32, bool)> = vec![(root.1 as u32, root.2)];
        for i in 1..self.counts.len() {
            let (level, there) = symbols[self.kind.parent(i)];
            let (_, level, occurs) = self.choice(i, level as usize, usize::from(there));
            symbols.push((level as u32, occurs));
        }
        let total = f64::from(root.0 + TABLE_BITS + self.grain as f32)
            - self.counts.iter().map(|&count| f64::from(count)).sum::<f64>() * std::f64::consts::LOG2_E;
        (LogProbabilities { grain: self.grain, symbols }, total)
    }
}
