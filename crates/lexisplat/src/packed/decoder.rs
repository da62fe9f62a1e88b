//! Decoding the chunks of a packed scene of any version, each without the others.

use std::ops::Range;

use super::flat::{self, FlatDecoder};
use super::held::{Data, Wish};
use super::layered::{self, Index, LayeredDecoder, Range as DataRange};
use super::outline::Outline;
use super::place::{Piece, Place, indices, places};
use super::scene::{Coding, PackedHead};
use super::stream::{BitCounts, StreamBits};
use crate::scene::splats::Geometry;
use crate::sparse::codes::{SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::support::error::{Error, Result};
use crate::support::memory_budget::MemoryBudget;

/// What all chunks of a packed scene are decoded with, and where they are.
#[derive(Debug)]
pub(crate) struct Decoder {
    file: String,
    /// The chunks that are there, and the Gaussians of each.
    chunks: Vec<usize>,
    spans: Vec<Range<usize>>,
    wish: Wish,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Flat(Box<FlatDecoder>),
    Layered(Box<LayeredDecoder>),
}

impl Decoder {
    /// Reads what all chunks need from `head`, and in version 2 from the start of `data`.
    pub(crate) fn new(head: &PackedHead, data: &[u8]) -> Result<Self> {
        match &head.coding {
            Coding::Flat(flat) => {
                check(head, head.gaussians)?;
                let decoder = FlatDecoder::new(head, flat, data)?;
                let spans = decoder.spans();
                let (file, chunks) = (head.file.clone(), (0..spans.len()).collect());
                Ok(Self { file, chunks, spans, wish: Wish::default(), kind: Kind::Flat(Box::new(decoder)) })
            }
            Coding::Layered(bytes) => Self::layered(head, bytes, data.len() as u64, |_| true),
        }
    }

    /// Reads what all chunks need from `head`, for data of `whole` bytes of which only a first part, `data`, is there. Chunks
    /// of which nothing is there are left out. `None` for version 2.
    pub(crate) fn of_prefix(head: &PackedHead, data: &[u8], whole: u64) -> Result<Option<Self>> {
        let Coding::Layered(bytes) = &head.coding else { return Ok(None) };
        Self::layered(head, bytes, whole, |range| range.end() <= data.len() as u64).map(Some)
    }

    /// Reads what all chunks need from `head`, for data of `whole` bytes of which any ranges will be there. `None` for
    /// version 2.
    pub(crate) fn of_ranges(head: &PackedHead, whole: u64) -> Result<Option<Self>> {
        let Coding::Layered(bytes) = &head.coding else { return Ok(None) };
        Self::layered(head, bytes, whole, |_| true).map(Some)
    }

    /// The decoder of the chunks whose base is `there`, of data of `whole` bytes.
    fn layered(
        head: &PackedHead,
        bytes: &[u8],
        whole: u64,
        there: impl Fn(&DataRange) -> bool,
    ) -> Result<Self> {
        let decoder = LayeredDecoder::new(head, bytes)?;
        if decoder.index().data_bytes() != whole {
            let text = "packed ranges do not cover the data: no encoder writes it";
            return Err(Error::malformed(&head.file, text));
        }
        let (mut chunks, mut spans, mut first) = (Vec::new(), Vec::new(), 0);
        for (c, chunk) in decoder.index().chunks.iter().enumerate() {
            if chunk.ranges.first().is_some_and(&there) {
                chunks.push(c);
                spans.push(first..first + chunk.gaussians);
                first += chunk.gaussians;
            }
        }
        check(head, first)?;
        let (file, wish) = (head.file.clone(), Wish::default());
        Ok(Self { file, chunks, spans, wish, kind: Kind::Layered(Box::new(decoder)) })
    }

    /// What is made of chunks of version 3 from here on.
    pub(crate) fn wish(&mut self) -> &mut Wish {
        &mut self.wish
    }

    /// Layers, chunks and ranges of a scene of version 3 whose data start at `data_start` of the file.
    pub(crate) fn outline(&self, data_start: u64) -> Option<Outline> {
        self.index().map(|index| Outline::new(index, data_start))
    }

    /// The same without interim changes but of scales.
    pub(crate) fn growing_only(mut self) -> Self {
        if let Kind::Layered(decoder) = &mut self.kind {
            decoder.grow_only();
        }
        self
    }

    /// The layers, chunks and ranges of a file of version 3.
    pub(super) fn index(&self) -> Option<&Index> {
        match &self.kind {
            Kind::Flat(_) => None,
            Kind::Layered(decoder) => Some(decoder.index()),
        }
    }

    /// The chunks of the next layer around chunk `c` that change what is made of it while they are missing.
    pub(crate) fn around(&self, c: usize) -> Range<usize> {
        self.index().map_or(0..0, |index| index.around(c))
    }

    /// The Gaussians of each chunk.
    pub(crate) fn spans(&self) -> &[Range<usize>] {
        &self.spans
    }

    pub(crate) fn dictionary(&self) -> &Dictionary {
        match &self.kind {
            Kind::Flat(decoder) => &decoder.dictionary,
            Kind::Layered(decoder) => decoder.dictionary(),
        }
    }

    /// Bits that the dictionary took.
    pub(crate) fn dictionary_bits(&self) -> &BitCounts {
        match &self.kind {
            Kind::Flat(decoder) => &decoder.dictionary_bits,
            Kind::Layered(decoder) => &decoder.dictionary_bits,
        }
    }

    /// Counted bits with the names of the streams.
    pub(crate) fn named(&self, bits: &BitCounts) -> Vec<StreamBits> {
        match &self.kind {
            Kind::Flat(_) => bits.named(flat::Stream::names()),
            Kind::Layered(_) => bits.named(layered::Stream::names()),
        }
    }

    /// Decodes chunk `c` of those that are there without extras. Escapes are numbered from its start. `budget` already holds
    /// everything except its codes. Its bits are counted if `count_bits`.
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
        let mut place = places(&mut g, &mut counts, std::slice::from_ref(&own)).pop().unwrap_or_default();
        let piece = self.piece(data, c, 0, &mut place, budget, count_bits)?;
        let dictionary = self.dictionary();
        let (indices, values) = (indices(dictionary, piece.atoms), Values::F16(piece.values));
        let codes = SparseCodes::part(dictionary, span.start, counts, indices, values, piece.escapes)
            .map_err(|e| Error::malformed(&self.file, e.to_string()))?;
        Ok((g, codes, piece.bit_counts))
    }

    /// Decodes chunk `c` of those that are there to `place`. Escapes are numbered from `first`.
    pub(super) fn piece(
        &self,
        data: Data<'_>,
        c: usize,
        first: usize,
        place: &mut Place<'_>,
        budget: &MemoryBudget<'_>,
        count_bits: bool,
    ) -> Result<Piece> {
        let c = self.chunks.get(c).copied().unwrap_or(usize::MAX);
        match &self.kind {
            Kind::Flat(decoder) => decoder.piece(data.first(), c, first, place, budget, count_bits),
            Kind::Layered(decoder) => decoder.piece(data, c, first, self.wish, place, budget, count_bits),
        }
    }
}

/// Refuses more Gaussians or atoms than the limits of the reader allow.
fn check(head: &PackedHead, gaussians: usize) -> Result<()> {
    head.limits.check_gaussians(&head.file, gaussians as u64)?;
    head.limits.check_atoms(&head.file, head.atoms as u64)
}
