//! Tables of probabilities: made of counts, written, read, looked up.

use serde::{Deserialize, Serialize};

use crate::packed::bitstream::streams::{CONTEXTS, SLOTS, Slot};
use crate::packed::entropy::adaptive_bits::{BitDecoder, BitEncoder, BitModel, Bits};
use crate::packed::entropy::log_probabilities::{Kind, LevelBitModels, LogProbabilities, MAX_SYMBOLS};

/// About the bits of a table and of each of its symbols, by which contexts are joined first.
const TABLE_COST: f64 = 8.0;
const SYMBOL_COST: f64 = 1.0;
/// Levels an octave, as a binary logarithm, at which joined tables are compared.
const JOINING_GRAIN: u32 = 1;
/// The table of contexts that are never used.
const NONE: u8 = u8::MAX;
/// Number of all contexts.
pub(in crate::packed) const ALL_CONTEXTS: usize = SLOTS * CONTEXTS;

/// How often each symbol occurs in one context.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(in crate::packed) struct Histogram {
    counts: Vec<u32>,
}

impl Histogram {
    pub(in crate::packed) fn add(&mut self, symbol: u8) {
        let symbol = usize::from(symbol);
        if symbol >= self.counts.len() {
            self.counts.resize(symbol + 1, 0);
        }
        self.counts[symbol] += 1;
    }

    pub(in crate::packed) fn merge(&mut self, other: &Self) {
        if other.counts.len() > self.counts.len() {
            self.counts.resize(other.counts.len(), 0);
        }
        for (a, b) in self.counts.iter_mut().zip(&other.counts) {
            *a = a.saturating_add(*b);
        }
    }

    /// About the bits of all its symbols when coded with its own probabilities of `precision` bits, and of its table.
    fn cost(&self, precision: u32) -> f64 {
        let total: u64 = self.counts.iter().map(|&c| u64::from(c)).sum();
        let total = total as f64;
        let mut bits = 0.0;
        for &count in self.counts.iter().filter(|&&c| c > 0) {
            // A probability is at least one unit of precision.
            let share = (f64::from(count) / total).max(1.0 / f64::from(1_u32 << precision));
            bits -= f64::from(count) * libm::log2(share);
        }
        bits + TABLE_COST + SYMBOL_COST * self.counts.len() as f64
    }

    /// The same, more exactly.
    fn fitted_cost(&self, kind: Kind, precision: u32) -> f64 {
        LogProbabilities::fit(&self.counts, kind, precision, JOINING_GRAIN..=JOINING_GRAIN).1
    }
}

/// Where a symbol's share of the states lies.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::packed) struct Model {
    pub(in crate::packed) start: u32,
    pub(in crate::packed) share: u32,
}

/// One table.
#[derive(Debug, Clone)]
struct Table {
    /// What is written.
    levels: LogProbabilities,
    /// Of each symbol; symbols that do not occur have no share.
    models: Vec<Model>,
}

impl Table {
    /// A table of probabilities of `precision` bits; `None` if there are no symbols or too many.
    fn new(levels: LogProbabilities, precision: u32) -> Option<Self> {
        let whole = 1_u32 << precision;
        let weights = levels.weights(precision);
        // Weights are below 2^19, so the total is below 2^27, and a product with the whole below 2^31.
        let total: u32 = weights.iter().sum();
        if total == 0 || weights.len() > MAX_SYMBOLS {
            return None;
        }
        let share = |&weight: &u32| {
            if weight == 0 { 0 } else { i64::from((weight * whole / total).max(1)) }
        };
        let mut shares: Vec<i64> = weights.iter().map(share).collect();
        // The difference that rounding leaves goes to the most frequent symbols, where it costs least.
        let mut left = i64::from(whole) - shares.iter().sum::<i64>();
        while left != 0 {
            let most = (0..shares.len()).max_by_key(|&k| (shares[k], std::cmp::Reverse(k)))?;
            let change = if left > 0 { left } else { left.max(-(shares[most] / 2)) };
            shares[most] += change;
            left -= change;
        }
        let mut start = 0;
        let models = shares.iter().map(|&share| {
            let model = Model { start, share: u32::try_from(share).unwrap_or(0) };
            start += model.share;
            model
        });
        let models = models.collect();
        Some(Self { levels, models })
    }
}

