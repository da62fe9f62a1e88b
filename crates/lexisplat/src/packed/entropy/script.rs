//! Scripts of values that are coded one after the other, for tests and fuzz targets of the entropy coder.

use crate::packed::bitstream::streams::Slot;
use crate::packed::entropy::lanes::{LANES, each};
use crate::packed::entropy::rans_encoder::SymbolRecorder;
use crate::packed::entropy::symbols::Symbols;
use crate::packed::entropy::tables::{ALL_CONTEXTS, Histogram, Tables};

/// One entry of a script.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Ask {
    /// The kind of value: 0 for bytes, 1 for raw bits, 2 for integers, 3 for integers with a sign, 4 for wide integers.
    pub(in crate::packed) kind: u8,
    pub(in crate::packed) slot: u8,
    /// The number from which the contexts of all lanes follow, and numbers of raw bits.
    pub(in crate::packed) context: u8,
    /// The set of lanes that are coded.
    pub(in crate::packed) set: u32,
    /// The number from which the values of all lanes follow.
    pub(in crate::packed) value: u64,
}

/// Codes the entry `ask`. Returns the values that an encoder coded or a decoder found. A value with a sign is returned as
/// the unsigned 32-bit number with the same bits.
#[expect(clippy::cast_possible_truncation, reason = "lanes are few, and values are cut to their bits")]
pub(in crate::packed) fn ask<S: Symbols>(s: &mut S, ask: &Ask) -> [u64; LANES] {
    let slots: Vec<Slot> = Slot::all().collect();
    let slot = slots[usize::from(ask.slot) % slots.len()];
    // Lanes have different contexts, but fewer contexts than values.
    let context = each(|l| u32::from(ask.context) + u32::from(l % 3 == 2));
    let value = |l: usize| ask.value.rotate_left(l as u32 % 5).wrapping_add(l as u64 % 3);
    let word = |l: usize| (value(l) & u64::from(u32::MAX)) as u32;
    match ask.kind % 5 {
        0 => s.symbols(slot, context, ask.set, |l| word(l) & 0xff).map(u64::from),
        1 => {
            let count = context.map(|c| c % 33);
            let bits = |l: usize| (value(l) & ((1 << count[l]) - 1)) as u32;
            s.bits(slot, count, ask.set, bits).map(u64::from)
        }
        2 => s.integers(slot, context, ask.set, word).map(u64::from),
        3 => s.signed(slot, context, ask.set, |l| word(l).cast_signed()).map(|v| v.cast_unsigned().into()),
        _ => s.wide(slot, context, ask.set, |l| value(l) >> 1),
    }
}

/// Counts how often each symbol was recorded in each context, and makes tables of the counts.
pub(in crate::packed) fn tables_of(recorder: &SymbolRecorder) -> Option<(Vec<Histogram>, Tables)> {
    let mut histograms = vec![Histogram::default(); ALL_CONTEXTS];
    recorder.each(|context, symbol| histograms[context].add(symbol), |_, _| ());
    let tables = Tables::new(&histograms)?;
    Some((histograms, tables))
}
