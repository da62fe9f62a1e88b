//! Entropy coding: histograms, contexts that share one, tables in files, coding with tables.

use constriction::UnwrapInfallible;
use constriction::stream::model::{ContiguousCategoricalEntropyModel, ContiguousLookupDecoderModel};
use constriction::stream::stack::AnsCoder;
use constriction::stream::{Decode, Encode};

use super::bits::{BitReader, BitWriter};

/// Bits of a probability. Finer probabilities cost more in tables than they save.
pub(super) const PRECISION: usize = 12;
const TOTAL: u32 = 1 << PRECISION;
/// Contexts of one stream.
pub(super) const CONTEXTS: usize = 24;
/// Bits of a symbol count and of a bit length in a transmitted table.
const SYMBOLS_BITS: u32 = 11;
const LENGTH_BITS: u32 = 4;
/// Bits kept of a frequency after its leading one.
const MANTISSA_BITS: u32 = 3;
/// Bits of a cluster's number in the context map.
const CLUSTER_BITS: u32 = 5;
/// About the bits of a symbol in a table: its length and its mantissa.
const SYMBOL_COST: f64 = 6.5;
/// Largest number of symbols of a table. Atoms are the widest alphabet.
const MAX_SYMBOLS: usize = 1 << 10;

type Encoder = ContiguousCategoricalEntropyModel<u16, Vec<u16>, PRECISION>;
type Decoder = ContiguousLookupDecoderModel<u16, Vec<u16>, Box<[u16]>, PRECISION>;

/// How often each symbol occurs in one context.
#[derive(Debug, Clone, Default)]
pub(super) struct Histogram {
    counts: Vec<u32>,
}

impl Histogram {
    pub(super) fn add(&mut self, symbol: u16) {
        let symbol = usize::from(symbol);
        if symbol >= self.counts.len() {
            self.counts.resize(symbol + 1, 0);
        }
        self.counts[symbol] += 1;
    }