/// All tables of a file, and the table of each context of each stream.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Tables {
    /// The table of every context, set by set; [`NONE`] for contexts that are never used.
    map: Vec<u8>,
    /// The tables of each set of contexts.
    tables: Vec<Vec<Table>>,
}

impl Tables {
    /// Joins contexts where a shared table costs less than two. `histograms` has [`ALL_CONTEXTS`] entries.
    pub(in crate::packed) fn new(histograms: &[Histogram]) -> Option<Self> {
        let mut map = Vec::with_capacity(histograms.len());
        let mut tables = Vec::new();
        for (slot, contexts) in Slot::all().zip(histograms.chunks(CONTEXTS)) {
            let (kind, precision) = (Kind::of(slot.stream), slot.stream.precision());
            let (joined, of) = join(contexts, kind, precision);
            map.extend(of);
            let table = |h: &Histogram| {
                Table::new(
                    LogProbabilities::fit(&h.counts, kind, precision, LogProbabilities::grains(&h.counts)).0,
                    precision,
                )
            };
            let made: Option<Vec<Table>> = joined.iter().map(table).collect();
            tables.push(made?);
        }
        Some(Self { map, tables })
    }

    /// The table of a context, counted over all streams.
    fn table(&self, context: usize) -> Option<&Table> {
        let table = *self.map.get(context)?;
        self.tables.get(context / CONTEXTS)?.get(usize::from(table))
    }

    /// The model of a symbol, which was counted when the tables were made.
    pub(in crate::packed) fn model(&self, context: usize, symbol: u8) -> Model {
        self.share(context, symbol).unwrap_or(Model { start: 0, share: 1 })
    }

    /// The same, if the symbol has a share in the context.
    pub(in crate::packed) fn share(&self, context: usize, symbol: u8) -> Option<Model> {
        let model = self.table(context)?.models.get(usize::from(symbol))?;
        (model.share > 0).then_some(*model)
    }

    /// Bits of all symbols counted in `histogram` of a context.
    pub(in crate::packed) fn bits(&self, context: usize, histogram: &Histogram) -> f64 {
        let used = (0_u8..=u8::MAX).zip(&histogram.counts).filter(|(_, count)| **count > 0);
        let precision = Slot::stream_of(context).precision();
        let cost = |symbol| f64::from(precision) - libm::log2(f64::from(self.model(context, symbol).share));
        used.map(|(symbol, &count)| f64::from(count) * cost(symbol)).sum()
    }

    /// Writes map and tables.
    pub(in crate::packed) fn write(&self) -> Vec<u8> {
        let mut encoder = BitEncoder::default();
        // What was made or read can be coded.
        let _ = self.code(&mut encoder);
        encoder.finish()
    }

    /// Reads what [`Self::write`] wrote; `None` for anything else.
    pub(in crate::packed) fn read(bytes: &[u8]) -> Option<Self> {
        let mut decoder = BitDecoder::new(bytes);
        let read = Self { map: Vec::new(), tables: Vec::new() }.code(&mut decoder)?;
        (read.write() == bytes).then_some(read)
    }

