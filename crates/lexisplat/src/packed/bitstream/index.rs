//! The index of a file: its layers, their chunks, and the ranges of all chunks in the order of the data.

use super::broken::{BrokenHead, must};
use super::bytes::{ByteReader, Fields, put_bf16, put_number};
use super::chunk::LayerForm;
use super::coarseness::MAX_REFINEMENTS;

/// Most layers of a file.
pub(in crate::packed) const MAX_LAYERS: usize = 8;
/// Number of bits of the number of layers.
const LAYERS_BITS: u32 = 7;
/// Most Gaussians of a chunk. A decoder needs memory for all of them.
const MAX_CHUNK: usize = 1 << 16;
/// Least number of bits that a Gaussian takes in the base: one for each of the three codes of its rotation.
const LEAST_BITS: u64 = 3;

/// A range of the data of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::packed) struct Range {
    /// The offset in the data where the range starts.
    pub(in crate::packed) start: u64,
    pub(in crate::packed) length: u32,
    /// CRC-32 of its bytes.
    pub(in crate::packed) checksum: u32,
    /// CRC-32 of the integers that it decodes to.
    pub(in crate::packed) integers: u32,
}

impl Range {
    /// Returns the offset in the data where the range ends.
    pub(in crate::packed) fn end(&self) -> u64 {
        self.start.saturating_add(self.length.into())
    }
}

/// A chunk of a layer.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Chunk {
    pub(in crate::packed) layer: usize,
    /// Index of its first Gaussian in the file.
    pub(in crate::packed) first: usize,
    pub(in crate::packed) gaussians: usize,
    /// The number of the cell of its first Gaussian. The cells of its other Gaussians are not below it, and not above the
    /// first cell of the next chunk of the layer.
    pub(in crate::packed) cell: u64,
    /// Coordinates that are at most the least, and at least the largest, of its positions; zeros if it is the only chunk.
    /// No decoder needs them.
    pub(in crate::packed) bounds: [[f32; 3]; 2],
    /// The ranges by kind: the base, refinements, SH parts, and interim changes.
    pub(in crate::packed) ranges: Vec<Range>,
}

/// A range, by the index of its chunk and its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::packed) struct RangeId {
    pub(in crate::packed) chunk: u32,
    pub(in crate::packed) kind: u8,
}

/// The layers, chunks and ranges of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Index {
    pub(in crate::packed) layers: Vec<LayerForm>,
    /// All chunks, layer by layer.
    pub(in crate::packed) chunks: Vec<Chunk>,
    /// All ranges in the order of the data.
    pub(in crate::packed) order: Vec<RangeId>,
}

/// Returns the form of each layer. `refinements` holds the number of refinements of each. All layers but the last have
/// interim changes if `interim` is true.
pub(in crate::packed) fn layer_forms(refinements: &[u8], sh_parts: usize, interim: bool) -> Vec<LayerForm> {
    let last = refinements.len().saturating_sub(1);
    let form = |(k, &refinements): (usize, &u8)| LayerForm {
        refinements: refinements.into(),
        sh_parts,
        interim: interim && k < last,
    };
    refinements.iter().enumerate().map(form).collect()
}

impl Index {
    /// Computes the first Gaussian of each chunk and the start of each range. Rounds the bounds of chunks outward to the
    /// two bytes a number that a file holds. `None` if the Gaussians or the bytes are too many to count, or if the order
    /// names a range that is not there.
    pub(in crate::packed) fn lay_out(&mut self) -> Option<()> {
        let mut first = 0_usize;
        let is_one = self.chunks.len() == 1;
        for chunk in &mut self.chunks {
            chunk.bounds = if is_one { Default::default() } else { widened(chunk.bounds) };
            chunk.first = first;
            first = first.checked_add(chunk.gaussians)?;
        }
        let mut start = 0_u64;
        for &id in &self.order {
            let range = self.chunks.get_mut(id.chunk as usize)?.ranges.get_mut(usize::from(id.kind))?;
            range.start = start;
            start = start.checked_add(range.length.into())?;
        }
        Some(())
    }

