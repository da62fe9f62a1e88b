//! The entropy encoder of a range: up to 16 lanes of rANS, each with a state of 32 bits and words of 16 bits.
//!
//! Raw bits pass through the same states as modelled symbols, so that a lane is one run of words that is read forward.

use crate::packed::bitstream::streams::Slot;
use crate::packed::entropy::lanes::{LANES, Lanes, has};
use crate::packed::entropy::rans_state::{MOST_BITS, Stack};
use crate::packed::entropy::symbols::Symbols;
use crate::packed::entropy::tables::Tables;

/// Least number of bytes of a range whose lanes count their words in 32 bits. In shorter ranges it is 16 bits.
const LEAST_LONG: usize = 1 << 17;

/// Returns the number of bytes of a lane's number of words, in a range of `range` bytes. Longer numbers make a range
/// longer, so the result stays the same with their bytes included.
pub(in crate::packed) fn length_bytes(range: usize) -> usize {
    if range < LEAST_LONG { 2 } else { 4 }
}

/// Marks a recorded entry as raw bits.
const RAW: u32 = 1 << 31;

/// The encoder of a range. It records all symbols and raw bits, since tables are known only later.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct SymbolRecorder {
    /// The entries of each lane: a symbol with its context, or up to 16 raw bits with their number and stream.
    lanes: [Vec<u32>; LANES],
}

impl Symbols for SymbolRecorder {
    fn symbols(
        &mut self,
        slot: Slot,
        context: Lanes<u32>,
        set: u32,
        value: impl Fn(usize) -> u32,
    ) -> Lanes<u32> {
        let mut out = [0; LANES];
        for l in (0..LANES).filter(|&l| has(set, l)) {
            out[l] = value(l);
            self.lanes[l].push((slot.table_index(context[l]) as u32) << 8 | out[l]);
        }
        out
    }

    fn bits(&mut self, slot: Slot, count: Lanes<u32>, set: u32, value: impl Fn(usize) -> u32) -> Lanes<u32> {
        let mut out = [0; LANES];
        for l in (0..LANES).filter(|&l| has(set, l) && count[l] > 0) {
            out[l] = value(l);
            let mut rest = out[l];
            for piece in pieces(count[l]) {
                let bits = rest & ((1 << piece) - 1);
                self.lanes[l].push(RAW | (slot.stream as u32) << 24 | piece << 16 | bits);
                rest = rest.checked_shr(piece).unwrap_or(0);
            }
        }
        out
    }
}

/// Splits `count` raw bits into pieces of at most [`MOST_BITS`], low bits first.
fn pieces(count: u32) -> impl Iterator<Item = u32> {
    [count.min(MOST_BITS), count.saturating_sub(MOST_BITS)].into_iter().filter(|&piece| piece > 0)
}

impl SymbolRecorder {
    /// Calls `count(context, symbol)` for every symbol, and `raw(stream, length)` for every piece of raw bits.
    pub(in crate::packed) fn each(&self, mut count: impl FnMut(usize, u8), mut raw: impl FnMut(usize, u32)) {
        for &entry in self.lanes.iter().flatten() {
            if entry & RAW == 0 {
                count((entry >> 8) as usize, entry.to_le_bytes()[0]);
            } else {
                raw((entry >> 24 & 0x7f) as usize, entry >> 16 & 0xff);
            }
        }
    }

    /// Returns whether `tables` have all recorded symbols.
    pub(in crate::packed) fn is_within(&self, tables: &Tables) -> bool {
        let share = |entry: u32| tables.share((entry >> 8) as usize, entry.to_le_bytes()[0]);
        let has = |&entry: &u32| entry & RAW != 0 || share(entry).is_some();
        self.lanes.iter().flatten().all(has)
    }

    /// Returns all entries, lane by lane. [`Self::restore`] makes a recorder of them.
    #[cfg(test)]
    pub(in crate::packed) fn entries(&self) -> &[Vec<u32>; LANES] {
        &self.lanes
    }

    /// Creates a recorder with the entries of another.
    #[cfg(test)]
    pub(in crate::packed) fn restore(entries: Vec<Vec<u32>>) -> Self {
        let mut lanes: [Vec<u32>; LANES] = Default::default();
        for (lane, entries) in lanes.iter_mut().zip(entries) {
            *lane = entries;
        }
        Self { lanes }
    }

    /// Encodes the range with `tables`. Returns its bytes: the number of words of each lane in use but the last, followed
    /// by the words.
    pub(in crate::packed) fn finish(&self, tables: &Tables, lanes: usize) -> Vec<u8> {
        let words: Vec<Vec<u16>> = self.lanes.iter().take(lanes).map(|lane| encode(lane, tables)).collect();
        let lengths = words.iter().take(lanes.saturating_sub(1)).map(Vec::len);
        let short = 2 * (lengths.len() + words.iter().map(Vec::len).sum::<usize>());
        let mut out = Vec::new();
        for length in lengths {
            out.extend((length as u32).to_le_bytes().iter().take(length_bytes(short)));
        }
        out.extend(words.iter().flatten().flat_map(|word| word.to_le_bytes()));
        out
    }
}

/// Encodes a lane. Returns its words in the order in which they are read.
fn encode(lane: &[u32], tables: &Tables) -> Vec<u16> {
    let mut stack = Stack::new();
    for &entry in lane.iter().rev() {
        if entry & RAW == 0 {
            let context = (entry >> 8) as usize;
            let precision = Slot::stream_of(context).precision();
            stack.symbol(tables.interval(context, entry.to_le_bytes()[0]), precision);
        } else {
            stack.raw(entry >> 16 & 0xff, entry & 0xffff);
        }
    }
    stack.finish()
}

#[cfg(test)]
mod tests;
