//! Tests of the entropy coder against a plain one that codes a lane at a time.

use proptest::prelude::*;

use super::*;
use crate::packed::bitstream::streams::{CONTEXTS, Slot, Stream};
use crate::packed::entropy::rans_decoder::SymbolDecoder;
use crate::packed::entropy::script::{Ask, ask, tables_of};
use crate::packed::entropy::tables::{ALL_CONTEXTS, Histogram, Lookup};

/// A script, and the number of lanes in which it is coded.
fn scripts() -> impl Strategy<Value = (usize, Vec<Ask>)> {
    let value = (any::<u64>(), 0_u32..64).prop_map(|(value, shift)| value >> shift);
    let set = prop_oneof![Just(0xffff), any::<u16>()];
    let entry = (0_u8..5, any::<u8>(), 0_u8..24, set, value);
    (1..=LANES, prop::collection::vec(entry, 0..150)).prop_map(|(lanes, entries)| {
        let used = (1_u32 << lanes) - 1;
        let entries = entries.into_iter().map(|(kind, slot, context, set, value)| Ask {
            kind,
            slot,
            context,
            set: u32::from(set) & used,
            value,
        });
        (lanes, entries.collect())
    })
}

/// Changes the script so that each slot has one kind of number, as in files. With several kinds in one slot, its table has
/// tokens that are too large for some kinds. A decoder reads these as the largest token that is not too large.
fn one_kind_a_slot(script: Vec<Ask>) -> Vec<Ask> {
    let slots = Slot::all().count();
    let kind = |slot: u8| u8::try_from(usize::from(slot) % slots % 5).unwrap();
    script.into_iter().map(|a| Ask { kind: kind(a.slot), ..a }).collect()
}

/// A coded script.
struct Coded {
    tables: Tables,
    histograms: Vec<Histogram>,
    recorder: SymbolRecorder,
    values: Vec<[u64; LANES]>,
    range: Vec<u8>,
}

fn coded(lanes: usize, script: &[Ask]) -> Coded {
    let mut recorder = SymbolRecorder::default();
    let values = script.iter().map(|a| ask(&mut recorder, a)).collect();
    let (histograms, tables) = tables_of(&recorder).unwrap();
    let range = recorder.finish(&tables, lanes);
    Coded { tables, histograms, recorder, values, range }
}

/// Decodes `range`. Returns the values, and whether nothing was left of the range; `None` if the range is refused.
fn played(tables: &Tables, range: &[u8], lanes: usize, script: &[Ask]) -> Option<(Vec<[u64; LANES]>, bool)> {
    let lookup = Lookup::new(tables);
    let mut player = SymbolDecoder::new(&lookup, range, lanes, false).ok()?;
    let values = script.iter().map(|a| ask(&mut player, a)).collect();
    Some((values, player.check_end().is_ok()))
}

/// A plain decoder of one lane: a state of 64 bits, and the words that follow.
struct Naive<'a> {
    tables: &'a Tables,
    /// The symbols that occur in each context.
    symbols: &'a [Vec<u8>],
    words: Vec<u64>,
    state: u64,
}

impl<'a> Naive<'a> {
    /// Creates the decoders of all lanes of a range.
    fn all(tables: &'a Tables, symbols: &'a [Vec<u8>], range: &[u8], lanes: usize) -> Vec<Self> {
        // Short ranges have lengths of two bytes.
        let width = if range.len() < 1 << 17 { 2 } else { 4 };
        let (lengths, words) = range.split_at(width * (lanes - 1));
        let word = |pair: &[u8]| u64::from(pair[0]) + 256 * u64::from(pair[1]);
        let mut words: Vec<u64> = words.chunks(2).map(word).collect();
        let mut out = Vec::new();
        for l in 0..lanes {
            let length = lengths.get(width * l..width * (l + 1));
            let number =
                |bytes: &[u8]| bytes.iter().rev().fold(0, |sum, byte| 256 * sum + usize::from(*byte));
            let length = length.map_or(words.len(), number);
            let mut own: Vec<u64> = words.drain(..length).collect();
            let state = own.remove(0) * 65_536 + own.remove(0);
            out.push(Self { tables, symbols, words: own, state });
        }
        out
    }

