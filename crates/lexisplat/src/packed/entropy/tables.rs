//! Tables of probabilities: fitting to counts, writing, reading and look-up.

use serde::{Deserialize, Serialize};

use crate::packed::bitstream::broken::{BrokenHead, must};
use crate::packed::bitstream::streams::{CONTEXTS, SLOTS, Slot};
use crate::packed::entropy::adaptive_bits::{BitDecoder, BitEncoder, BitModel, Bits};
use crate::packed::entropy::log_probabilities::{LogProbabilities, MAX_SYMBOLS, TableBitModels};
use crate::packed::entropy::rans_state::Interval;

/// Estimates of the bits of a table, and of each of its symbols, for the first pass that joins contexts.
const TABLE_COST: f64 = 8.0;
const SYMBOL_COST: f64 = 1.0;
/// Number of the table of a context that is never used.
const NONE: u8 = u8::MAX;
/// Number of all contexts of all sets.
pub(in crate::packed) const ALL_CONTEXTS: usize = SLOTS * CONTEXTS;

/// Counts of the symbols of one context.
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

    /// Returns an estimate of the bits of all counted symbols, coded with their own probabilities of `precision` bits, and
    /// of their table.
    fn cost(&self, precision: u32) -> f64 {
        let total: u64 = self.counts.iter().map(|&c| u64::from(c)).sum();
        let total = total as f64;
        let mut bits = 0.0;
        for &count in self.counts.iter().filter(|&&c| c > 0) {
            // A probability is at least one unit of the precision.
            let share = (f64::from(count) / total).max(1.0 / f64::from(1_u32 << precision));
            bits -= f64::from(count) * libm::log2(share);
        }
        bits + TABLE_COST + SYMBOL_COST * self.counts.len() as f64
    }

    /// Returns a better estimate of the same bits, from a fitted table.
    fn fitted_cost(&self, precision: u32) -> f64 {
        LogProbabilities::fit(&self.counts, precision).1
    }
}

/// One table of probabilities.
#[derive(Debug, Clone)]
struct Table {
    /// The table as it is written.
    levels: LogProbabilities,
    /// The interval of each symbol. A symbol that does not occur has a share of 0.
    intervals: Vec<Interval>,
}

impl Table {
    /// Makes a table of probabilities of `precision` bits. `None` if there are no symbols or too many.
    fn new(levels: LogProbabilities, precision: u32) -> Option<Self> {
        let shares = levels.shares(precision).filter(|shares| shares.len() <= MAX_SYMBOLS)?;
        let mut start = 0;
        let intervals = shares.iter().map(|&share| {
            let interval = Interval { start, share };
            start += share;
            interval
        });
        let intervals = intervals.collect();
        Some(Self { levels, intervals })
    }
}

/// All tables of a file, and the number of the table of each context.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Tables {
    /// The number of each context's table within its set; [`NONE`] for a context that is never used.
    map: Vec<u8>,
    /// The tables of each set of contexts.
    tables: Vec<Vec<Table>>,
}

impl Tables {
    /// Makes tables for `histograms`, which has [`ALL_CONTEXTS`] entries. Contexts share a table where that costs less than
    /// two tables.
    pub(in crate::packed) fn new(histograms: &[Histogram]) -> Option<Self> {
        let mut map = Vec::with_capacity(histograms.len());
        let mut tables = Vec::new();
        for (slot, contexts) in Slot::all().zip(histograms.chunks(CONTEXTS)) {
            let precision = slot.stream.precision();
            let (joined, of) = join(contexts, precision);
            map.extend(of);
            let table = |h: &Histogram| Table::new(LogProbabilities::fit(&h.counts, precision).0, precision);
            let made: Option<Vec<Table>> = joined.iter().map(table).collect();
            tables.push(made?);
        }
        Some(Self { map, tables })
    }

    /// Returns the table of a context, by its number among all contexts.
    fn table(&self, context: usize) -> Option<&Table> {
        let table = *self.map.get(context)?;
        self.tables.get(context / CONTEXTS)?.get(usize::from(table))
    }

    /// Returns the interval of a symbol that was counted when the tables were made.
    pub(in crate::packed) fn interval(&self, context: usize, symbol: u8) -> Interval {
        self.share(context, symbol).unwrap_or(Interval { start: 0, share: 1 })
    }

    /// Returns the interval of a symbol. `None` if the symbol does not occur in the context.
    pub(in crate::packed) fn share(&self, context: usize, symbol: u8) -> Option<Interval> {
        let interval = self.table(context)?.intervals.get(usize::from(symbol))?;
        (interval.share > 0).then_some(*interval)
    }

    /// Returns the number of bits of all symbols that `histogram` counts in a context.
    pub(in crate::packed) fn bits(&self, context: usize, histogram: &Histogram) -> f64 {
        let used = (0_u8..=u8::MAX).zip(&histogram.counts).filter(|(_, count)| **count > 0);
        let precision = Slot::stream_of(context).precision();
        let cost =
            |symbol| f64::from(precision) - libm::log2(f64::from(self.interval(context, symbol).share));
        used.map(|(symbol, &count)| f64::from(count) * cost(symbol)).sum()
    }

