//! Tables of probabilities: made of counts, written, read, looked up.

use super::streams::{CONTEXTS, Stream};
use crate::packed::bits::{BitReader, BitWriter};

/// Bits of a probability. Finer probabilities cost more in tables than they save.
pub(super) const PRECISION: u32 = 12;
/// All probabilities of a table.
pub(super) const TOTAL: u32 = 1 << PRECISION;
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
pub(in crate::packed) const ALL_CONTEXTS: usize = Stream::ALL.len() * CONTEXTS;

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

    /// Bits of all its symbols when coded with its own probabilities, and of its table.
    fn cost(&self) -> f64 {
        let total: u64 = self.counts.iter().map(|&c| u64::from(c)).sum();
        let total = total as f64;
        let mut bits = 0.0;
        let mut used = 0;
        for &count in self.counts.iter().filter(|&&c| c > 0) {
            // A probability is at least one unit of precision.
            let share = (f64::from(count) / total).max(1.0 / f64::from(TOTAL));
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

/// Where a symbol's share of the states lies, in units of 2^-12.
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
    /// A table from counts; `None` if they are all zero or too many.
    fn new(counts: &[u32]) -> Option<Self> {
        let total: u64 = counts.iter().map(|&c| u64::from(c)).sum();
        if total == 0 || counts.len() > MAX_SYMBOLS {
            return None;
        }
        let share = |&c: &u32| if c == 0 { 0 } else { (u64::from(c) * u64::from(TOTAL) / total).max(1).cast_signed() };
        let mut shares: Vec<i64> = counts.iter().map(share).collect();
        // The difference that rounding leaves goes to the most frequent symbols, where it costs least.
        let mut left = i64::from(TOTAL) - shares.iter().sum::<i64>();
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
    /// The table of every context, stream by stream; [`NONE`] for contexts that are never used.
    map: Vec<u8>,
    /// The tables of each stream.
    tables: Vec<Vec<Table>>,
}

impl Tables {
    /// Joins contexts where a shared table costs less than two. `histograms` has [`ALL_CONTEXTS`] entries.
    pub(in crate::packed) fn new(histograms: &[Histogram]) -> Option<Self> {
        let mut map = Vec::with_capacity(histograms.len());
        let mut tables = Vec::new();
        for stream in histograms.chunks(CONTEXTS) {
            let (joined, of) = join(stream);
            map.extend(of);
            let made: Option<Vec<Table>> = joined.iter().map(|h| Table::new(&h.rounded())).collect();
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
        model.copied().filter(|m| m.share > 0).unwrap_or(Model { start: 0, share: TOTAL })
    }

    /// Bits of all symbols counted in `histogram` of a context.
    pub(in crate::packed) fn bits(&self, context: usize, histogram: &Histogram) -> f64 {
        let used = (0_u8..=u8::MAX).zip(&histogram.counts).filter(|(_, count)| **count > 0);
        let cost = |symbol| f64::from(PRECISION) - libm::log2(f64::from(self.model(context, symbol).share));
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
        let mut tables = Vec::with_capacity(Stream::ALL.len());
        for _ in Stream::ALL {
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
                made.push(Table::new(&counts)?);
            }
            tables.push(made);
        }
        bits.exhausted().then_some(Self { map, tables })
    }
}

/// Joins the two histograms that gain most by sharing a table until none gains. Returns the joined histograms, and for
/// each context the number of its histogram among them.
fn join(contexts: &[Histogram]) -> (Vec<Histogram>, Vec<u8>) {
    let mut groups: Vec<(Histogram, Vec<usize>, f64)> = (0..contexts.len())
        .filter(|&c| !contexts[c].counts.is_empty())
        .map(|c| (contexts[c].clone(), vec![c], contexts[c].cost()))
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
                let cost = joined(&groups[i].0, &groups[j].0).cost();
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

/// The tables as a decoder looks symbols up.
///
/// A symbol is found by the low bits of a state, and its share by the symbol. One list that held both would be four times
/// as long, and would not stay in cache.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Lookup {
    /// The table of each context.
    tables: Vec<u32>,
    /// Of each table, for each of the 4096 values of a state's low bits, the symbol.
    symbols: Vec<u8>,
    /// Of each table and symbol the share, shifted by 16 bits, and the start.
    models: Vec<u32>,
}

/// Symbols of a table in [`Lookup`].
const SYMBOLS: usize = 256;

impl Lookup {
    pub(in crate::packed) fn new(tables: &Tables) -> Self {
        // The first table stands for those that are missing: one symbol that takes no bits.
        let mut symbols = vec![0; TOTAL as usize];
        let mut models = vec![TOTAL << 16; SYMBOLS];
        let mut numbers = Vec::with_capacity(tables.tables.len());
        let mut number = 0_u32;
        for stream in &tables.tables {
            numbers.push(number);
            for table in stream {
                number += 1;
                for (symbol, model) in (0_u8..=u8::MAX).zip(&table.models) {
                    symbols.extend(std::iter::repeat_n(symbol, model.share as usize));
                }
                let packed = table.models.iter().map(|model| model.share << 16 | model.start);
                models.extend(packed.chain(std::iter::repeat(0)).take(SYMBOLS));
            }
        }
        let table = |(context, &table): (usize, &u8)| {
            let stream = context / CONTEXTS;
            let there = tables.tables.get(stream).is_some_and(|stream| stream.len() > usize::from(table));
            if there { numbers[stream] + u32::from(table) + 1 } else { 0 }
        };
        Self { tables: tables.map.iter().enumerate().map(table).collect(), symbols, models }
    }

    /// The table of a context; 0 if it is missing.
    #[inline(always)]
    pub(super) fn table(&self, context: usize) -> u32 {
        self.tables.get(context).copied().unwrap_or(0)
    }

    /// The symbol, its share, and how far `low` lies above its start.
    #[inline(always)]
    pub(super) fn entry(&self, table: u32, low: u32) -> (u32, u32, u32) {
        let symbol = self.symbols.get((table << PRECISION | low) as usize).copied().unwrap_or(0);
        let model = self.models.get(table as usize * SYMBOLS + usize::from(symbol)).copied().unwrap_or(0);
        (symbol.into(), model >> 16, low.wrapping_sub(model & 0xffff))
    }
}