    /// Returns the number of Gaussians.
    pub(in crate::packed) fn gaussians(&self) -> usize {
        self.chunks.last().map_or(0, |chunk| chunk.first + chunk.gaussians)
    }

    /// Returns the number of bytes of all ranges.
    pub(in crate::packed) fn data_bytes(&self) -> u64 {
        self.chunks.iter().flat_map(|chunk| &chunk.ranges).map(|range| u64::from(range.length)).sum()
    }

    /// Returns the form of the chunks of a layer.
    pub(in crate::packed) fn layer(&self, layer: usize) -> LayerForm {
        self.layers.get(layer).copied().unwrap_or_default()
    }

    /// Returns the offset in the data where the second layer starts; `None` if there is one layer.
    pub(in crate::packed) fn first_layer_end(&self) -> Option<u64> {
        let second = |id: &&RangeId| self.chunks.get(id.chunk as usize).is_some_and(|chunk| chunk.layer > 0);
        let id = self.order.iter().find(second)?;
        self.chunks.get(id.chunk as usize)?.ranges.get(usize::from(id.kind)).map(|range| range.start)
    }

    /// Returns the cells where the base of the next layer is missing; none if `layer` has no interim changes. `there`
    /// returns whether a range is there.
    pub(in crate::packed) fn uncovered(
        &self,
        layer: usize,
        there: impl Fn(&Range) -> bool,
    ) -> Vec<std::ops::Range<u64>> {
        let mut uncovered: Vec<std::ops::Range<u64>> = Vec::new();
        if !self.layer(layer).interim {
            return uncovered;
        }
        let mut next = self.chunks.iter().filter(|chunk| chunk.layer == layer + 1).peekable();
        let mut start = 0;
        while let Some(chunk) = next.next() {
            let end = next.peek().map_or(u64::MAX, |chunk| chunk.cell);
            match uncovered.last_mut() {
                _ if chunk.ranges.first().is_some_and(&there) => {}
                Some(last) if last.end == start => last.end = end,
                _ => uncovered.push(start..end),
            }
            start = end;
        }
        uncovered
    }

    /// Returns the chunks of the next layer whose cells overlap those of chunk `c`, or may; none if the layer of `c` has no
    /// interim changes.
    pub(in crate::packed) fn around(&self, c: usize) -> std::ops::Range<usize> {
        let Some(chunk) = self.chunks.get(c).filter(|chunk| self.layer(chunk.layer).interim) else {
            return 0..0;
        };
        let end = self.chunks.get(c + 1).filter(|after| after.layer == chunk.layer);
        let end = end.map_or(u64::MAX, |after| after.cell);
        let first = self.chunks.partition_point(|other| other.layer <= chunk.layer);
        let last = self.chunks.partition_point(|other| other.layer <= chunk.layer + 1);
        let next = self.chunks.get(first..last).unwrap_or_default();
        // The last chunk that begins below the first cell may reach it.
        let from = next.partition_point(|other| other.cell < chunk.cell).saturating_sub(1);
        let to = next.partition_point(|other| other.cell <= end);
        first + from..first + to.max(from)
    }

    /// Returns whether the ranges lie chunk by chunk in the order of their kinds.
    fn is_sorted(&self) -> bool {
        self.order.is_sorted_by_key(|id| (id.chunk, id.kind))
    }

    pub(in crate::packed) fn write(&self, out: &mut Vec<u8>) {
        let is_sorted = self.is_sorted();
        out.push(self.layers.len() as u8 | u8::from(is_sorted) << LAYERS_BITS);
        out.extend(self.layers.iter().map(|layer| layer.refinements as u8));
        put_number(out, self.chunks.len() as u64);
        for chunk in &self.chunks {
            out.push(chunk.layer as u8);
            put_number(out, chunk.gaussians as u64);
            put_number(out, chunk.cell);
            if self.chunks.len() > 1 {
                chunk.bounds.as_flattened().iter().for_each(|&x| put_bf16(out, x));
            }
        }
        for id in &self.order {
            let chunk = self.chunks.get(id.chunk as usize);
            let range = chunk.and_then(|chunk| chunk.ranges.get(usize::from(id.kind)));
            let Range { length, checksum, integers, .. } = range.copied().unwrap_or_default();
            if !is_sorted {
                put_number(out, id.chunk.into());
                out.push(id.kind);
            }
            put_number(out, length.into());
            out.extend([checksum, integers].iter().flat_map(|x| x.to_le_bytes()));
        }
    }

