//! The entropy coder of version 3 by itself, for the fuzz targets. No part of the crate's interface.

use super::head::Head;
use super::player::Player;
use super::range::Recorder;
use super::script::{Ask, ask, tables_of};
use super::symbols::LANES;
use super::tables::{Lookup, Tables};
use crate::packed::Packed;
use crate::packed::scene::Coding;
use crate::scene::sh::ShDegree;

/// Bytes of an entry of a script of [`decode`].
const ENTRY: usize = 5;

/// Reads `tables`, and with them `range`, of up to 16 lanes. Each five bytes of `script` say what is read next, in which
/// contexts and for which lanes. Returns whether everything was read to its end, and not beyond.
///
/// # Panics
/// If tables that were read are not the same once written and read again, or if the bits that were read cannot be counted.
#[must_use]
pub fn decode(tables: &[u8], range: &[u8], lanes: u8, script: &[u8]) -> bool {
    let Some(tables) = Tables::read(tables) else { return false };
    let written = tables.write();
    let again = Tables::read(&written).map(|tables| tables.write());
    assert_eq!(again.as_deref(), Some(written.as_slice()), "tables change as they are written");
    let lookup = Lookup::new(&tables);
    let Some(mut player) = Player::new(&lookup, range, 1 + usize::from(lanes) % LANES, true) else {
        return false;
    };
    for &[kind, slot, context, low, high] in script.as_chunks::<ENTRY>().0 {
        let set = u16::from_le_bytes([low, high]).into();
        ask(&mut player, &Ask { kind, slot, context, set, value: 0 });
    }
    let counts = player.bit_counts.as_ref();
    assert!(counts.is_some_and(|counts| counts.0.iter().all(|b| b.is_finite() && *b >= 0.0)));
    player.exhausted()
}

/// What [`round_trip`] codes next: kind, set of contexts, context, lanes and value.
pub type Entry = ([u8; 3], u16, u64);

/// Codes what a script asks for in `lanes` lanes, and decodes it. Returns whether it came back and nothing was left.
#[must_use]
pub fn round_trip(lanes: u8, script: &[Entry]) -> bool {
    let lanes = 1 + usize::from(lanes) % LANES;
    let used = (1_u32 << lanes) - 1;
    let asks = script.iter().map(|&([kind, slot, context], set, value)| Ask {
        kind,
        slot,
        context,
        set: u32::from(set) & used,
        value,
    });
    let asks: Vec<Ask> = asks.collect();
    let mut recorder = Recorder::default();
    let coded: Vec<[u64; LANES]> = asks.iter().map(|a| ask(&mut recorder, a)).collect();
    let Some((_, tables)) = tables_of(&recorder) else { return false };
    let range = recorder.finish(&tables, lanes);
    let Some(read) = Tables::read(&tables.write()) else { return false };
    let lookup = Lookup::new(&read);
    let Some(mut player) = Player::new(&lookup, &range, lanes, false) else { return false };
    // Decodes everything, even after a difference.
    let decoded: Vec<[u64; LANES]> = asks.iter().map(|a| ask(&mut player, a)).collect();
    decoded == coded && player.exhausted()
}

/// The input of [`decode`]: the tables and the first range of a packed scene of version 3, empty if there are none.
#[must_use]
pub fn parts(packed: &Packed) -> [Vec<u8>; 2] {
    let Coding::Layered(bytes) = &packed.head().coding else { return Default::default() };
    let Some(head) = Head::read(bytes, packed.head().degree.rest()) else { return Default::default() };
    let length = head.index.order.first().and_then(|place| {
        let chunk = head.index.chunks.get(place.chunk as usize)?;
        Some(chunk.ranges.get(usize::from(place.kind))?.length as usize)
    });
    [head.tables, packed.data().get(..length.unwrap_or(0)).unwrap_or_default().to_vec()]
}

/// `head`, of a scene of this degree, with the checksums of the ranges of `data`; `None` if it cannot be read.
#[must_use]
pub fn resealed(head: &[u8], degree: ShDegree, data: &[u8]) -> Option<Vec<u8>> {
    let mut head = Head::read(head, degree.rest())?;
    for range in head.index.chunks.iter_mut().flat_map(|chunk| &mut chunk.ranges) {
        let start = usize::try_from(range.start).ok()?;
        let bytes = data.get(start..).and_then(|rest| rest.get(..range.length as usize));
        range.checksum = crc32fast::hash(bytes.unwrap_or_default());
    }
    Some(head.write())
}
