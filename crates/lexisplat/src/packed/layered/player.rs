//! The entropy decoder of a range.

use super::range::{LEAST, MOST_BITS, length_bytes};
use super::streams::{Slot, Stream};
use super::symbols::{LANES, Lanes, Symbols, has};
use super::tables::Lookup;
use crate::packed::stream::BitCounts;

/// The decoder of a range.
#[derive(Debug)]
pub(in crate::packed) struct Player<'a> {
    pub(super) lookup: &'a Lookup,
    /// Words of 16 bits, at least two.
    pub(super) words: &'a [[u8; 2]],
    pub(super) states: Lanes<u32>,
    /// Next word of each lane, and the end of its words.
    pub(super) next: Lanes<u32>,
    ends: Lanes<u32>,
    /// Whether something was asked for that no encoder writes.
    pub(super) damaged: bool,
    /// Bits of each stream, if they are counted.
    pub(super) bit_counts: Option<BitCounts>,
}

impl<'a> Player<'a> {
    /// `None` if `bytes` cannot be a range of this many lanes. Bits of streams are counted if `count_bits`.
    pub(super) fn new(lookup: &'a Lookup, bytes: &'a [u8], lanes: usize, count_bits: bool) -> Option<Self> {
        let width = length_bytes(bytes.len());
        let (lengths, words) = bytes.split_at_checked(width * lanes.checked_sub(1)?)?;
        let (words, []) = words.as_chunks::<2>() else { return None };
        let total = u32::try_from(words.len()).ok().filter(|&total| (2..=MAX_WORDS).contains(&total))?;
        let mut player = Self {
            lookup,
            words,
            states: [LEAST; LANES],
            next: [2; LANES],
            ends: [2; LANES],
            damaged: false,
            bit_counts: count_bits.then(|| BitCounts::zeros(Stream::ALL.len())),
        };
        let mut end = 0_u32;
        for l in 0..lanes {
            let start = end;
            end = match lengths.get(l * width..(l + 1) * width) {
                Some(bytes) => {
                    let length = bytes.iter().rev().fold(0, |length, &byte| length << 8 | u32::from(byte));
                    end.checked_add(length).filter(|&end| end <= total)?
                }
                None => total,
            };
            let [high, low] = *words.get(start as usize..end as usize)?.first_chunk()?;
            let state = u32::from(u16::from_le_bytes(high)) << 16 | u32::from(u16::from_le_bytes(low));
            player.states[l] = Some(state).filter(|&state| state >= LEAST)?;
            player.next[l] = start + 2;
            player.ends[l] = end;
        }
        Some(player)
    }

    /// Takes a word into the state of a lane if it has room for one. Beyond the end of its words there is anything.
    #[inline(always)]
    fn refill(&mut self, l: usize, state: u32) {
        let word = self.words.get(self.next[l] as usize).copied().unwrap_or_default();
        let low = state < LEAST;
        let filled = state << 16 | u32::from(u16::from_le_bytes(word));
        self.states[l] = if low { filled } else { state };
        self.next[l] += u32::from(low);
    }

    /// Whether nothing was asked for that no encoder writes, and no lane was read beyond its end.
    pub(super) fn good(&self) -> bool {
        !self.damaged && self.next.iter().zip(&self.ends).all(|(next, end)| next <= end)
    }

    /// Whether every lane was read to its end and not beyond, and holds what an encoder leaves.
    pub(in crate::packed) fn exhausted(&self) -> bool {
        !self.damaged && self.states == [LEAST; LANES] && self.next == self.ends
    }

    /// The next symbol of each lane in `set`, by the table of its context.
    ///
    /// It is called and not inlined: the walk has dozens of places that take symbols, and with this in each of them it
    /// would not fit into the cache of instructions.
    #[inline(never)]
    fn take(&mut self, slot: Slot, context: &Lanes<u32>, set: u32) -> Lanes<u32> {
        let precision = slot.stream.precision();
        let mut out = [0; LANES];
        for l in (0..LANES).filter(|&l| has(set, l)) {
            let start = self.lookup.start(slot.place(context[l]));
            self.damaged |= start == 0;
            let state = self.states[l];
            let (symbol, share, over) = self.lookup.entry(start, state & ((1 << precision) - 1));
            self.refill(l, (state >> precision).wrapping_mul(share).wrapping_add(over));
            out[l] = symbol;
            if let Some(bit_counts) = &mut self.bit_counts {
                bit_counts.0[slot.stream as usize] += f64::from(precision) - libm::log2(f64::from(share));
            }
        }
        out
    }

    /// The next `count` raw bits of each lane in `set`, at most 16.
    #[inline(never)]
    fn take_bits(&mut self, count: &Lanes<u32>, set: u32) -> Lanes<u32> {
        let mut out = [0; LANES];
        for l in (0..LANES).filter(|&l| has(set, l)) {
            let state = self.states[l];
            self.refill(l, state >> count[l]);
            out[l] = state & ((1 << count[l]) - 1);
        }
        out
    }
}

/// Most words of a range.
const MAX_WORDS: u32 = 1 << 30;

impl Symbols for Player<'_> {
    #[inline(always)]
    fn symbols(&mut self, slot: Slot, context: Lanes<u32>, set: u32, _: impl Fn(usize) -> u32) -> Lanes<u32> {
        self.take(slot, &context, set)
    }

    #[inline(always)]
    fn bits(&mut self, slot: Slot, count: Lanes<u32>, set: u32, _: impl Fn(usize) -> u32) -> Lanes<u32> {
        if let Some(bit_counts) = &mut self.bit_counts {
            let taken = (0..LANES).filter(|&l| has(set, l)).map(|l| f64::from(count[l]));
            bit_counts.0[slot.stream as usize] += taken.sum::<f64>();
        }
        let mut first = [0; LANES];
        let mut more = 0;
        for l in 0..LANES {
            first[l] = count[l].min(MOST_BITS);
            more |= count[l];
        }
        let mut out = self.take_bits(&first, set);
        if more > MOST_BITS {
            let mut rest = [0; LANES];
            for l in 0..LANES {
                rest[l] = (count[l] - first[l]).min(MOST_BITS);
            }
            let high = self.take_bits(&rest, set);
            for l in 0..LANES {
                out[l] |= high[l] << MOST_BITS;
            }
        }
        out
    }
}
