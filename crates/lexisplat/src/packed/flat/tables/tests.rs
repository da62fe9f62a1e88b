//! Tables and words that were written by hand come back. Golden files hold what encoders wrote.

#![expect(clippy::cast_possible_truncation, reason = "test values fit")]

use proptest::prelude::*;

use super::*;
use crate::packed::bits::BitWriter;

/// Lengths and low bits of the counts of one table, as it is written.
type Counts = Vec<(u32, u32)>;

/// A stream whose contexts use these tables in turn.
fn write(tables: &[Counts]) -> Vec<u8> {
    let mut out = BitWriter::default();
    let mut last = 0;
    for context in 0..CONTEXTS {
        let cluster = context % tables.len().max(1);
        out.put(1, u64::from(cluster != last));
        if cluster != last {
            out.put(CLUSTER_BITS, cluster as u64);
        }
        last = cluster;
    }
    out.put(CLUSTER_BITS, tables.len() as u64);
    for counts in tables {
        out.put(SYMBOLS_BITS, counts.len() as u64);
        for &(length, low) in counts {
            out.put(LENGTH_BITS, length.into());
            let kept = length.saturating_sub(1).min(MANTISSA_BITS);
            out.put(kept, u64::from(low) & ((1 << kept) - 1));
        }
    }
    out.finish()
}

/// The count that is written with this length and these low bits.
fn count((length, low): (u32, u32)) -> u64 {
    if length == 0 {
        return 0;
    }
    let kept = (length - 1).min(MANTISSA_BITS);
    (1 << kept | u64::from(low) & ((1 << kept) - 1)) << (length - 1 - kept)
}

/// Some tables of a stream, and which context and which of its symbols come one after the other.
fn sequences() -> impl Strategy<Value = (Vec<Counts>, Vec<(usize, prop::sample::Index)>)> {
    let counts = prop_oneof![
        prop::collection::vec((0_u32..15, any::<u32>()), 1..40),
        prop::collection::vec((0_u32..3, any::<u32>()), 500..MAX_SYMBOLS),
    ];
    let some = counts.prop_filter("a table has symbols", |counts| counts.iter().any(|&c| count(c) > 0));
    (
        prop::collection::vec(some, 1..5),
        prop::collection::vec((0..CONTEXTS, any::<prop::sample::Index>()), 0..400),
    )
}

/// Words of symbols: a state of 64 bits, from which 32 bits are taken where it is too large.
fn encode(symbols: &[(&Table, u16)]) -> Vec<u8> {
    let (mut state, mut words) = (0_u64, Vec::<u32>::new());
    for (table, symbol) in symbols.iter().rev() {
        let rank = usize::from(table.ranks[usize::from(*symbol)]);
        let share = u64::from(table.shares[rank]);
        let start: u64 = table.shares[..rank].iter().map(|&s| u64::from(s)).sum();
        if share == u64::from(TOTAL) {
            continue;
        }
        if state >> (u64::BITS - PRECISION as u32) >= share {
            words.push((state & u64::from(u32::MAX)) as u32);
            state >>= 32;
        }
        state = ((state / share) << PRECISION) + start + state % share;
    }
    while state > 0 {
        words.push((state & u64::from(u32::MAX)) as u32);
        state >>= 32;
    }
    words.iter().flat_map(|w| w.to_le_bytes()).collect()
}

/// What is read from `bytes` with these tables, and whether nothing is left.
fn decoded(symbols: &[(&Table, u16)], bytes: &[u8]) -> Option<(Vec<u16>, bool)> {
    let mut reader = SymbolReader::new(bytes)?;
    let found = symbols.iter().map(|(table, _)| reader.take(table)).collect();
    Some((found, reader.exhausted()))
}