    /// Codes map and tables. The decoder gives empty ones.
    fn code(&self, bits: &mut dyn Bits) -> Option<Self> {
        let mut odds = TablesOdds::default();
        let mut all = Self { map: Vec::with_capacity(ALL_CONTEXTS), tables: Vec::with_capacity(SLOTS) };
        let mut before = false;
        for slot in Slot::all() {
            let own = self.tables.get(slot.number).map_or(&[][..], Vec::as_slice);
            before = bits.bit(&mut odds.used[usize::from(before)], !own.is_empty());
            let mut count = usize::from(before);
            if !before || !bits.bit(&mut odds.many, own.len() > 1) {
                all.map.extend([0; CONTEXTS]);
            } else {
                let mut last = 0;
                all.map.push(0);
                for context in 1..CONTEXTS {
                    let wanted = self.map.get(slot.number * CONTEXTS + context).copied().unwrap_or(NONE);
                    // A context that is not used has the table of the one before.
                    let wanted = if wanted == NONE { last } else { usize::from(wanted) };
                    let same = &mut odds.same[usize::from(all.map.len() % CONTEXTS > 1 && odds.changed)];
                    odds.changed = bits.bit(same, wanted != last);
                    if odds.changed {
                        last = match bits.bit(&mut odds.new, wanted == count) {
                            true => count,
                            false => {
                                let width = usize::BITS - (count - 1).leading_zeros();
                                Some(bits.even(width, wanted as u32) as usize)
                                    .filter(|&table| table < count)?
                            }
                        };
                        count = count.max(last + 1);
                    }
                    all.map.push(u8::try_from(last).ok()?);
                }
            }
            let (kind, precision) = (Kind::of(slot.stream), slot.stream.precision());
            let mut tables = Vec::with_capacity(count);
            for k in 0..count {
                let none = LogProbabilities::default();
                let levels = own.get(k).map_or(&none, |table| &table.levels);
                tables.push(Table::new(levels.code(bits, &mut odds.levels, kind, precision)?, precision)?);
            }
            all.tables.push(tables);
        }
        Some(all)
    }
}

/// The odds of what maps and tables consist of.
#[derive(Debug, Default)]
struct TablesOdds {
    /// Whether a stream is used, where the one before is not and is.
    used: [BitModel; 2],
    /// Whether it has several tables.
    many: BitModel,
    /// Whether a context has another table than the one before, where that one had not and had.
    same: [BitModel; 2],
    changed: bool,
    /// Whether that table is new.
    new: BitModel,
    levels: LevelBitModels,
}

/// Contexts that share a table.
struct Group {
    histogram: Histogram,
    /// In rising order.
    members: Vec<usize>,
    cost: f64,
}

/// Joins contexts until no two tables gain by being one. Returns the joined histograms in the order of their first
/// contexts, and for each context the number of its histogram among them. Probabilities have `precision` bits.
fn join(contexts: &[Histogram], kind: Kind, precision: u32) -> (Vec<Histogram>, Vec<u8>) {
    let group = |context: usize| Group {
        histogram: contexts[context].clone(),
        members: vec![context],
        cost: contexts[context].cost(precision),
    };
    let used = (0..contexts.len()).filter(|&context| !contexts[context].counts.is_empty());
    let mut groups: Vec<Group> = used.map(group).collect();
    join_groups(&mut groups, |histogram| histogram.cost(precision));
    for group in &mut groups {
        group.cost = group.histogram.fitted_cost(kind, precision);
    }
    join_groups(&mut groups, |histogram| histogram.fitted_cost(kind, precision));
    groups.sort_by_key(|group| group.members.first().copied());
    let mut map = vec![NONE; contexts.len()];
    for (number, group) in (0..).zip(&groups) {
        for &context in &group.members {
            map[context] = number;
        }
    }
    (groups.into_iter().map(|group| group.histogram).collect(), map)
}