    pub(super) fn merge(&mut self, other: &Self) {
        if other.counts.len() > self.counts.len() {
            self.counts.resize(other.counts.len(), 0);
        }
        for (a, b) in self.counts.iter_mut().zip(&other.counts) {
            *a += b;
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }

    /// Bits of all its symbols when coded with `table`.
    pub(super) fn bits(&self, table: &Table) -> f64 {
        let used = (0_u16..).zip(&self.counts).filter(|(_, count)| **count > 0);
        used.map(|(symbol, &count)| f64::from(count) * table.bits(symbol)).sum()
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

/// One table: the symbols that occur and their probabilities.
#[derive(Debug, Clone)]
pub(super) struct Table {
    /// What is transmitted.
    counts: Vec<u32>,
    symbols: Vec<u16>,
    /// Probability of each of `symbols` in units of 2^-12.
    shares: Vec<u16>,
    /// Position in `symbols`; `u16::MAX` for symbols that do not occur.
    ranks: Vec<u16>,
    /// `None` if there is only one symbol, which takes no bits.
    models: Option<(Encoder, Decoder)>,
}

impl Table {
    /// A table from counts; `None` if they are all zero or too many.
    fn new(counts: &[u32]) -> Option<Self> {
        let total: u64 = counts.iter().map(|&c| u64::from(c)).sum();
        let used: Vec<usize> = (0..counts.len()).filter(|&s| counts[s] > 0).collect();
        if used.is_empty() || used.len() > MAX_SYMBOLS || counts.len() > MAX_SYMBOLS {
            return None;
        }
        let share = |&s: &usize| (u64::from(counts[s]) * u64::from(TOTAL) / total).max(1);
        let mut shares: Vec<i64> = used.iter().map(|s| share(s).cast_signed()).collect();
        // The difference that rounding leaves goes to the most frequent symbols, where it costs least.
        let mut left = i64::from(TOTAL) - shares.iter().sum::<i64>();
        while left != 0 {
            let most = (0..shares.len()).max_by_key(|&k| (shares[k], std::cmp::Reverse(k)))?;
            let change = if left > 0 { left } else { left.max(-(shares[most] / 2)) };
            shares[most] += change;
            left -= change;
        }
        let shares: Vec<u16> = shares.iter().map(|&s| u16::try_from(s).ok()).collect::<Option<_>>()?;
        let symbols: Vec<u16> = used.iter().map(|&s| u16::try_from(s).ok()).collect::<Option<_>>()?;
        let mut ranks = vec![u16::MAX; counts.len()];
        for (rank, &symbol) in (0..).zip(&symbols) {
            ranks[usize::from(symbol)] = rank;
        }
        let models = if symbols.len() > 1 {
            let probabilities = || shares.iter().copied();
            let encoder = Encoder::from_nonzero_fixed_point_probabilities(probabilities(), false).ok()?;
            let decoder = Decoder::from_nonzero_fixed_point_probabilities(probabilities(), false).ok()?;
            Some((encoder, decoder))
        } else {
            None
        };
        Some(Self { counts: counts.to_vec(), symbols, shares, ranks, models })
    }

    /// Bits of `symbol`, which must be in the table.
    pub(super) fn bits(&self, symbol: u16) -> f64 {
        let rank = self.ranks.get(usize::from(symbol)).copied().unwrap_or(u16::MAX);
        self.shares
            .get(usize::from(rank))
            .map_or(f64::from(TOTAL), |&share| PRECISION as f64 - libm::log2(f64::from(share)))
    }
}

/// All tables of a file, and the table of each context of each stream.
#[derive(Debug, Clone)]
pub(super) struct Tables {
    /// The cluster of every context, stream by stream; `u8::MAX` for contexts that are never used.
    map: Vec<u8>,
    /// The tables of each stream.
    tables: Vec<Vec<Table>>,
}

impl Tables {
    /// Joins contexts where a shared table costs less than two. `histograms` has [`CONTEXTS`] entries a
    /// stream.
    pub(super) fn new(histograms: &[Histogram]) -> Option<Self> {
        let mut map = Vec::with_capacity(histograms.len());
        let mut tables = Vec::new();
        for stream in histograms.chunks(CONTEXTS) {
            let (clusters, of) = cluster(stream);
            map.extend(of);
            let made: Option<Vec<Table>> = clusters.iter().map(|h| Table::new(&h.rounded())).collect();
            tables.push(made?);
        }
        Some(Self { map, tables })
    }

    #[inline]
    pub(super) fn table(&self, stream: usize, context: usize) -> Option<&Table> {
        let cluster = *self.map.get(stream * CONTEXTS + context)?;
        self.tables.get(stream)?.get(usize::from(cluster))
    }

    /// Writes map and tables.
    pub(super) fn write(&self) -> Vec<u8> {
        let mut out = BitWriter::default();
        for (tables, map) in self.tables.iter().zip(self.map.chunks(CONTEXTS)) {
            let mut last = 0;
            for &cluster in map {
                // An unused context shares its neighbour's table.
                let cluster = if cluster == u8::MAX { last } else { cluster };
                out.put(1, u64::from(cluster != last));
                if cluster != last {
                    out.put(CLUSTER_BITS, u64::from(cluster));
                }
                last = cluster;
            }
            out.put(CLUSTER_BITS, tables.len() as u64);
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

    /// Reads what [`Self::write`] wrote, for `streams` streams; `None` for anything else.
    pub(super) fn read(bytes: &[u8], streams: usize) -> Option<Self> {
        let mut bits = BitReader::new(bytes);
        let mut map = Vec::with_capacity(streams * CONTEXTS);
        let mut tables = Vec::with_capacity(streams);
        for _ in 0..streams {
            let mut last = 0_u8;
            for _ in 0..CONTEXTS {
                if bits.take(1) == 1 {
                    last = u8::try_from(bits.take(CLUSTER_BITS)).ok()?;
                }
                map.push(last);
            }
            let clusters = bits.take(CLUSTER_BITS);
            let mut made = Vec::new();
            for _ in 0..clusters {
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

/// Greedy clustering: joins the two histograms that gain most by sharing a table until none gains. Returns the
/// joined histograms, and for each context the number of its histogram among them.
fn cluster(contexts: &[Histogram]) -> (Vec<Histogram>, Vec<u8>) {
    let mut groups: Vec<(Histogram, Vec<usize>, f64)> = (0..contexts.len())
        .filter(|&c| !contexts[c].is_empty())
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
    let mut map = vec![u8::MAX; contexts.len()];
    for (number, group) in (0..).zip(&groups) {
        for &context in &group.1 {
            map[context] = number;
        }
    }
    (groups.into_iter().map(|g| g.0).collect(), map)
}

/// Codes symbols, each with its table. Returns little-endian words.
pub(super) fn encode<'t>(symbols: impl DoubleEndedIterator<Item = (&'t Table, u16)>) -> Vec<u8> {
    let mut coder = AnsCoder::<u32, u64>::new();
    // The coder is a stack: the symbol that is coded last is decoded first.
    for (table, symbol) in symbols.rev() {
        let Some((encoder, _)) = &table.models else { continue };
        let rank = table.ranks.get(usize::from(symbol)).copied().unwrap_or(0);
        // Every symbol was counted when the tables were made.
        let _ = coder.encode_symbol(usize::from(rank), encoder);
    }
    let words = coder.into_compressed().unwrap_infallible();
    words.iter().flat_map(|w| w.to_le_bytes()).collect()
}

/// Decodes what [`encode`] coded.
#[derive(Debug)]
pub(super) struct SymbolReader {
    coder: AnsCoder<u32, u64>,
}

impl SymbolReader {
    /// `None` if `bytes` cannot come from [`encode`].
    pub(super) fn new(bytes: &[u8]) -> Option<Self> {
        let (words, rest) = bytes.as_chunks::<4>();
        let words: Vec<u32> = words.iter().map(|w| u32::from_le_bytes(*w)).collect();
        let coder = AnsCoder::from_compressed(words).ok()?;
        rest.is_empty().then_some(Self { coder })
    }

    /// The next symbol. Beyond the end it is any symbol of the table.
    #[inline]
    pub(super) fn take(&mut self, table: &Table) -> u16 {
        let rank = match &table.models {
            None => 0,
            Some((_, decoder)) => self.coder.decode_symbol(decoder).unwrap_or(0),
        };
        table.symbols.get(rank).copied().unwrap_or(0)
    }

    /// Whether all words were decoded, and nothing beyond them.
    pub(super) fn exhausted(&self) -> bool {
        self.coder.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const STREAMS: usize = 3;

    /// Contexts and symbols, few of them often, from an alphabet as wide as atoms.
    fn sequences() -> impl Strategy<Value = Vec<(usize, u16)>> {
        let wide = (0..STREAMS * CONTEXTS, 0..1024_u16);
        let narrow = (0..STREAMS * CONTEXTS, 0..6_u16);
        let one = (0..4_usize, 0..3_u16);
        let pair = prop_oneof![2 => wide, 5 => narrow, 5 => one];
        let long = (prop::collection::vec(pair, 1..400), 1..20_usize);
        long.prop_map(|(pairs, times)| pairs.repeat(times))
    }

    fn tables_of(sequence: &[(usize, u16)]) -> Tables {
        let mut histograms = vec![Histogram::default(); STREAMS * CONTEXTS];
        for &(context, symbol) in sequence {
            histograms[context].add(symbol);
        }
        Tables::new(&histograms).unwrap()
    }

    fn table(tables: &Tables, context: usize) -> &Table {
        tables.table(context / CONTEXTS, context % CONTEXTS).unwrap()
    }

    fn encoded(tables: &Tables, sequence: &[(usize, u16)]) -> Vec<u8> {
        encode(sequence.iter().map(|&(context, symbol)| (table(tables, context), symbol)))
    }

    /// What is read from `bytes` in the contexts of `sequence`, and whether nothing is left.
    fn decoded(tables: &Tables, sequence: &[(usize, u16)], bytes: &[u8]) -> Option<(Vec<u16>, bool)> {
        let mut reader = SymbolReader::new(bytes)?;
        let symbols = sequence.iter().map(|&(context, _)| reader.take(table(tables, context))).collect();
        Some((symbols, reader.exhausted()))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn tables_come_back(sequence in sequences()) {
            let tables = tables_of(&sequence);
            let bytes = tables.write();
            let read = Tables::read(&bytes, STREAMS).unwrap();
            prop_assert_eq!(read.write(), bytes.clone());
            for &(context, symbol) in &sequence {
                prop_assert_eq!(tables.map[context], read.map[context]);
                let (old, new) = (table(&tables, context), table(&read, context));
                prop_assert_eq!((&old.symbols, &old.shares), (&new.symbols, &new.shares));
                prop_assert_eq!(new.shares.iter().map(|&s| u32::from(s)).sum::<u32>(), TOTAL);
                prop_assert!(new.symbols.binary_search(&symbol).is_ok());
                prop_assert!(new.bits(symbol) <= PRECISION as f64);
            }
            prop_assert!(Tables::read(&bytes[..bytes.len() - 1], STREAMS).is_none());
            let longer = [bytes.as_slice(), &[0]].concat();
            prop_assert!(Tables::read(&longer, STREAMS).is_none());
        }

        #[test]
        fn symbols_come_back(sequence in sequences()) {
            let tables = tables_of(&sequence);
            let read = Tables::read(&tables.write(), STREAMS).unwrap();
            let bytes = encoded(&tables, &sequence);
            let symbols: Vec<u16> = sequence.iter().map(|s| s.1).collect();
            prop_assert_eq!(decoded(&read, &sequence, &bytes), Some((symbols, true)));
            let bits: f64 = sequence.iter().map(|&(context, s)| table(&read, context).bits(s)).sum();
            prop_assert!((bytes.len() * 8) as f64 <= bits + 64.0, "{} bytes for {bits} bits", bytes.len());
        }

        /// Coding is one to one: words that are not the encoder's are left over, or say something else.
        #[test]
        fn other_words_are_noticed(sequence in sequences(), word in 1..u32::MAX) {
            let tables = tables_of(&sequence);
            let bytes = encoded(&tables, &sequence);
            let mine = decoded(&tables, &sequence, &bytes);
            let more = [bytes.as_slice(), &word.to_le_bytes()].concat();
            let before = [&word.to_le_bytes(), bytes.as_slice()].concat();
            let mut changed = bytes.clone();
            changed.iter_mut().take(4).zip(word.to_le_bytes()).for_each(|(a, b)| *a ^= b);
            for other in [&more, &before, &changed, &bytes[4.min(bytes.len())..].to_vec()] {
                prop_assert!(*other == bytes || decoded(&tables, &sequence, other) != mine);
            }
            prop_assert!(SymbolReader::new(&[bytes.as_slice(), &[1]].concat()).is_none());
        }

        /// But for a table's first symbol, which an empty coder codes as nothing.
        #[test]
        fn symbols_left_over_are_noticed(sequence in sequences(), pick in any::<prop::sample::Index>()) {
            let last = sequence[pick.index(sequence.len())];
            let longer = [sequence.as_slice(), &[last]].concat();
            let tables = tables_of(&longer);
            let first = table(&tables, last.0).symbols[0] == last.1;
            let bytes = encoded(&tables, &longer);
            let (_, exhausted) = decoded(&tables, &sequence, &bytes).unwrap();
            prop_assert_eq!(exhausted, first);
        }

        #[test]
        fn any_bytes_are_tables_or_not(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            if let Some(tables) = Tables::read(&bytes, STREAMS) {
                prop_assert_eq!(Tables::read(&tables.write(), STREAMS).unwrap().map, tables.map);
            }
        }
    }

    #[test]
    fn a_lone_symbol_costs_nothing() {
        let sequence = vec![(7, 500_u16); 10_000];
        let tables = tables_of(&sequence);
        assert_eq!(table(&tables, 7).bits(500), 0.0);
        let bytes = encoded(&tables, &sequence);
        assert!(bytes.is_empty());
        assert_eq!(decoded(&tables, &sequence, &bytes), Some((vec![500; 10_000], true)));
    }

    #[test]
    fn nothing_at_all_has_tables() {
        let tables = tables_of(&[]);
        let read = Tables::read(&tables.write(), STREAMS).unwrap();
        assert!((0..STREAMS * CONTEXTS).all(|c| read.table(c / CONTEXTS, c % CONTEXTS).is_none()));
    }

    #[test]
    fn contexts_that_look_alike_share_a_table() {
        let fair = (0..4000).map(|i: u16| (usize::from(i % 2), i / 2 % 4));
        let lopsided = (0..4000).map(|i: u16| (2, if i.is_multiple_of(50) { 3 } else { 0 }));
        let tables = tables_of(&fair.chain(lopsided).collect::<Vec<_>>());
        assert_eq!(tables.map[0], tables.map[1]);
        assert_ne!(tables.map[0], tables.map[2]);
        assert!(table(&tables, 2).bits(0) < 0.1 && (table(&tables, 0).bits(0) - 2.0).abs() < 0.1);
    }
}