    /// Returns the bytes of the numbers of tables of contexts, and of the tables.
    pub(in crate::packed) fn write(&self) -> Vec<u8> {
        let mut encoder = BitEncoder::default();
        // Tables that were made or read can always be coded.
        let _ = self.code(&mut encoder);
        encoder.finish()
    }

    /// Reads the bytes that [`Self::write`] wrote.
    ///
    /// # Errors
    /// The broken rule for bytes that are not the bits of tables, or not of these alone.
    pub(in crate::packed) fn read(bytes: &[u8]) -> Result<Self, BrokenHead> {
        let mut decoder = BitDecoder::new(bytes);
        let read = Self { map: Vec::new(), tables: Vec::new() }.code(&mut decoder)?;
        decoder.finish("the tables")?;
        Ok(read)
    }

    /// Codes the numbers of tables of contexts, and the tables. A decoder codes empty ones and gets the decoded ones.
    fn code(&self, bits: &mut dyn Bits) -> Result<Self, BrokenHead> {
        let mut models = TablesModels::default();
        let mut all = Self { map: Vec::with_capacity(ALL_CONTEXTS), tables: Vec::with_capacity(SLOTS) };
        let mut before = false;
        for slot in Slot::all() {
            let own = self.tables.get(slot.number).map_or(&[][..], Vec::as_slice);
            before = bits.bit(&mut models.used[usize::from(before)], !own.is_empty());
            let mut count = usize::from(before);
            if !before || !bits.bit(&mut models.many, own.len() > 1) {
                all.map.extend([0; CONTEXTS]);
            } else {
                let mut last = 0;
                all.map.push(0);
                for context in 1..CONTEXTS {
                    let wanted = self.map.get(slot.number * CONTEXTS + context).copied().unwrap_or(NONE);
                    // A context that is never used has the table of the context before.
                    let wanted = if wanted == NONE { last } else { usize::from(wanted) };
                    let same = &mut models.same[usize::from(all.map.len() % CONTEXTS > 1 && models.changed)];
                    models.changed = bits.bit(same, wanted != last);
                    if models.changed {
                        last = match bits.bit(&mut models.new, wanted == count) {
                            true => count,
                            false => {
                                let width = usize::BITS - (count - 1).leading_zeros();
                                let table = bits.even(width, wanted as u32) as usize;
                                must(table < count, || {
                                    format!("the tables: a context has table {table} of {count}")
                                })?;
                                table
                            }
                        };
                        count = count.max(last + 1);
                    }
                    all.map.push(u8::try_from(last).unwrap_or(NONE));
                }
            }
            let precision = slot.stream.precision();
            let mut tables = Vec::with_capacity(count);
            for k in 0..count {
                let none = LogProbabilities::default();
                let levels = own.get(k).map_or(&none, |table| &table.levels);
                let levels = levels.code(bits, &mut models.levels, precision)?;
                let no_symbols = || BrokenHead("the tables: a table has no symbols".to_owned());
                tables.push(Table::new(levels, precision).ok_or_else(no_symbols)?);
            }
            all.tables.push(tables);
        }
        Ok(all)
    }
}

/// The adaptive probabilities of the bits of [`Tables`].
#[derive(Debug, Default)]
struct TablesModels {
    /// Whether a set of contexts is used, by whether the set before is.
    used: [BitModel; 2],
    /// Whether a set has several tables.
    many: BitModel,
    /// Whether a context has another table than the context before, by whether that context had.
    same: [BitModel; 2],
    changed: bool,
    /// Whether the other table is one that no earlier context of the set has.
    new: BitModel,
    levels: TableBitModels,
}

/// A group of contexts that share a table.
struct Group {
    histogram: Histogram,
    /// The numbers of the contexts, in rising order.
    members: Vec<usize>,
    cost: f64,
}

/// Joins contexts until no shared table costs less than two. Returns the histograms of the tables in the order of their
/// first contexts, and for each context the number of its histogram. Probabilities have `precision` bits.
fn join(contexts: &[Histogram], precision: u32) -> (Vec<Histogram>, Vec<u8>) {
    let group = |context: usize| Group {
        histogram: contexts[context].clone(),
        members: vec![context],
        cost: contexts[context].cost(precision),
    };
    let used = (0..contexts.len()).filter(|&context| !contexts[context].counts.is_empty());
    let mut groups: Vec<Group> = used.map(group).collect();
    join_groups(&mut groups, |histogram| histogram.cost(precision));
    for group in &mut groups {
        group.cost = group.histogram.fitted_cost(precision);
    }
    join_groups(&mut groups, |histogram| histogram.fitted_cost(precision));
    groups.sort_by_key(|group| group.members.first().copied());
    let mut map = vec![NONE; contexts.len()];
    for (number, group) in (0..).zip(&groups) {
        for &context in &group.members {
            map[context] = number;
        }
    }
    (groups.into_iter().map(|group| group.histogram).collect(), map)
}