    /// A state is at least 65,536.
    fn refill(&mut self) {
        if self.state < 65_536 {
            self.state = self.state * 65_536 + self.words.remove(0);
        }
    }

    fn symbol(&mut self, slot: Slot, context: u32) -> u64 {
        let table = slot.number * CONTEXTS + (context as usize).min(CONTEXTS - 1);
        let whole = 1_u64
            << if (Stream::Atom0 as usize..=Stream::Atom2 as usize).contains(&(slot.stream as usize)) {
                12
            } else {
                10
            };
        let low = self.state % whole;
        for &symbol in &self.symbols[table] {
            let interval = self.tables.interval(table, symbol);
            let (start, share) = (u64::from(interval.start), u64::from(interval.share));
            if (start..start + share).contains(&low) {
                self.state = share * (self.state / whole) + low - start;
                self.refill();
                return symbol.into();
            }
        }
        panic!("no symbol has {low} in context {table}");
    }

    fn bits(&mut self, count: u32) -> u64 {
        let (mut value, mut taken) = (0, 0);
        while taken < count {
            let piece = 16.min(count - taken);
            value += (self.state % (1 << piece)) << taken;
            self.state /= 1 << piece;
            self.refill();
            taken += piece;
        }
        value
    }

    fn integer(&mut self, slot: Slot, context: u32) -> u64 {
        let token = self.symbol(slot, context);
        if token < 16 {
            return token;
        }
        // Numbers of five bits and more have two tokens for each length, by the bit after the leading one.
        let low = u32::try_from((token - 16) / 2).unwrap() + 3;
        // More than 32 bits come as two numbers, the low bits first.
        let first = self.bits(low.min(32));
        let second = self.bits(low.saturating_sub(32));
        ((2 + token % 2) << low) + (second << 32) + first
    }

