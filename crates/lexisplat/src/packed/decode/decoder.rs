//! Decoding of the chunks of a packed scene, each without the others.

use std::ops::Range;

use super::available_ranges::{Data, DecodeOptions};
use super::outline::Outline;
use super::output::{ChunkOutput, Piece, chunk_outputs, indices};
use crate::packed::bitstream::Index;
use crate::packed::bitstream::stream::BitCounts;
use crate::packed::decode::chunk_decoder::BitstreamDecoder;
use crate::packed::scene::PackedHead;
use crate::scene::splats::Geometry;
use crate::sparse::codes::{SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::support::error::{Error, Result};
use crate::support::memory_budget::MemoryBudget;

/// The head of a packed scene, prepared for decoding its chunks, and the chunks that are available.
#[derive(Debug)]
pub(crate) struct Decoder {
    file: String,
    /// Numbers of the available chunks, and the Gaussians of each.
    chunks: Vec<usize>,
    spans: Vec<Range<usize>>,
    /// Options of decoding a chunk.
    pub(crate) options: DecodeOptions,
    decoder: Box<BitstreamDecoder>,
}

impl Decoder {
    /// Prepares to decode the scene of `head`, from data of `whole` bytes. Any ranges may be there.
    pub(crate) fn new(head: &PackedHead, whole: u64) -> Result<Self> {
        Self::of_prefix(head, whole, whole)
    }

    /// Prepares to decode the scene of `head` if only the first `there` of `whole` bytes of data are there. Chunks whose
    /// base is missing are left out.
    pub(crate) fn of_prefix(head: &PackedHead, there: u64, whole: u64) -> Result<Self> {
        let decoder = BitstreamDecoder::new(head)?;
        if decoder.index().data_bytes() != whole {
            let ranges = decoder.index().data_bytes();
            let text = format!("packed.head: its ranges have {ranges} bytes, and packed.data has {whole}");
            return Err(Error::malformed(&head.file, text));
        }
        let (mut chunks, mut spans, mut first) = (Vec::new(), Vec::new(), 0);
        for (c, chunk) in decoder.index().chunks.iter().enumerate() {
            if chunk.ranges.first().is_some_and(|range| range.end() <= there) {
                chunks.push(c);
                spans.push(first..first + chunk.gaussians);
                first += chunk.gaussians;
            }
        }
        head.limits.check_gaussians(&head.file, first as u64)?;
        head.limits.check_atoms(&head.file, head.atoms as u64)?;
        let (file, options) = (head.file.clone(), DecodeOptions::default());
        Ok(Self { file, chunks, spans, options, decoder: Box::new(decoder) })
    }

    /// Returns the layers, chunks and ranges of the whole scene. Its data start at byte `data_start` of the file.
    pub(crate) fn outline(&self, data_start: u64) -> Outline {
        Outline::new(self.index(), data_start)
    }

    /// Drops all interim changes but those of scales.
    pub(in crate::packed) fn growing_only(mut self) -> Self {
        self.decoder.grow_only();
        self
    }

    /// Returns the index of the whole scene: layers, chunks and ranges.
    pub(in crate::packed) fn index(&self) -> &Index {
        self.decoder.index()
    }

    /// Returns the Gaussians of each available chunk.
    pub(crate) fn spans(&self) -> &[Range<usize>] {
        &self.spans
    }

    pub(crate) fn dictionary(&self) -> &Dictionary {
        self.decoder.dictionary()
    }

    /// Returns the number of bits of the dictionary.
    pub(crate) fn dictionary_bits(&self) -> &BitCounts {
        &self.decoder.dictionary_bits
    }

    /// Decodes available chunk `c` without extra properties. Its escapes are numbered from the start of the chunk. `budget`
    /// already holds everything except the codes of the chunk. With `count_bits`, the bits of streams are counted.
    pub(crate) fn chunk(
        &self,
        data: Data<'_>,
        c: usize,
        budget: &MemoryBudget<'_>,
        count_bits: bool,
    ) -> Result<(Geometry, SparseCodes, BitCounts)> {
        let span = self.spans.get(c).cloned().unwrap_or_default();
        let (mut g, mut counts) = (Geometry::zeros(span.len()), vec![0; span.len()]);
        let own = 0..span.len();
        let mut output =
            chunk_outputs(&mut g, &mut counts, std::slice::from_ref(&own)).pop().unwrap_or_default();
        let piece = self.piece(data, c, 0, &mut output, budget, count_bits)?;
        let (indices, values) = (indices(self.dictionary(), piece.atoms), Values::F16(piece.values));
        let codes = SparseCodes::part(self.dictionary(), span.start, counts, indices, values, piece.escapes)
            .map_err(|e| Error::malformed(&self.file, e.to_string()))?;
        Ok((g, codes, piece.bit_counts))
    }

    /// Decodes available chunk `c` into `output`. The escapes in the result are numbered from `first`.
    pub(in crate::packed) fn piece(
        &self,
        data: Data<'_>,
        c: usize,
        first: usize,
        output: &mut ChunkOutput<'_>,
        budget: &MemoryBudget<'_>,
        count_bits: bool,
    ) -> Result<Piece> {
        let c = self.chunks.get(c).copied().unwrap_or(usize::MAX);
        self.decoder.piece(data, c, first, self.options, output, budget, count_bits)
    }
}