    /// Reads the bytes that [`Self::write`] wrote for chunks with `sh_parts` SH parts. All layers but the last have
    /// interim changes if `interim` is true.
    ///
    /// # Errors
    /// The broken rule for bytes that break a rule of docs/FORMAT.md, "Index".
    pub(in crate::packed) fn read(
        from: &mut Fields<'_>,
        sh_parts: usize,
        interim: bool,
    ) -> Result<Self, BrokenHead> {
        let layers = from.take("number of layers", ByteReader::u8)?;
        let (is_sorted, layers) =
            (layers >> LAYERS_BITS == 1, usize::from(layers & ((1 << LAYERS_BITS) - 1)));
        must(layers <= MAX_LAYERS, || format!("the number of layers is {layers}, above {MAX_LAYERS}"))?;
        let refinements = from.take("R", |from| from.bytes(layers))?;
        for (layer, &refinements) in refinements.iter().enumerate() {
            must(usize::from(refinements) <= MAX_REFINEMENTS, || {
                format!("R of layer {layer} is {refinements}, above {MAX_REFINEMENTS}")
            })?;
        }
        let mut index = Self { layers: layer_forms(refinements, sh_parts, interim), ..Self::default() };
        let (mut ranges, mut last) = (0, 0);
        // Every chunk and every range takes bytes of the index, so their numbers are bounded by its length.
        let chunks = from.take("number of chunks", ByteReader::number32)?;
        for c in 0..chunks {
            let layer = usize::from(from.take("layer of a chunk", ByteReader::u8)?);
            let gaussians = from.take("Gaussians of a chunk", ByteReader::number32)? as usize;
            let cell = from.take("cell of a chunk", ByteReader::number)?;
            let mut bounds = [[0.0; 3]; 2];
            if chunks > 1 {
                for bound in bounds.as_flattened_mut() {
                    *bound = from.take("bounds of a chunk", ByteReader::bf16)?;
                }
            }
            must(layer < layers && layer >= last, || {
                format!("chunk {c} is of layer {layer}, after one of layer {last}, of {layers}")
            })?;
            must((1..=MAX_CHUNK).contains(&gaussians), || {
                format!("chunk {c} has {gaussians} Gaussians, not from 1 to {MAX_CHUNK}")
            })?;
            // Within a layer the first cells of chunks do not fall, so that chunks do not overlap.
            let falls = index.chunks.last().is_some_and(|before| before.layer == layer && before.cell > cell);
            must(!falls, || format!("chunk {c} has a cell below that of the chunk before"))?;
            let blank = vec![Range::default(); index.layer(layer).ranges()];
            (ranges, last) = (ranges + blank.len(), layer);
            index.chunks.push(Chunk { layer, first: 0, gaussians, cell, bounds, ranges: blank });
        }
        let mut seen = vec![0_u32; index.chunks.len()];
        // The id of the next range, for ranges that are sorted.
        let mut next = RangeId { chunk: 0, kind: 0 };
        for number in 0..ranges {
            let id = match is_sorted {
                true => next,
                false => RangeId {
                    chunk: from.take("chunk of a range", ByteReader::number32)?,
                    kind: from.take("kind of a range", ByteReader::u8)?,
                },
            };
            let length = from.take("bytes of a range", ByteReader::number32)?;
            let checksum = from.take("CRC-32 of a range", ByteReader::u32)?;
            let integers = from.take("CRC-32 of the integers of a range", ByteReader::u32)?;
            let RangeId { chunk: c, kind } = id;
            let (chunk, kind) = (c as usize, usize::from(kind));
            let kinds = index.chunks.get(chunk).map_or(0, |chunk| chunk.ranges.len());
            let range = index.chunks.get_mut(chunk).and_then(|chunk| chunk.ranges.get_mut(kind));
            let Some((range, seen)) = range.zip(seen.get_mut(chunk)) else {
                return Err(BrokenHead(format!(
                    "range {number} is of kind {kind} of chunk {chunk}, which is not there"
                )));
            };
            *range = Range { start: 0, length, checksum, integers };
            let bit = 1 << kind;
            must(*seen & bit == 0, || {
                format!("range {number} of chunk {chunk}, of kind {kind}, is listed twice")
            })?;
            must((*seen | bit) & 1 == 1, || {
                format!("range {number} of chunk {chunk} comes before its base")
            })?;
            *seen |= bit;
            index.order.push(id);
            next = match kind + 1 < kinds {
                true => RangeId { kind: id.kind + 1, ..id },
                false => RangeId { chunk: id.chunk + 1, kind: 0 },
            };
        }
        for (c, chunk) in index.chunks.iter().enumerate() {
            let bytes = chunk.ranges.first().map_or(0, |base| base.length);
            must(chunk.gaussians as u64 * LEAST_BITS <= u64::from(bytes) * 8, || {
                format!("the base of chunk {c} has {bytes} bytes, too few for {} Gaussians", chunk.gaussians)
            })?;
        }
        index
            .lay_out()
            .ok_or_else(|| BrokenHead("the Gaussians or the bytes are too many to count".to_owned()))?;
        Ok(index)
    }
}