    /// Decodes the value of lane `l` of an entry.
    fn ask(&mut self, a: &Ask, l: usize) -> u64 {
        let slot = Slot::all().nth(usize::from(a.slot) % Slot::all().count()).unwrap();
        let context = u32::from(a.context) + u32::from(l % 3 == 2);
        match a.kind {
            0 => self.symbol(slot, context),
            1 => self.bits(context % 33),
            2 | 4 => self.integer(slot, context),
            _ => {
                let value = i64::try_from(self.integer(slot, context)).unwrap();
                let signed = if value & 1 == 0 { value / 2 } else { -(value + 1) / 2 };
                u64::from(i32::try_from(signed).unwrap().cast_unsigned())
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn scripts_come_back((lanes, script) in scripts()) {
        let Coded { tables, range, values, .. } = coded(lanes, &script);
        let read = Tables::read(&tables.write()).unwrap();
        prop_assert_eq!(played(&read, &range, lanes, &script), Some((values, true)));
    }

    #[test]
    fn a_plain_decoder_finds_the_same((lanes, script) in scripts()) {
        let Coded { tables, recorder, range, values, .. } = coded(lanes, &script);
        let mut symbols = vec![Vec::new(); ALL_CONTEXTS];
        recorder.each(|context, symbol| symbols[context].push(symbol), |_, _| ());
        symbols.iter_mut().for_each(|symbols| {
            symbols.sort_unstable();
            symbols.dedup();
        });
        let mut naive = Naive::all(&tables, &symbols, &range, lanes);
        for (a, expected) in script.iter().zip(&values) {
            for (l, lane) in naive.iter_mut().enumerate().filter(|(l, _)| a.set >> l & 1 == 1) {
                prop_assert_eq!(lane.ask(a, l), expected[l]);
            }
        }
        for lane in naive {
            prop_assert_eq!((lane.state, lane.words.len()), (65_536, 0));
        }
    }

    /// The length is what the tables say, plus two words for the state of each lane and two bytes or four for each length.
    #[test]
    fn bits_are_those_of_the_tables((lanes, script) in scripts()) {
        let Coded { tables, histograms, recorder, range, .. } = coded(lanes, &script);
        let mut raw = 0;
        recorder.each(|_, _| (), |_, bits| raw += bits);
        let modelled: f64 = histograms.iter().enumerate().map(|(c, h)| tables.bits(c, h)).sum();
        let bits = f64::from(raw) + modelled;
        let written = 8.0 * range.len() as f64;
        let lengths = if range.len() < 1 << 17 { 16.0 } else { 32.0 } * (lanes - 1) as f64;
        // Of the 32 bits of a state, 16 are those with which it starts. Shares are rounded down in states of 16 bits or
        // more.
        prop_assert!(written >= bits + lengths - 1.0);
        prop_assert!(written <= 1.01 * bits + lengths + 32.0 * lanes as f64, "{written} for {bits}");
        let lookup = Lookup::new(&tables);
        let mut player = SymbolDecoder::new(&lookup, &range, lanes, true).unwrap();
        for a in &script {
            ask(&mut player, a);
        }
        let counted: f64 = player.bit_counts.unwrap().0.iter().sum();
        prop_assert!((counted - bits).abs() <= 1e-9 * bits.max(1.0));
    }

    #[test]
    fn entries_can_be_put_back((lanes, script) in scripts()) {
        let Coded { tables, recorder, range, .. } = coded(lanes, &script);
        let again = SymbolRecorder::restore(recorder.entries().to_vec());
        prop_assert_eq!(again.finish(&tables, lanes), range);
    }

    /// Coding is one to one: with other words, words are left over or values differ.
    #[test]
    fn other_words_are_noticed((lanes, script) in scripts(), at in any::<prop::sample::Index>(), change in 1..=u8::MAX) {
        let script = one_kind_a_slot(script);
        let Coded { tables, range, values, .. } = coded(lanes, &script);
        let mine = Some((values, true));
        let mut changed = range.clone();
        changed[at.index(range.len())] ^= change;
        let shorter = range[..at.index(range.len())].to_vec();
        let longer = [range.as_slice(), &[change, 0]].concat();
        for other in [changed, shorter, longer] {
            prop_assert!(played(&tables, &other, lanes, &script) != mine);
        }
    }

    #[test]
    fn anything_is_played(bytes in prop::collection::vec(any::<u8>(), 0..300), (lanes, script) in scripts()) {
        let Coded { tables, .. } = coded(lanes, &script);
        let _ = played(&tables, &bytes, lanes, &script);
    }
}

#[test]
fn nothing_takes_the_states_alone() {
    let Coded { range, values, tables, .. } = coded(3, &[]);
    // Two lengths of two words, and three states of 65,536, high word first.
    assert_eq!(range, [2, 0, 2, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    assert_eq!(played(&tables, &range, 3, &[]), Some((values, true)));
    let lookup = Lookup::new(&tables);
    for (bytes, lanes) in [(&range[..4], 3), (&range[..3], 3), (&range[..15], 3), (&[0, 0][..], 1), (&[], 1)]
    {
        assert!(SymbolDecoder::new(&lookup, bytes, lanes, false).is_err(), "{bytes:?}");
    }
    assert!(SymbolDecoder::new(&lookup, &range, 0, false).is_err());
}

#[test]
fn contexts_without_a_table_are_damage() {
    let Coded { tables, range, .. } = coded(1, &[]);
    let symbol = Ask { kind: 0, slot: 0, context: 0, set: 1, value: 0 };
    assert!(matches!(played(&tables, &range, 1, &[symbol]), Some((_, false))));
}
