//! Tables of probabilities: made of counts, written, read, looked up.

use super::streams::{CONTEXTS, SLOTS, Slot};
use crate::packed::bits::{BitReader, BitWriter};

/// Bits of a symbol count and of a bit length in a written table.
const SYMBOLS_BITS: u32 = 9;
const LENGTH_BITS: u32 = 4;
/// Bits kept of a frequency after its leading one.
const MANTISSA_BITS: u32 = 3;
/// Bits of a table's number in the map of contexts.
const TABLE_BITS: u32 = 5;
/// About the bits of a symbol in a table: its length and its mantissa.
const SYMBOL_COST: f64 = 6.5;
/// Largest number of symbols of a table.
const MAX_SYMBOLS: usize = 256;
/// The table of contexts that are never used.
const NONE: u8 = u8::MAX;
/// Number of all contexts.
pub(in crate::packed) const ALL_CONTEXTS: usize = SLOTS * CONTEXTS;

/// How often each symbol occurs in one context.
#[derive(Debug, Clone, Default)]
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
            *a += b;
        }
    }

    /// Bits of all its symbols when coded with its own probabilities of `precision` bits, and of its table.
    fn cost(&self, precision: u32) -> f64 {
        let total: u64 = self.counts.iter().map(|&c| u64::from(c)).sum();
        let total = total as f64;
        let mut bits = 0.0;
        let mut used = 0;
        for &count in self.counts.iter().filter(|&&c| c > 0) {
            // A probability is at least one unit of precision.
            let share = (f64::from(count) / total).max(1.0 / f64::from(1_u32 << precision));
            bits -= f64::from(count) * libm::log2(share);
            used += 1;
        }
        let gaps = self.counts.len() - used;
        bits + f64::from(SYMBOLS_BITS) + SYMBOL_COST * used as f64 + f64::from(LENGTH_BITS) * gaps as f64
    }

    /// Counts rounded to those that a table can hold.
    fn rounded(&self) -> Vec<u32> {
        let largest = self.counts.iter().copied().max().unwrap_or(0).max(1);
        let round = |count: u32| {
            if count == 0 {
                return 0;
            }
            // As 14-bit numbers, so that every length fits its field.
            let scaled = (u64::from(count) * ((1 << 14) - 1) / u64::from(largest)).max(1);
            let length = u64::BITS - scaled.leading_zeros();
            let drop = length.saturating_sub(MANTISSA_BITS + 1);
            u32::try_from(scaled >> drop << drop).unwrap_or(1)
        };
        self.counts.iter().map(|&c| round(c)).collect()
    }
}

/// Where a symbol's share of the states lies.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Model {
    pub(super) start: u32,
    pub(super) share: u32,
}

/// One table.
#[derive(Debug, Clone)]
struct Table {
    /// What is written.
    counts: Vec<u32>,
    /// Of each symbol; symbols that do not occur have no share.
    models: Vec<Model>,
}

