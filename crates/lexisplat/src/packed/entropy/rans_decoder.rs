//! The entropy decoder of a range.

use crate::packed::bitstream::broken::Broken;
use crate::packed::bitstream::stream::BitCounts;
use crate::packed::bitstream::streams::{CONTEXTS, Slot};
use crate::packed::entropy::lanes::{LANES, Lanes, each, has};
use crate::packed::entropy::rans_encoder::length_bytes;
use crate::packed::entropy::rans_state::{LEAST, MOST_BITS};
use crate::packed::entropy::shifts::{power, right_unsigned};
use crate::packed::entropy::symbols::Symbols;
use crate::packed::entropy::tables::{Entry, IDLE, Lookup, Set, less_share, over, symbol};
use crate::support::simd::Simd;

/// A decoder of the symbols and raw bits of a range.
#[derive(Debug)]
pub(in crate::packed) struct SymbolDecoder<'a> {
    pub(in crate::packed) lookup: &'a Lookup,
    /// Words of 16 bits. There are at least two.
    pub(in crate::packed) words: &'a [[u8; 2]],
    pub(in crate::packed) states: Lanes<u32>,
    /// Index of the next word of each lane, and the end of the lane's words.
    pub(in crate::packed) next: Lanes<u32>,
    ends: Lanes<u32>,
    /// Vector instructions for the look-ups.
    simd: Simd,
    /// Whether symbols of a set of contexts without tables were asked for, which no encoder writes.
    pub(in crate::packed) damaged: bool,
    /// Number of bits of each stream, if bits are counted.
    pub(in crate::packed) bit_counts: Option<BitCounts>,
}

impl<'a> SymbolDecoder<'a> {
    /// Creates a decoder. Returns the broken rule if `bytes` cannot be a range of `lanes` lanes. With `count_bits`, the bits of streams are
    /// counted.
    pub(in crate::packed) fn new(
        lookup: &'a Lookup,
        bytes: &'a [u8],
        lanes: usize,
        count_bits: bool,
    ) -> Result<Self, Broken> {
        let lengths = lanes.checked_sub(1).ok_or(Broken("has no lane"))?;
        let width = length_bytes(bytes.len());
        let (lengths, words) = bytes
            .split_at_checked(width * lengths)
            .ok_or(Broken("ends within the numbers of words of its lanes"))?;
        let (words, []) = words.as_chunks::<2>() else { return Err(Broken("has half a word at its end")) };
        let total = u32::try_from(words.len())
            .ok()
            .filter(|&total| total <= MAX_WORDS)
            .ok_or(Broken("has more than 2^30 words"))?;
        let mut player = Self {
            lookup,
            words,
            states: [LEAST; LANES],
            next: [2; LANES],
            ends: [2; LANES],
            simd: Simd::current().narrow(),
            damaged: false,
            bit_counts: count_bits.then(BitCounts::zeros),
        };
        let mut end = 0_u32;
        for l in 0..lanes {
            let start = end;
            end = match lengths.get(l * width..(l + 1) * width) {
                Some(bytes) => {
                    let length = bytes.iter().rev().fold(0, |length, &byte| length << 8 | u32::from(byte));
                    end.checked_add(length)
                        .filter(|&end| end <= total)
                        .ok_or(Broken("has fewer words than its lanes are said to have"))?
                }
                None => total,
            };
            let [high, low] = *words
                .get(start as usize..end as usize)
                .and_then(<[_]>::first_chunk)
                .ok_or(Broken("has a lane of fewer than two words"))?;
            let state = u32::from(u16::from_le_bytes(high)) << 16 | u32::from(u16::from_le_bytes(low));
            player.states[l] = Some(state)
                .filter(|&state| state >= LEAST)
                .ok_or(Broken("has a lane whose first state is below 2^16"))?;
            player.next[l] = start + 2;
            player.ends[l] = end;
        }
        Ok(player)
    }

    /// Returns the rule that the range broke so far: a symbol without a table was asked for, or a lane was read beyond its
    /// end.
    pub(in crate::packed) fn check(&self) -> Result<(), Broken> {
        if self.damaged {
            return Err(Broken("has a symbol of a set of contexts without tables"));
        }
        match self.next.iter().zip(&self.ends).all(|(next, end)| next <= end) {
            true => Ok(()),
            false => Err(Broken("ends within the words of a lane")),
        }
    }

    /// Returns a broken rule unless every lane was read exactly to its end, and is in the state from which an encoder
    /// starts.
    pub(in crate::packed) fn check_end(&self) -> Result<(), Broken> {
        self.check()?;
        if self.next != self.ends {
            return Err(Broken("has words that no symbol takes"));
        }
        match self.states == [LEAST; LANES] {
            true => Ok(()),
            false => Err(Broken("ends with a state that is not 2^16")),
        }
    }