/// Rounds bounds outward to numbers whose two low bytes are 0.
fn widened([least, most]: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    // `near` rounds towards zero, and `far` away from it.
    let near = |x: f32| f32::from_bits(x.to_bits() >> 16 << 16);
    let far = |x: f32| {
        let wide = f32::from_bits(x.to_bits().wrapping_add(0xffff) >> 16 << 16);
        if wide.is_finite() { wide } else { near(x) }
    };
    [
        least.map(|x| if x < 0.0 { far(x) } else { near(x) }),
        most.map(|x| if x < 0.0 { near(x) } else { far(x) }),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(chunks: usize) -> Index {
        let chunk = |c: usize| Chunk {
            gaussians: 100 + c,
            cell: 1000 * c as u64,
            bounds: [[-1.01 - c as f32, 0.0, 3.3], [2.2, 1e9, 1e-9]],
            ranges: vec![Range { length: 300 + c as u32, checksum: 7, integers: 8, start: 0 }; 2],
            ..Chunk::default()
        };
        let id = |chunk: usize, kind| RangeId { chunk: chunk as u32, kind };
        let order = (0..2).flat_map(|kind| (0..chunks).map(move |c| id(c, kind))).collect();
        let mut index =
            Index { layers: layer_forms(&[0], 1, false), chunks: (0..chunks).map(chunk).collect(), order };
        index.lay_out().unwrap();
        index
    }

    #[test]
    fn indices_come_back() {
        for (chunks, bytes) in [(1, 26), (3, 3 + 3 * (1 + 1 + 2 + 12 + 2 * 12) - 1)] {
            let index = index(chunks);
            let mut out = Vec::new();
            index.write(&mut out);
            assert_eq!(out.len(), bytes);
            assert_eq!(Index::read(&mut Fields(ByteReader(&out)), 1, false), Ok(index));
            assert!(Index::read(&mut Fields(ByteReader(&out[..bytes - 1])), 1, false).is_err());
        }
    }

    #[test]
    fn bounds_hold_all_and_have_two_bytes() {
        let given = [[-1.01, 0.0, 3.3], [2.2, f32::MAX, -1e-9]];
        let wide = widened(given);
        assert_eq!(widened(wide), wide);
        for k in 0..3 {
            assert!(wide[0][k] <= given[0][k] && given[0][k] - wide[0][k] <= given[0][k].abs() / 128.0);
            assert!(wide[1][k].is_finite() && wide[1][k] - given[1][k] <= given[1][k].abs() / 128.0);
        }
        assert!(wide[1][0] >= given[1][0] && wide[1][2] >= given[1][2]);
    }
}
