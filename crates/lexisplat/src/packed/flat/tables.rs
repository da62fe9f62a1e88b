//! Tables of probabilities, and the decoder of symbols that are coded with them.

use constriction::stream::Decode;
use constriction::stream::model::ContiguousLookupDecoderModel;
use constriction::stream::stack::AnsCoder;

use crate::packed::bits::BitReader;

/// Bits of a probability.
const PRECISION: usize = 12;
const TOTAL: u32 = 1 << PRECISION;
/// Contexts of one stream.
pub(in crate::packed) const CONTEXTS: usize = 24;
/// Bits of a symbol count and of a bit length in a transmitted table.
const SYMBOLS_BITS: u32 = 11;
const LENGTH_BITS: u32 = 4;
/// Bits kept of a frequency after its leading one.
const MANTISSA_BITS: u32 = 3;
/// Bits of a cluster's number in the context map.
const CLUSTER_BITS: u32 = 5;
/// Largest number of symbols of a table. Atoms are the widest alphabet.
const MAX_SYMBOLS: usize = 1 << 10;

type Decoder = ContiguousLookupDecoderModel<u16, Vec<u16>, Box<[u16]>, PRECISION>;

/// One table: the symbols that occur and their probabilities.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Table {
    symbols: Vec<u16>,
    /// Probability of each of `symbols` in units of 2^-12.
    shares: Vec<u16>,
    /// Position in `symbols`; `u16::MAX` for symbols that do not occur.
    ranks: Vec<u16>,
    /// `None` if there is only one symbol, which takes no bits.
    model: Option<Decoder>,
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
        let model = if symbols.len() > 1 {
            let probabilities = shares.iter().copied();
            Some(Decoder::from_nonzero_fixed_point_probabilities(probabilities, false).ok()?)
        } else {
            None
        };
        Some(Self { symbols, shares, ranks, model })
    }

    /// Bits of `symbol`, which must be in the table.
    pub(in crate::packed) fn bits(&self, symbol: u16) -> f64 {
        let rank = self.ranks.get(usize::from(symbol)).copied().unwrap_or(u16::MAX);
        self.shares
            .get(usize::from(rank))
            .map_or(f64::from(TOTAL), |&share| PRECISION as f64 - libm::log2(f64::from(share)))
    }
}

/// All tables of a file, and the table of each context of each stream.
#[derive(Debug, Clone)]
pub(in crate::packed) struct Tables {
    /// The cluster of every context, stream by stream. It need not be there.
    map: Vec<u8>,
    /// The tables of each stream.
    tables: Vec<Vec<Table>>,
}

impl Tables {
    #[inline]
    pub(in crate::packed) fn table(&self, stream: usize, context: usize) -> Option<&Table> {
        let cluster = *self.map.get(stream * CONTEXTS + context)?;
        self.tables.get(stream)?.get(usize::from(cluster))
    }

    /// Reads the tables of `streams` streams; `None` if no encoder writes them so.
    pub(in crate::packed) fn read(bytes: &[u8], streams: usize) -> Option<Self> {
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

/// Decodes symbols, each with its table, from little-endian words.
#[derive(Debug)]
pub(in crate::packed) struct SymbolReader {
    coder: AnsCoder<u32, u64>,
}

impl SymbolReader {
    /// `None` if `bytes` cannot come from an encoder.
    pub(in crate::packed) fn new(bytes: &[u8]) -> Option<Self> {
        let (words, rest) = bytes.as_chunks::<4>();
        let words: Vec<u32> = words.iter().map(|w| u32::from_le_bytes(*w)).collect();
        let coder = AnsCoder::from_compressed(words).ok()?;
        rest.is_empty().then_some(Self { coder })
    }

    /// The next symbol. Beyond the end it is any symbol of the table.
    #[inline]
    pub(in crate::packed) fn take(&mut self, table: &Table) -> u16 {
        let rank = match &table.model {
            None => 0,
            Some(decoder) => self.coder.decode_symbol(decoder).unwrap_or(0),
        };
        table.symbols.get(rank).copied().unwrap_or(0)
    }

    /// Whether all words were decoded, and nothing beyond them.
    pub(in crate::packed) fn exhausted(&self) -> bool {
        self.coder.is_empty()
    }
}

#[cfg(test)]
mod tests;