    /// Takes the next symbol of each lane whose context is not [`IDLE`], by the table of the context.
    ///
    /// It must not be inlined. The walk takes symbols by dozens of calls, and with this code in each of them it would not
    /// fit into the instruction cache.
    #[inline(never)]
    fn take<const PRECISION: u32>(&mut self, number: usize, context: &Lanes<u32>, set: u32) -> Lanes<u32> {
        let Some(tables) = self.lookup.set(number) else {
            self.damaged |= set != 0;
            return [0; LANES];
        };
        if set.count_ones() <= FEW {
            return self.take_few::<PRECISION>(tables, context, set);
        }
        let simd = self.simd;
        simd.run(Take::<PRECISION> { player: self, tables, context, set })
    }

    /// Does the work of [`Self::take`] lane by lane.
    #[inline(always)]
    fn take_few<const PRECISION: u32>(
        &mut self,
        tables: Set<'_>,
        context: &Lanes<u32>,
        mut set: u32,
    ) -> Lanes<u32> {
        let mut out = [0; LANES];
        while set != 0 {
            let l = set.trailing_zeros() as usize % LANES;
            let state = self.states[l];
            let entry = tables.entry(context[l], state & ((1 << PRECISION) - 1));
            let state = after::<PRECISION>(state, entry);
            (self.states[l], self.next[l]) = refilled(state, self.next[l], word(self.words, self.next[l]));
            out[l] = symbol(entry);
            set &= set - 1;
        }
        out
    }

    /// Counts the bits of the symbols that are taken next.
    #[cold]
    #[inline(never)]
    fn count(&mut self, slot: Slot, context: &Lanes<u32>, set: u32) {
        let (Some(bit_counts), Some(tables)) = (&mut self.bit_counts, self.lookup.set(slot.number)) else {
            return;
        };
        let precision = slot.stream.precision();
        for l in (0..LANES).filter(|&l| has(set, l)) {
            let entry = tables.entry(context[l], self.states[l] & ((1 << precision) - 1));
            let share = less_share(entry) + 1;
            bit_counts.0[slot.stream as usize] += f64::from(precision) - libm::log2(f64::from(share));
        }
    }

    /// Takes the next `count` raw bits of each lane, at most 16. The count of a lane that is not in use is 0.
    #[inline(never)]
    fn take_bits(&mut self, count: &Lanes<u32>) -> Lanes<u32> {
        let simd = self.simd;
        simd.run(TakeBits { player: self, count })
    }

    /// Counts raw bits that are taken next.
    #[cold]
    #[inline(never)]
    fn count_raw(&mut self, slot: Slot, count: &Lanes<u32>, set: u32) {
        let Some(bit_counts) = &mut self.bit_counts else { return };
        let taken = (0..LANES).filter(|&l| has(set, l)).map(|l| f64::from(count[l]));
        bit_counts.0[slot.stream as usize] += taken.sum::<f64>();
    }
}

/// The work of [`SymbolDecoder::take`]. Everything but the look-ups is done in vector registers.
struct Take<'p, 'l, const PRECISION: u32> {
    player: &'p mut SymbolDecoder<'l>,
    tables: Set<'l>,
    context: &'p Lanes<u32>,
    set: u32,
}

impl<const PRECISION: u32> pulp::NullaryFnOnce for Take<'_, '_, PRECISION> {
    type Output = Lanes<u32>;

    #[inline(always)]
    fn call(mut self) -> Lanes<u32> {
        let mut out = [0; LANES];
        self.half::<0>(&mut out);
        if self.set >> HALF != 0 {
            self.half::<HALF>(&mut out);
        }
        out
    }
}

impl<const PRECISION: u32> Take<'_, '_, PRECISION> {
    /// Takes the symbols of half of the lanes, from lane `FIRST` on. They fill a vector register.
    #[inline(always)]
    fn half<const FIRST: usize>(&mut self, out: &mut Lanes<u32>) {
        let mut entries = [0; HALF];
        for l in 0..HALF {
            let low = self.player.states[FIRST + l] & ((1 << PRECISION) - 1);
            entries[l] = self.tables.entry(self.context[FIRST + l], low);
        }
        let words = self.player.next_words::<FIRST>();
        let (states, next) = self.player.half_mut::<FIRST>();
        let symbols = advance::<PRECISION>(states, next, &entries, &words);
        out[FIRST..FIRST + HALF].copy_from_slice(&symbols);
    }
}

/// The work of [`SymbolDecoder::take_bits`].
struct TakeBits<'p, 'l> {
    player: &'p mut SymbolDecoder<'l>,
    count: &'p Lanes<u32>,
}

impl pulp::NullaryFnOnce for TakeBits<'_, '_> {
    type Output = Lanes<u32>;