/// Joins the two groups whose shared table saves most, until none saves bits.
fn join_groups(groups: &mut Vec<Group>, cost: impl Fn(&Histogram) -> f64) {
    let joined = |a: &Group, b: &Group| {
        let mut sum = a.histogram.clone();
        sum.merge(&b.histogram);
        cost(&sum)
    };
    // The cost of each pair of groups, the second of which comes after the first.
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

/// Largest number of bits of a probability.
const MOST_PRECISION: u32 = 12;
/// Number of entries of a set: at least one for each context. It is a power of two, so that a masked number is a valid
/// index.
const SET_SLOTS: usize = CONTEXTS.next_power_of_two();
/// The context of lanes that take no symbol. They get 0, and their states do not change.
pub(in crate::packed) const IDLE: u32 = CONTEXTS as u32;

/// The tables in the form in which a decoder looks symbols up. For each value of a state's low bits there is an entry: the
/// symbol, its share less 1, and the distance of the value from the start of the symbol.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Lookup {
    /// The start of the table of each context in `entries`, set by set.
    sets: Vec<[u32; SET_SLOTS]>,
    entries: Vec<Entry>,
}

impl Lookup {
    pub(in crate::packed) fn new(tables: &Tables) -> Self {
        let entry =
            |symbol: u32, share: u32, over: u32| symbol | (share - 1) << 8 | over << (8 + MOST_PRECISION);
        // The first table stands for missing ones. Its symbols take bits, so that states stay within limits.
        let mut entries: Vec<u32> = (0..1 << MOST_PRECISION).map(|_| entry(0, 1, 0)).collect();
        // With the tables that follow, states do not change.
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
                for (symbol, interval) in (0_u32..).zip(&table.intervals) {
                    entries.extend((0..interval.share).map(|over| entry(symbol, interval.share, over)));
                }
            }
            let mut set = [idle[slot.stream.precision() as usize]; SET_SLOTS];
            let mut last = 0;
            for (start, &table) in set.iter_mut().zip(map) {
                // A context that is never used has the table of the context before, as in the written form.
                last = if table == NONE { last } else { usize::from(table) };
                *start = starts.get(last).copied().unwrap_or(0);
            }
            sets.push(set);
        }
        Self { sets, entries }
    }

    /// Returns the tables of a set of contexts; `None` if the set has none.
    #[inline(always)]
    pub(in crate::packed) fn set(&self, number: usize) -> Option<Set<'_>> {
        let starts = self.sets.get(number)?;
        (starts[0] != 0).then_some(Set { starts, entries: &self.entries })
    }
}

/// The tables of a set of contexts.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Set<'l> {
    starts: &'l [u32; SET_SLOTS],
    entries: &'l [Entry],
}

/// The entry of a table for one value of a state's low bits.
pub(in crate::packed) type Entry = u32;

impl Set<'_> {
    /// Returns the entry for `low` in the table of `context`, which is below [`CONTEXTS`] or is [`IDLE`].
    #[inline(always)]
    pub(in crate::packed) fn entry(&self, context: u32, low: u32) -> Entry {
        let start = self.starts[context as usize % SET_SLOTS];
        self.entries.get((start + low) as usize).copied().unwrap_or(0)
    }
}

/// Returns the symbol of an entry.
#[inline(always)]
pub(in crate::packed) fn symbol(entry: Entry) -> u32 {
    entry & 0xff
}

/// Returns the share of an entry's symbol, less 1.
#[inline(always)]
pub(in crate::packed) fn less_share(entry: Entry) -> u32 {
    entry >> 8 & ((1 << MOST_PRECISION) - 1)
}

/// Returns the distance of the low bits from the start of the entry's symbol.
#[inline(always)]
pub(in crate::packed) fn over(entry: Entry) -> u32 {
    entry >> (8 + MOST_PRECISION)
}

const _: () = assert!((IDLE as usize) < SET_SLOTS);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    /// Returns histograms of values that become rarer with their size. Each context has its own.
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
                    let interval = tables.interval(context, symbol);
                    assert!(interval.share > 0 && interval.start + interval.share <= whole);
                    assert_eq!(read.interval(context, symbol), interval, "{context} {symbol}");
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
        assert!(Tables::read(&[&bytes[..], &[0]].concat()).is_err());
        assert!(Tables::read(&[&bytes[..], &[1]].concat()).is_err());
        assert!(Tables::read(&[0xff; 300]).is_err());
        assert!(Tables::read(&[&bytes[..], &[0, 0]].concat()).is_err());
        assert!(Tables::read(&bytes[..bytes.len() - 2]).is_err());
        let mut rng = SplitMix64::new(5);
        for _ in 0..200 {
            let mut damaged = bytes.clone();
            damaged[rng.below(bytes.len())] ^= 1 << rng.below(8);
            // If damaged bytes are accepted, they are other tables. A context may name its table in two ways.
            if let Ok(tables) = Tables::read(&damaged) {
                let written = tables.write();
                assert!(
                    written != bytes && Tables::read(&written).is_ok_and(|again| again.write() == written)
                );
            }
        }
    }
}
