//! The index of a file: its layers, their chunks, and where the ranges of each lie.

use super::bytes::ByteReader;
use super::walk::MAX_LEVELS;

/// Most layers of a file.
const MAX_LAYERS: usize = 8;
/// Most passes of a file.
const MAX_PASSES: usize = 64;
/// Most Gaussians of a chunk. A decoder needs memory for as many.
const MAX_CHUNK: usize = 1 << 16;
/// A Gaussian takes at least this many bits of the base: one for each code of its rotation.
const LEAST_BITS: u64 = 3;

/// A range of the data of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::packed) struct Range {
    /// Where it starts in the data.
    pub(in crate::packed) start: u64,
    pub(in crate::packed) length: u32,
    /// CRC-32 of its bytes.
    pub(in crate::packed) checksum: u32,
    /// CRC-32 of the integers that it decodes to.
    pub(in crate::packed) integers: u32,
}

/// A chunk of a layer.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Chunk {
    pub(in crate::packed) layer: usize,
    /// Number of its first Gaussian in the file.
    pub(in crate::packed) first: usize,
    pub(in crate::packed) gaussians: usize,
    /// Least and largest coordinates of its positions. No decoder needs them.
    pub(in crate::packed) bounds: [[f32; 3]; 2],
    /// A base, levels of refinement, and parts of nonzeros.
    pub(in crate::packed) ranges: Vec<Range>,
}

/// Ranges of one layer that lie side by side: chunk after chunk, of each those in the set in ascending order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::packed) struct Pass {
    pub(in crate::packed) layer: u8,
    /// A bit for each range of a chunk.
    pub(in crate::packed) ranges: u8,
}

impl Pass {
    pub(in crate::packed) fn has(self, range: usize) -> bool {
        self.ranges >> range & 1 == 1
    }
}

/// The layers, chunks and passes of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Index {
    /// Levels of refinement of each layer.
    pub(in crate::packed) levels: Vec<u8>,
    /// In the order of the data.
    pub(in crate::packed) passes: Vec<Pass>,
    /// Layer by layer.
    pub(in crate::packed) chunks: Vec<Chunk>,
}

impl Index {
    /// Numbers the Gaussians and places the ranges of all chunks. `None` if there are more than memory counts.
    pub(in crate::packed) fn place(&mut self) -> Option<()> {
        let mut first = 0_usize;
        for chunk in &mut self.chunks {
            chunk.first = first;
            first = first.checked_add(chunk.gaussians)?;
        }
        let mut start = 0_u64;
        for pass in &self.passes {
            for chunk in self.chunks.iter_mut().filter(|chunk| chunk.layer == usize::from(pass.layer)) {
                let ranges = chunk.ranges.iter_mut().enumerate().filter(|(k, _)| pass.has(*k));
                for (_, range) in ranges {
                    range.start = start;
                    start = start.checked_add(range.length.into())?;
                }
            }
        }
        Some(())
    }

    /// Number of Gaussians.
    pub(in crate::packed) fn gaussians(&self) -> usize {
        self.chunks.last().map_or(0, |chunk| chunk.first + chunk.gaussians)
    }

    /// Bytes of all ranges.
    pub(in crate::packed) fn data_bytes(&self) -> u64 {
        self.chunks.iter().flat_map(|chunk| &chunk.ranges).map(|range| u64::from(range.length)).sum()
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        out.push(self.levels.len() as u8);
        for (layer, &levels) in self.levels.iter().enumerate() {
            let chunks = self.chunks.iter().filter(|chunk| chunk.layer == layer).count();
            out.push(levels);
            out.extend((chunks as u32).to_le_bytes());
        }
        out.push(self.passes.len() as u8);
        out.extend(self.passes.iter().flat_map(|pass| [pass.layer, pass.ranges]));
        for chunk in &self.chunks {
            out.extend((chunk.gaussians as u32).to_le_bytes());
            out.extend(chunk.bounds.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
            for range in &chunk.ranges {
                out.extend(
                    [range.length, range.checksum, range.integers].iter().flat_map(|x| x.to_le_bytes()),
                );
            }
        }
    }

    /// Reads what [`Self::write`] wrote for chunks with `parts` parts of nonzeros; `None` for anything else.
    pub(super) fn read(from: &mut ByteReader<'_>, parts: usize) -> Option<Self> {
        let layers = usize::from(from.u8()?);
        if layers > MAX_LAYERS {
            return None;
        }
        let mut index = Self::default();
        let mut counts = Vec::with_capacity(layers);
        for _ in 0..layers {
            let levels = from.u8()?;
            if usize::from(levels) > MAX_LEVELS {
                return None;
            }
            index.levels.push(levels);
            counts.push(from.u32()?);
        }
        let passes = usize::from(from.u8()?);
        if passes > MAX_PASSES {
            return None;
        }
        for _ in 0..passes {
            index.passes.push(Pass { layer: from.u8()?, ranges: from.u8()? });
        }
        for (layer, count) in counts.into_iter().enumerate() {
            let ranges = 1 + usize::from(index.levels[layer]) + parts;
            if !passes_are_whole(&index.passes, layer, ranges) {
                return None;
            }
            for _ in 0..count {
                // Every chunk takes bytes of the index, so their number is bounded by its length.
                let gaussians = from.u32()? as usize;
                let bounds = [from.f32s()?, from.f32s()?];
                let mut chunk =
                    Chunk { layer, first: 0, gaussians, bounds, ranges: Vec::with_capacity(ranges) };
                for _ in 0..ranges {
                    let (length, checksum, integers) = (from.u32()?, from.u32()?, from.u32()?);
                    chunk.ranges.push(Range { start: 0, length, checksum, integers });
                }
                let bits = u64::from(chunk.ranges.first()?.length) * 8;
                if !(1..=MAX_CHUNK).contains(&gaussians) || gaussians as u64 * LEAST_BITS > bits {
                    return None;
                }
                index.chunks.push(chunk);
            }
        }
        if index.passes.iter().any(|pass| usize::from(pass.layer) >= layers) {
            return None;
        }
        index.place()?;
        Some(index)
    }
}

/// Whether each of the `ranges` of a layer is in one pass, and none in a pass before the base.
fn passes_are_whole(passes: &[Pass], layer: usize, ranges: usize) -> bool {
    let mut seen = 0_u8;
    for pass in passes.iter().filter(|pass| usize::from(pass.layer) == layer) {
        if pass.ranges == 0 || seen & pass.ranges != 0 || (seen | pass.ranges) & 1 == 0 {
            return false;
        }
        seen |= pass.ranges;
    }
    u32::from(seen) == (1 << ranges) - 1
}