    #[inline(always)]
    fn call(self) -> Lanes<u32> {
        let Self { player, count } = self;
        let states = player.states;
        let out = each(|l| states[l] & (power(count[l]) - 1));
        player.states = right_unsigned(&states, count);
        player.refill_half::<0>();
        player.refill_half::<HALF>();
        out
    }
}

impl SymbolDecoder<'_> {
    /// Moves a word into each state of half of the lanes that has room for one.
    #[inline(always)]
    fn refill_half<const FIRST: usize>(&mut self) {
        let words = self.next_words::<FIRST>();
        let (states, next) = self.half_mut::<FIRST>();
        refill(states, next, &words);
    }

    /// Returns the next word of each lane of half of the lanes.
    #[inline(always)]
    fn next_words<const FIRST: usize>(&self) -> [u32; HALF] {
        let mut words = [0; HALF];
        for l in 0..HALF {
            words[l] = word(self.words, self.next[FIRST + l]);
        }
        words
    }

    /// Returns the states of half of the lanes, and the indices of their next words.
    #[inline(always)]
    fn half_mut<const FIRST: usize>(&mut self) -> (&mut [u32; HALF], &mut [u32; HALF]) {
        let (states, next) = (self.states.as_chunks_mut().0, self.next.as_chunks_mut().0);
        (&mut states[FIRST / HALF], &mut next[FIRST / HALF])
    }
}

/// Takes a symbol from each state, and moves a word into each state that has room for one. Returns the symbols.
// Where this code is inlined between look-ups of single numbers, WebAssembly gets no vector code for it.
#[cfg_attr(target_arch = "wasm32", inline(never))]
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn advance<const PRECISION: u32>(
    states: &mut [u32; HALF],
    next: &mut [u32; HALF],
    entries: &[Entry; HALF],
    words: &[u32; HALF],
) -> [u32; HALF] {
    let mut out = [0; HALF];
    for l in 0..HALF {
        let state = after::<PRECISION>(states[l], entries[l]);
        (states[l], next[l]) = refilled(state, next[l], words[l]);
        out[l] = symbol(entries[l]);
    }
    out
}

/// Moves a word into each state that has room for one.
#[cfg_attr(target_arch = "wasm32", inline(never))]
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn refill(states: &mut [u32; HALF], next: &mut [u32; HALF], words: &[u32; HALF]) {
    for l in 0..HALF {
        (states[l], next[l]) = refilled(states[l], next[l], words[l]);
    }
}

/// Returns the state after a symbol is taken.
#[inline(always)]
fn after<const PRECISION: u32>(state: u32, entry: Entry) -> u32 {
    let rest = state >> PRECISION;
    rest.wrapping_mul(less_share(entry)).wrapping_add(rest.wrapping_add(over(entry)))
}

/// Returns the word with the index `number`. Beyond the end it may be any number.
#[inline(always)]
fn word(words: &[[u8; 2]], number: u32) -> u32 {
    u16::from_le_bytes(words.get(number as usize).copied().unwrap_or_default()).into()
}

/// Returns a state and the index of the lane's next word, after the word is moved into the state if there is room.
#[inline(always)]
fn refilled(state: u32, next: u32, word: u32) -> (u32, u32) {
    let low = state < LEAST;
    (if low { state << 16 | word } else { state }, next.wrapping_add(u32::from(low)))
}

/// Number of lanes of half of the lanes.
const HALF: usize = LANES / 2;
/// Largest number of busy lanes for which symbols are taken lane by lane.
const FEW: u32 = 3;

/// Largest number of words of a range.
const MAX_WORDS: u32 = 1 << 30;

impl Symbols for SymbolDecoder<'_> {
    #[inline(always)]
    fn symbols(&mut self, slot: Slot, context: Lanes<u32>, set: u32, _: impl Fn(usize) -> u32) -> Lanes<u32> {
        const LAST: u32 = CONTEXTS as u32 - 1;
        let context = each(|l| if has(set, l) { context[l].min(LAST) } else { IDLE });
        if self.bit_counts.is_some() {
            self.count(slot, &context, set);
        }
        match slot.stream.precision() {
            12 => self.take::<12>(slot.number, &context, set),
            _ => self.take::<10>(slot.number, &context, set),
        }
    }

    #[inline(always)]
    fn bits(&mut self, slot: Slot, count: Lanes<u32>, set: u32, _: impl Fn(usize) -> u32) -> Lanes<u32> {
        if self.bit_counts.is_some() {
            self.count_raw(slot, &count, set);
        }
        let count = each(|l| if has(set, l) { count[l] } else { 0 });
        let first = each(|l| count[l].min(MOST_BITS));
        let mut out = self.take_bits(&first);
        if count.iter().fold(0, |all, count| all | count) > MOST_BITS {
            let high = self.take_bits(&each(|l| (count[l] - first[l]).min(MOST_BITS)));
            out = each(|l| out[l] | high[l] << MOST_BITS);
        }
        out
    }
}
