//! The entropy coder alone, for the fuzz targets. It is not part of the crate's interface.

use crate::packed::Packed;
use crate::packed::bitstream::head::Head;
use crate::packed::bitstream::index::RangeId;
use crate::packed::entropy::lanes::LANES;
use crate::packed::entropy::rans_decoder::SymbolDecoder;
use crate::packed::entropy::rans_encoder::SymbolRecorder;
use crate::packed::entropy::script::{Ask, ask, tables_of};
use crate::packed::entropy::tables::{Lookup, Tables};
use crate::scene::sh::ShDegree;

/// Number of bytes of an entry of a script of [`decode`].
const ENTRY: usize = 5;

/// Decodes `range`, of 1 to 16 lanes, with `tables`. Each five bytes of `script` say what is decoded next, in which
/// contexts and for which lanes. Returns whether everything was decoded to the end of the range, and not beyond.
///
/// # Panics
/// If tables that were read are not the same after they are written and read again, or if the bits that were read cannot be
/// counted.
#[must_use]
pub fn decode(tables: &[u8], range: &[u8], lanes: u8, script: &[u8]) -> bool {
    let Ok(tables) = Tables::read(tables) else { return false };
    let written = tables.write();
    let again = Tables::read(&written).map(|tables| tables.write());
    assert_eq!(again.as_deref(), Ok(written.as_slice()), "tables change as they are written");
    let lookup = Lookup::new(&tables);
    let Ok(mut player) = SymbolDecoder::new(&lookup, range, 1 + usize::from(lanes) % LANES, true) else {
        return false;
    };
    for &[kind, slot, context, low, high] in script.as_chunks::<ENTRY>().0 {
        let set = u16::from_le_bytes([low, high]).into();
        ask(&mut player, &Ask { kind, slot, context, set, value: 0 });
    }
    let counts = player.bit_counts.as_ref();
    assert!(counts.is_some_and(|counts| counts.0.iter().all(|b| b.is_finite() && *b >= 0.0)));
    player.check_end().is_ok()
}

/// An entry of a script of [`round_trip`]: kind, set of contexts and context; lanes; value.
pub type Entry = ([u8; 3], u16, u64);

/// Encodes a script in 1 to 16 lanes, and decodes it. Returns whether all values came back and no bytes were left.
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
    let mut recorder = SymbolRecorder::default();
    let coded: Vec<[u64; LANES]> = asks.iter().map(|a| ask(&mut recorder, a)).collect();
    let Some((_, tables)) = tables_of(&recorder) else { return false };
    let range = recorder.finish(&tables, lanes);
    let Ok(read) = Tables::read(&tables.write()) else { return false };
    let lookup = Lookup::new(&read);
    let Ok(mut player) = SymbolDecoder::new(&lookup, &range, lanes, false) else { return false };
    // All values are decoded, even after a difference.
    let decoded: Vec<[u64; LANES]> = asks.iter().map(|a| ask(&mut player, a)).collect();
    decoded == coded && player.check_end().is_ok()
}

/// Returns the input of [`decode`]: the tables and the first range of a packed scene. Both are empty if the head cannot be
/// read.
#[must_use]
pub fn parts(packed: &Packed) -> [Vec<u8>; 2] {
    let Ok(head) = Head::read(&packed.head().bytes, packed.head().degree.rest()) else {
        return Default::default();
    };
    let length = head.index.order.first().and_then(|id| {
        let chunk = head.index.chunks.get(id.chunk as usize)?;
        Some(chunk.ranges.get(usize::from(id.kind))?.length as usize)
    });
    [head.tables, packed.data().get(..length.unwrap_or(0)).unwrap_or_default().to_vec()]
}

/// Returns `head` with the checksums of the ranges of `data`. `degree` is the SH degree of the scene. `None` if the head
/// cannot be read.
#[must_use]
pub fn resealed(head: &[u8], degree: ShDegree, data: &[u8]) -> Option<Vec<u8>> {
    let mut head = Head::read(head, degree.rest()).ok()?;
    for range in head.index.chunks.iter_mut().flat_map(|chunk| &mut chunk.ranges) {
        let start = usize::try_from(range.start).ok()?;
        let bytes = data.get(start..).and_then(|rest| rest.get(..range.length as usize));
        range.checksum = crc32fast::hash(bytes.unwrap_or_default());
    }
    Some(head.write())
}

/// Number of Gaussians of a scene from which on chunks are not copied.
const MOST_COPIED: usize = 1 << 12;

/// Changes the chunks or the ranges of a scene of `head` and `data`: copies or removes a chunk, swaps two ranges, moves
/// bytes from one range to another, or changes the cell and the bounds of a chunk. Checksums of ranges are not changed.
/// Returns the head, the data and the number of Gaussians; `None` if there is nothing to change. `below(n)` returns a
/// number below `n`.
#[must_use]
pub fn rearranged(
    head: &[u8],
    degree: ShDegree,
    data: &[u8],
    below: &mut dyn FnMut(usize) -> usize,
) -> Option<(Vec<u8>, Vec<u8>, usize)> {
    let mut head = Head::read(head, degree.rest()).ok()?;
    let index = &mut head.index;
    let bytes = |id: &RangeId| {
        let range = index.chunks.get(id.chunk as usize)?.ranges.get(usize::from(id.kind))?;
        let rest = data.get(usize::try_from(range.start).ok()?..)?;
        Some((*id, rest.get(..range.length as usize)?.to_vec()))
    };
    let mut ranges: Vec<(RangeId, Vec<u8>)> = index.order.iter().map(bytes).collect::<Option<_>>()?;
    let c = below(index.chunks.len());
    let chunk = index.chunks.get(c)?.clone();
    let c = u32::try_from(c).ok()?;
    let (a, b) = (below(ranges.len()), below(ranges.len()));
    match below(8) {
        0..=2 if index.gaussians() < MOST_COPIED => {
            let own: Vec<(RangeId, Vec<u8>)> = ranges.iter().filter(|(p, _)| p.chunk == c).cloned().collect();
            ranges.iter_mut().filter(|(p, _)| p.chunk > c).for_each(|(p, _)| p.chunk += 1);
            ranges.extend(own.into_iter().map(|(p, bytes)| (RangeId { chunk: c + 1, ..p }, bytes)));
            index.chunks.insert(c as usize + 1, chunk);
        }
        3 => {
            index.chunks.remove(c as usize);
            ranges.retain(|(p, _)| p.chunk != c);
            ranges.iter_mut().filter(|(p, _)| p.chunk > c).for_each(|(p, _)| p.chunk -= 1);
        }
        4 | 5 => ranges.swap(a, b),
        6 => {
            let at = below(ranges.get(a)?.1.len() + 1);
            let moved = ranges.get_mut(a)?.1.split_off(at);
            ranges.get_mut(b)?.1.extend(moved);
        }
        _ => {
            let chunk = index.chunks.get_mut(c as usize)?;
            chunk.cell = chunk.cell.wrapping_add(1 << below(64));
            chunk.bounds.iter_mut().for_each(|bound| bound.rotate_left(1));
        }
    }
    index.order = ranges.iter().map(|(id, _)| *id).collect();
    for (id, bytes) in &ranges {
        let range = index.chunks.get_mut(id.chunk as usize)?.ranges.get_mut(usize::from(id.kind))?;
        range.length = u32::try_from(bytes.len()).ok()?;
    }
    index.lay_out()?;
    let gaussians = index.gaussians();
    let data = ranges.into_iter().flat_map(|(_, bytes)| bytes).collect();
    Some((head.write(), data, gaussians))
}
