//! The entropy decoder of version 2 by itself, for the fuzz targets. No part of the crate's interface.

use super::streams::Stream;
use super::symbols::SymbolDecoder;
use super::tables::{CONTEXTS, Tables};
use crate::packed::Packed;
use crate::packed::scene::Coding;
use crate::packed::stream::BitCounts;

/// Decodes what one entry of a script asks for.
fn ask(s: &mut SymbolDecoder<'_>, [stream, context]: [u8; 2]) {
    let kind = stream / 32 % 3;
    let stream = Stream::ALL[usize::from(stream) % Stream::ALL.len()];
    let context = usize::from(context) % CONTEXTS;
    match kind {
        0 => s.integer(stream, context),
        1 => s.symbol(stream, context).into(),
        _ => s.bits(stream, u32::try_from(context * 64 / (CONTEXTS - 1)).unwrap_or(0)),
    };
}

/// Reads `tables`, and with them the modelled symbols of `symbols` and the bits of `raw`. Each two bytes of
/// `script` say what is read next and in which context. Returns whether everything was read to its end, and not
/// beyond.
///
/// # Panics
/// If the bits that were read cannot be counted.
#[must_use]
pub fn decode(tables: &[u8], symbols: &[u8], raw: &[u8], script: &[u8]) -> bool {
    let Some(tables) = Tables::read(tables, Stream::ALL.len()) else { return false };
    let Some(mut player) = SymbolDecoder::new(&tables, symbols, raw) else { return false };
    player.bit_counts = Some(BitCounts::zeros(Stream::ALL.len()));
    for &what in script.as_chunks::<2>().0 {
        ask(&mut player, what);
    }
    let counts = player.bit_counts.as_ref();
    assert!(counts.is_some_and(|counts| counts.0.iter().all(|b| b.is_finite() && *b >= 0.0)));
    player.exhausted() && !player.overrun()
}

/// The input of [`decode`]: the tables, and the modelled symbols and raw bits of the first chunk, which are empty if
/// there is none.
#[must_use]
pub fn parts(packed: &Packed) -> [&[u8]; 3] {
    let Coding::Flat(flat) = &packed.head().coding else { return Default::default() };
    let length = |k: usize| flat.lengths.get(k).map_or(0, |&l| l as usize);
    let symbols = length(0) + length(1);
    let raw = symbols + length(2);
    let part = |from: usize, to: usize| packed.data().get(from..to).unwrap_or_default();
    [&flat.tables, part(symbols, raw), part(raw, raw + length(3))]
}