/// The tables and the symbols of a sequence.
fn of<'t>(tables: &'t Tables, picks: &[(usize, prop::sample::Index)]) -> Vec<(&'t Table, u16)> {
    let symbol = |&(context, pick): &(usize, prop::sample::Index)| {
        let table = tables.table(0, context).unwrap();
        (table, table.symbols[pick.index(table.symbols.len())])
    };
    picks.iter().map(symbol).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn tables_are_what_was_written((all, picks) in sequences()) {
        let bytes = write(&all);
        let tables = Tables::read(&bytes, 1).unwrap();
        for context in 0..CONTEXTS {
            let table = tables.table(0, context).unwrap();
            let counts: Vec<u64> = all[context % all.len()].iter().map(|&c| count(c)).collect();
            let used: Vec<u16> = (0..).zip(&counts).filter(|(_, c)| **c > 0).map(|(s, _)| s).collect();
            prop_assert_eq!(&table.symbols, &used);
            prop_assert_eq!(table.shares.iter().map(|&s| u32::from(s)).sum::<u32>(), TOTAL);
            // All but the most frequent have the share that their count says, or one unit.
            let total: u64 = counts.iter().sum();
            let share = |c: u64| (c * u64::from(TOTAL) / total).max(1);
            let others = used.iter().zip(&table.shares);
            let differ = others.filter(|&(&s, &found)| u64::from(found) != share(counts[usize::from(s)]));
            prop_assert!(differ.count() <= 1 || used.len() > 500);
        }
        for (table, symbol) in of(&tables, &picks) {
            prop_assert!((0.0..=PRECISION as f64).contains(&table.bits(symbol)));
        }
        prop_assert!(Tables::read(&bytes[..bytes.len() - 1], 1).is_none());
        prop_assert!(Tables::read(&[&bytes[..], &[0]].concat(), 1).is_none());
    }

    #[test]
    fn symbols_come_back((all, picks) in sequences()) {
        let tables = Tables::read(&write(&all), 1).unwrap();
        let symbols = of(&tables, &picks);
        let expected: Vec<u16> = symbols.iter().map(|s| s.1).collect();
        prop_assert_eq!(decoded(&symbols, &encode(&symbols)), Some((expected, true)));
    }

    /// Coding is one to one: words that are not the encoder's are left over, or say something else.
    #[test]
    fn other_words_are_noticed((all, picks) in sequences(), word in 1..u32::MAX) {
        let tables = Tables::read(&write(&all), 1).unwrap();
        let symbols = of(&tables, &picks);
        let bytes = encode(&symbols);
        let mine = decoded(&symbols, &bytes);
        let more = [bytes.as_slice(), &word.to_le_bytes()].concat();
        let before = [&word.to_le_bytes(), bytes.as_slice()].concat();
        let mut changed = bytes.clone();
        changed.iter_mut().take(4).zip(word.to_le_bytes()).for_each(|(a, b)| *a ^= b);
        for other in [&more, &before, &changed, &bytes[4.min(bytes.len())..].to_vec()] {
            prop_assert!(*other == bytes || decoded(&symbols, other) != mine);
        }
        prop_assert!(SymbolReader::new(&[bytes.as_slice(), &[1]].concat()).is_none());
    }

    #[test]
    fn any_bytes_are_tables_or_not(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        if let Some(tables) = Tables::read(&bytes, 3) {
            for table in tables.tables.iter().flatten() {
                prop_assert_eq!(table.shares.iter().map(|&s| u32::from(s)).sum::<u32>(), TOTAL);
            }
        }
    }
}

#[test]
fn a_lone_symbol_costs_nothing() {
    let mut counts = vec![(0, 0); 501];
    counts[500] = (14, 7);
    let tables = Tables::read(&write(&[counts]), 1).unwrap();
    let table = tables.table(0, 7).unwrap();
    assert_eq!(table.bits(500), 0.0);
    let symbols = vec![(table, 500); 10_000];
    assert_eq!(decoded(&symbols, &[]), Some((vec![500; 10_000], true)));
}

#[test]
fn streams_need_no_tables() {
    let tables = Tables::read(&write(&[]), 1).unwrap();
    assert!((0..CONTEXTS).all(|context| tables.table(0, context).is_none()));
}