/// Joins the two groups that gain most until none gain.
fn join_groups(groups: &mut Vec<Group>, cost: impl Fn(&Histogram) -> f64) {
    let joined = |a: &Group, b: &Group| {
        let mut sum = a.histogram.clone();
        sum.merge(&b.histogram);
        cost(&sum)
    };
    // The cost of each pair, of which the second comes after the first.
    let mut costs: Vec<Vec<f64>> = (0..groups.len())
        .map(|i| (i + 1..groups.len()).map(|j| joined(&groups[i], &groups[j])).collect())
        .collect();
    loop {
        let (mut best, mut gain) = (None, 0.0);
        for (i, row) in costs.iter().enumerate() {
            for (j, cost) in (i + 1..).zip(row) {
                let saved = groups[i].cost + groups[j].cost - cost;
                if saved > gain {
                    (best, gain) = (Some((i, j)), saved);
                }
            }
        }
        let Some((i, j)) = best else { return };
        groups[i].cost = costs[i][j - i - 1];
        let Group { histogram, members, .. } = groups.remove(j);
        groups[i].histogram.merge(&histogram);
        groups[i].members.extend(members);
        groups[i].members.sort_unstable();
        costs.remove(j);
        for (k, row) in costs.iter_mut().enumerate().take(j) {
            row.remove(j - k - 1);
        }
        for k in 0..groups.len() {
            let (a, b) = (k.min(i), k.max(i));
            if a < b {
                costs[a][b - a - 1] = joined(&groups[a], &groups[b]);
            }
        }
    }
}

/// Most bits of a probability.
const MOST_PRECISION: u32 = 12;
/// Places of the contexts of a set. It is a power of two, so that a masked number is one of them.
const PLACES: usize = CONTEXTS.next_power_of_two();
/// The context of lanes that take no symbol. They get 0, and their states stay.
pub(in crate::packed) const IDLE: u32 = CONTEXTS as u32;

/// The tables as a decoder looks symbols up: for each value of a state's low bits the symbol, its share less 1, and how
/// far the value lies above the symbol's start.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Lookup {
    /// Where the table of each context starts in `entries`, set by set.
    sets: Vec<[u32; PLACES]>,
    entries: Vec<Entry>,
}

impl Lookup {
    pub(in crate::packed) fn new(tables: &Tables) -> Self {
        let entry =
            |symbol: u32, share: u32, over: u32| symbol | (share - 1) << 8 | over << (8 + MOST_PRECISION);
        // The first table stands for those that are missing. Its symbols take bits, so that states stay within limits.
        let mut entries: Vec<u32> = (0..1 << MOST_PRECISION).map(|_| entry(0, 1, 0)).collect();
        // With the next ones states stay as they are.
        let mut idle = [0; MOST_PRECISION as usize + 1];
        for slot in Slot::all() {
            let precision = slot.stream.precision();
            let start = &mut idle[precision as usize];
            if *start == 0 {
                *start = entries.len() as u32;
                entries.extend((0..1 << precision).map(|over| entry(0, 1 << precision, over)));
            }
        }
        let mut sets = Vec::with_capacity(tables.tables.len());
        for ((slot, map), of_slot) in Slot::all().zip(tables.map.chunks(CONTEXTS)).zip(&tables.tables) {
            let mut starts = Vec::with_capacity(of_slot.len());
            for table in of_slot {
                starts.push(entries.len() as u32);
                for (symbol, model) in (0_u32..).zip(&table.models) {
                    entries.extend((0..model.share).map(|over| entry(symbol, model.share, over)));
                }
            }
            let mut set = [idle[slot.stream.precision() as usize]; PLACES];
            let mut last = 0;
            for (start, &table) in set.iter_mut().zip(map) {
                // A context that is not used has the table of the one before, as it is written.
                last = if table == NONE { last } else { usize::from(table) };
                *start = starts.get(last).copied().unwrap_or(0);
            }
            sets.push(set);
        }
        Self { sets, entries }
    }

    /// The tables of a set of contexts; `None` if there are none.
    #[inline(always)]
    pub(in crate::packed) fn set(&self, number: usize) -> Option<Set<'_>> {
        let starts = self.sets.get(number)?;
        (starts[0] != 0).then_some(Set { starts, entries: &self.entries })
    }
}

/// The tables of a set of contexts.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Set<'l> {
    starts: &'l [u32; PLACES],
    entries: &'l [Entry],
}

