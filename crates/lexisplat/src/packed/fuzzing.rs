//! The entropy decoders by themselves, for the fuzz targets. No part of the crate's interface.

use super::Packed;
use super::entropy::{CONTEXTS, Histogram, SymbolReader, Tables};
use super::stream::{BitCounts, Stream, SymbolDecoder, SymbolEncoder, Symbols};

/// Symbols of the widest alphabet, that of atoms.
const SYMBOLS: u64 = 1 << 10;

/// Codes what one entry of a script asks for.
fn ask<S: Symbols>(s: &mut S, [stream, context]: [u8; 2], value: u64) -> u64 {
    let kind = stream / 32 % 3;
    let stream = Stream::ALL[usize::from(stream) % Stream::ALL.len()];
    let context = usize::from(context) % CONTEXTS;
    match kind {
        0 => s.integer(stream, context, || value),
        1 => u64::from(s.symbol(stream, context, || u16::try_from(value % SYMBOLS).unwrap_or(0))),
        _ => {
            let count = u32::try_from(context * 64 / (CONTEXTS - 1)).unwrap_or(0);
            let mask = 1_u64.checked_shl(count).map_or(u64::MAX, |bit| bit - 1);
            s.bits(stream, count, || value & mask)
        }
    }
}

/// Reads `tables`, and with them the modelled symbols of `symbols` and the bits of `raw`. Each two bytes of
/// `script` say what is read next and in which context. Returns whether everything was read to its end, and not
/// beyond.
///
/// # Panics
/// If tables that were read are not the same once written and read again.
#[must_use]
pub fn decode(tables: &[u8], symbols: &[u8], raw: &[u8], script: &[u8]) -> bool {
    let Some(tables) = Tables::read(tables, Stream::ALL.len()) else { return false };
    let written = tables.write();
    let again = Tables::read(&written, Stream::ALL.len()).map(|tables| tables.write());
    assert_eq!(again.as_deref(), Some(written.as_slice()), "tables change as they are written");
    let Some(mut player) = SymbolDecoder::new(&tables, symbols, raw) else { return false };
    player.bit_counts = Some(BitCounts::default());
    for &what in script.as_chunks::<2>().0 {
        ask(&mut player, what, 0);
    }
    assert!(
        player.bit_counts.is_some_and(|bit_counts| bit_counts.0.iter().all(|b| b.is_finite() && *b >= 0.0))
    );
    player.exhausted() && !player.overrun()
}

/// Codes `values`, each with its two bytes of a script as in [`decode`], and decodes them. Returns whether they came
/// back and nothing was left.
#[must_use]
pub fn round_trip(values: &[(u8, u8, u64)]) -> bool {
    let mut recorder = SymbolEncoder::default();
    let coded: Vec<u64> =
        values.iter().map(|&(stream, context, value)| ask(&mut recorder, [stream, context], value)).collect();
    let mut histograms = vec![Histogram::default(); Stream::ALL.len() * CONTEXTS];
    recorder.count(&mut histograms);
    let Some(tables) = Tables::new(&histograms) else { return false };
    let [symbols, raw] = recorder.finish(&tables);
    let Some(read) = Tables::read(&tables.write(), Stream::ALL.len()) else { return false };
    let Some(mut player) = SymbolDecoder::new(&read, &symbols, &raw) else { return false };
    let decoded = values.iter().map(|&(stream, context, _)| ask(&mut player, [stream, context], 0));
    // Decodes everything, even after a difference.
    let decoded: Vec<u64> = decoded.collect();
    decoded == coded && player.exhausted() && SymbolReader::new(&symbols).is_some()
}

/// The input of [`decode`]: the tables, and the modelled symbols and raw bits of the first chunk, which are empty if
/// there is none.
#[must_use]
pub fn parts(packed: &Packed) -> [&[u8]; 3] {
    let length = |k: usize| packed.head().lengths.get(k).map_or(0, |&l| l as usize);
    let symbols = length(0) + length(1);
    let raw = symbols + length(2);
    let part = |from: usize, to: usize| packed.data().get(from..to).unwrap_or_default();
    [&packed.head().tables, part(symbols, raw), part(raw, raw + length(3))]
}
