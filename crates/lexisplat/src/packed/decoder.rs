//! Decoding the chunks of a packed scene of any version, each without the others.

use std::ops::Range;

use super::chunks::{LayeredChunks, check, decoded};
use super::flat::{self, FlatDecoder};
use super::held::{Data, Wish};
use super::layered::{self, Index};
use super::outline::Outline;
use super::place::{Piece, Place};
use super::scene::{Coding, PackedHead};
use super::stream::{BitCounts, StreamBits};
use crate::scene::splats::Geometry;
use crate::sparse::codes::SparseCodes;
use crate::sparse::dictionary::Dictionary;
use crate::support::error::Result;
use crate::support::memory_budget::MemoryBudget;

/// What all chunks of a packed scene are decoded with, and where they are.
#[derive(Debug)]
pub(crate) enum Decoder {
    /// Version 2: the decoder, and the Gaussians of each chunk.
    Flat(Box<FlatDecoder>, Vec<Range<usize>>),
    /// Version 3.
    Layered(LayeredChunks),
}

impl Decoder {
    /// Reads what all chunks need from `head`, and in version 2 from the start of `data`.
    pub(crate) fn new(head: &PackedHead, data: &[u8]) -> Result<Self> {
        match &head.coding {
            Coding::Flat(flat) => {
                check(head, head.gaussians)?;
                let decoder = FlatDecoder::new(head, flat, data)?;
                let spans = decoder.spans();
                Ok(Self::Flat(Box::new(decoder), spans))
            }
            Coding::Layered(bytes) => LayeredChunks::new(head, bytes, data.len() as u64).map(Self::Layered),
        }
    }

    /// Reads what all chunks need from `head`, for data of `whole` bytes of which only a first part, `data`, is there. Chunks
    /// of which nothing is there are left out. `None` for version 2.
    pub(crate) fn of_prefix(head: &PackedHead, data: &[u8], whole: u64) -> Result<Option<Self>> {
        let Coding::Layered(bytes) = &head.coding else { return Ok(None) };
        LayeredChunks::of_prefix(head, bytes, data.len() as u64, whole)
            .map(|chunks| Some(Self::Layered(chunks)))
    }

    fn layered(&self) -> Option<&LayeredChunks> {
        match self {
            Self::Flat(..) => None,
            Self::Layered(chunks) => Some(chunks),
        }
    }

    /// What is made of chunks of version 3 from here on; `None` for version 2.
    pub(crate) fn wish(&mut self) -> Option<&mut Wish> {
        match self {
            Self::Flat(..) => None,
            Self::Layered(chunks) => Some(&mut chunks.wish),
        }
    }

    /// Layers, chunks and ranges of a scene of version 3 whose data start at `data_start` of the file.
    pub(crate) fn outline(&self, data_start: u64) -> Option<Outline> {
        self.layered().map(|chunks| chunks.outline(data_start))
    }

    /// The same without interim changes but of scales.
    pub(crate) fn growing_only(mut self) -> Self {
        if let Self::Layered(chunks) = &mut self {
            chunks.grow_only();
        }
        self
    }

    /// The layers, chunks and ranges of a file of version 3.
    pub(super) fn index(&self) -> Option<&Index> {
        self.layered().map(LayeredChunks::index)
    }

    /// The Gaussians of each chunk.
    pub(crate) fn spans(&self) -> &[Range<usize>] {
        match self {
            Self::Flat(_, spans) => spans,
            Self::Layered(chunks) => chunks.spans(),
        }
    }

    pub(crate) fn dictionary(&self) -> &Dictionary {
        match self {
            Self::Flat(decoder, _) => &decoder.dictionary,
            Self::Layered(chunks) => chunks.dictionary(),
        }
    }

    /// The file, as the caller named it.
    fn file(&self) -> &str {
        match self {
            Self::Flat(decoder, _) => &decoder.file,
            Self::Layered(chunks) => chunks.file(),
        }
    }

    /// Bits that the dictionary took.
    pub(crate) fn dictionary_bits(&self) -> &BitCounts {
        match self {
            Self::Flat(decoder, _) => &decoder.dictionary_bits,
            Self::Layered(chunks) => chunks.dictionary_bits(),
        }
    }

    /// Counted bits with the names of the streams.
    pub(crate) fn named(&self, bits: &BitCounts) -> Vec<StreamBits> {
        match self {
            Self::Flat(..) => bits.named(flat::Stream::names()),
            Self::Layered(_) => bits.named(layered::Stream::names()),
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
        let span = self.spans().get(c).cloned().unwrap_or_default();
        decoded(self.file(), self.dictionary(), span, &mut |place| {
            self.piece(data, c, 0, place, budget, count_bits)
        })
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
        match self {
            Self::Flat(decoder, _) => decoder.piece(data.first(), c, first, place, budget, count_bits),
            Self::Layered(chunks) => chunks.piece(data, c, first, place, budget, count_bits),
        }
    }
}