/// What a table says of a state's low bits.
pub(in crate::packed) type Entry = u32;

impl Set<'_> {
    /// What the table of `context`, which is below [`CONTEXTS`] or [`IDLE`], says of `low`.
    #[inline(always)]
    pub(in crate::packed) fn entry(&self, context: u32, low: u32) -> Entry {
        let start = self.starts[context as usize % PLACES];
        self.entries.get((start + low) as usize).copied().unwrap_or(0)
    }
}

/// The symbol.
#[inline(always)]
pub(in crate::packed) fn symbol(entry: Entry) -> u32 {
    entry & 0xff
}

/// Its share less 1.
#[inline(always)]
pub(in crate::packed) fn less_share(entry: Entry) -> u32 {
    entry >> 8 & ((1 << MOST_PRECISION) - 1)
}

/// How far the low bits lie above its start.
#[inline(always)]
pub(in crate::packed) fn over(entry: Entry) -> u32 {
    entry >> (8 + MOST_PRECISION)
}

const _: () = assert!((IDLE as usize) < PLACES);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    /// Histograms of values that get rarer with their size, of which each context has its own.
    fn histograms(symbols: u32) -> Vec<Histogram> {
        let mut rng = SplitMix64::new(11);
        let mut all = vec![Histogram::default(); ALL_CONTEXTS];
        for (context, histogram) in all.iter_mut().enumerate().filter(|(context, _)| context % 3 != 1) {
            for _ in 0..symbols >> (context % 5) {
                let zeros = (rng.next() | 1 << 30).trailing_zeros();
                histogram.add((zeros * 2 + (rng.next() & 1) as u32 + (context % 7) as u32) as u8);
            }
        }
        all
    }

    #[test]
    fn tables_come_back_and_code_all_symbols() {
        for symbols in [16, 90, 5000] {
            let counted = histograms(symbols);
            let tables = Tables::new(&counted).unwrap();
            let bytes = tables.write();
            let read = Tables::read(&bytes).unwrap();
            let (mut bits, mut entropy, mut used) = (0.0, 0.0, 0);
            for (context, histogram) in counted.iter().enumerate() {
                let whole = 1_u32 << Slot::stream_of(context).precision();
                for (symbol, _) in (0..).zip(&histogram.counts).filter(|(_, count)| **count > 0) {
                    let model = tables.model(context, symbol);
                    assert!(model.share > 0 && model.start + model.share <= whole);
                    assert_eq!(read.model(context, symbol), model, "{context} {symbol}");
                }
                let total: u32 = histogram.counts.iter().sum();
                let ideal = |count: u32| f64::from(count) * libm::log2(f64::from(total) / f64::from(count));
                entropy += histogram
                    .counts
                    .iter()
                    .filter(|&&count| count > 0)
                    .map(|&count| ideal(count))
                    .sum::<f64>();
                bits += tables.bits(context, histogram);
                used += usize::from(total > 0);
            }
            let bits = bits + 8.0 * bytes.len() as f64;
            assert!(bits < 1.05 * entropy + 40.0 * used as f64, "{bits} {entropy} {used}");
        }
    }

    #[test]
    fn no_other_bytes_are_tables() {
        let bytes = Tables::new(&histograms(90)).unwrap().write();
        assert!(Tables::read(&[&bytes[..], &[0]].concat()).is_none());
        assert!(Tables::read(&[&bytes[..], &[1]].concat()).is_none());
        assert!(Tables::read(&[0xff; 300]).is_none());
        let mut rng = SplitMix64::new(5);
        for _ in 0..200 {
            let mut damaged = bytes.clone();
            damaged[rng.below(bytes.len())] ^= 1 << rng.below(8);
            // What is read of damage is what those bytes are written for.
            assert!(Tables::read(&damaged).is_none_or(|tables| tables.write() == damaged));
        }
    }
}