impl Table {
    /// A table of probabilities of `precision` bits from counts; `None` if they are all zero or too many.
    fn new(counts: &[u32], precision: u32) -> Option<Self> {
        let whole = 1_u32 << precision;
        let total: u64 = counts.iter().map(|&c| u64::from(c)).sum();
        if total == 0 || counts.len() > MAX_SYMBOLS {
            return None;
        }
        let share = |&c: &u32| {
            if c == 0 { 0 } else { (u64::from(c) * u64::from(whole) / total).max(1).cast_signed() }
        };
        let mut shares: Vec<i64> = counts.iter().map(share).collect();
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
        Some(Self { counts: counts.to_vec(), models })
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
            let precision = slot.stream.precision();
            let (joined, of) = join(contexts, precision);
            map.extend(of);
            let table = |h: &Histogram| Table::new(&h.rounded(), precision);
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
    pub(super) fn model(&self, context: usize, symbol: u8) -> Model {
        let model = self.table(context).and_then(|table| table.models.get(usize::from(symbol)));
        model.copied().filter(|m| m.share > 0).unwrap_or(Model { start: 0, share: 1 })
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
        let mut out = BitWriter::default();
        for (tables, map) in self.tables.iter().zip(self.map.chunks(CONTEXTS)) {
            out.put(TABLE_BITS, tables.len() as u64);
            if tables.len() > 1 {
                let mut last = 0;
                for &table in map {
                    // An unused context shares its neighbour's table.
                    let table = if table == NONE { last } else { table };
                    out.put(1, u64::from(table != last));
                    if table != last {
                        out.put(TABLE_BITS, u64::from(table));
                    }
                    last = table;
                }
            }
            for counts in tables.iter().map(|t| &t.counts) {
                out.put(SYMBOLS_BITS, counts.len() as u64);
                for &count in counts {
                    let length = u32::BITS - count.leading_zeros();
                    out.put(LENGTH_BITS, u64::from(length));
                    let kept = length.saturating_sub(1).min(MANTISSA_BITS);
                    let drop = length.saturating_sub(1) - kept;
                    out.put(kept, u64::from(count >> drop) & ((1 << kept) - 1));
                }
            }
        }
        out.finish()
    }

    /// Reads what [`Self::write`] wrote; `None` for anything else.
    pub(in crate::packed) fn read(bytes: &[u8]) -> Option<Self> {
        let mut bits = BitReader::new(bytes);
        let mut map = Vec::with_capacity(ALL_CONTEXTS);
        let mut tables = Vec::with_capacity(SLOTS);
        for slot in Slot::all() {
            let count = bits.take(TABLE_BITS);
            let mut last = 0_u8;
            for _ in 0..CONTEXTS {
                if count > 1 && bits.take(1) == 1 {
                    last = u8::try_from(bits.take(TABLE_BITS)).ok()?;
                }
                map.push(last);
            }
            let mut made = Vec::new();
            for _ in 0..count {
                let symbols = usize::try_from(bits.take(SYMBOLS_BITS)).ok()?;
                if symbols > MAX_SYMBOLS || bits.overrun() {
                    return None;
                }
                let mut counts = Vec::with_capacity(symbols);
                for _ in 0..symbols {
                    let length = u32::try_from(bits.take(LENGTH_BITS)).ok()?;
                    let kept = length.saturating_sub(1).min(MANTISSA_BITS);
                    let mantissa = u32::try_from(bits.take(kept)).ok()?;
                    let drop = length.saturating_sub(1) - kept;
                    counts.push(if length == 0 { 0 } else { ((1 << kept) | mantissa) << drop });
                }
                made.push(Table::new(&counts, slot.stream.precision())?);
            }
            tables.push(made);
        }
        bits.exhausted().then_some(Self { map, tables })
    }
}

/// Joins the two histograms that gain most by sharing a table until none gains. Returns the joined histograms, and for
/// each context the number of its histogram among them. Probabilities have `precision` bits.
fn join(contexts: &[Histogram], precision: u32) -> (Vec<Histogram>, Vec<u8>) {
    let mut groups: Vec<(Histogram, Vec<usize>, f64)> = (0..contexts.len())
        .filter(|&c| !contexts[c].counts.is_empty())
        .map(|c| (contexts[c].clone(), vec![c], contexts[c].cost(precision)))
        .collect();
    let joined = |a: &Histogram, b: &Histogram| {
        let mut sum = a.clone();
        sum.merge(b);
        sum
    };
    loop {
        let mut best = None;
        let mut gain = 0.0;
        for i in 0..groups.len() {
            for j in i + 1..groups.len() {
                let cost = joined(&groups[i].0, &groups[j].0).cost(precision);
                let saved = groups[i].2 + groups[j].2 - cost;
                if saved > gain {
                    (best, gain) = (Some((i, j, cost)), saved);
                }
            }
        }
        let Some((i, j, cost)) = best else { break };
        let (histogram, members, _) = groups.remove(j);
        groups[i].0.merge(&histogram);
        groups[i].1.extend(members);
        groups[i].2 = cost;
    }
    let mut map = vec![NONE; contexts.len()];
    for (number, group) in (0..).zip(&groups) {
        for &context in &group.1 {
            map[context] = number;
        }
    }
    (groups.into_iter().map(|g| g.0).collect(), map)
}

/// Most bits of a probability.
const MOST_PRECISION: u32 = 12;

/// The tables as a decoder looks symbols up: for each value of a state's low bits the symbol, its share less 1, and how
/// far the value lies above the symbol's start.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Lookup {
    /// Where the table of each context starts in `entries`.
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Lookup {
    pub(in crate::packed) fn new(tables: &Tables) -> Self {
        let entry =
            |symbol: u32, share: u32, over: u32| symbol | (share - 1) << 8 | over << (8 + MOST_PRECISION);
        // The first table stands for those that are missing. Its symbols take bits, so that states stay within limits.
        let mut entries: Vec<u32> = (0..1 << MOST_PRECISION).map(|_| entry(0, 1, 0)).collect();
        let mut starts_of = Vec::with_capacity(tables.tables.len());
        for stream in &tables.tables {
            let mut starts = Vec::with_capacity(stream.len());
            for table in stream {
                starts.push(entries.len() as u32);
                for (symbol, model) in (0_u32..).zip(&table.models) {
                    entries.extend((0..model.share).map(|over| entry(symbol, model.share, over)));
                }
            }
            starts_of.push(starts);
        }
        let start = |(context, &table): (usize, &u8)| {
            let starts = starts_of.get(context / CONTEXTS).and_then(|starts| starts.get(usize::from(table)));
            starts.copied().unwrap_or(0)
        };
        Self { starts: tables.map.iter().enumerate().map(start).collect(), entries }
    }

    /// Where the table of a context starts; 0 if it is missing.
    #[inline(always)]
    pub(super) fn start(&self, context: usize) -> u32 {
        self.starts.get(context).copied().unwrap_or(0)
    }

    /// The symbol, its share, and how far `low` lies above its start, by the table that starts at `start`.
    #[inline(always)]
    pub(super) fn entry(&self, start: u32, low: u32) -> (u32, u32, u32) {
        let entry = self.entries.get((start + low) as usize).copied().unwrap_or(0);
        (entry & 0xff, (entry >> 8 & ((1 << MOST_PRECISION) - 1)) + 1, entry >> (8 + MOST_PRECISION))
    }
}
