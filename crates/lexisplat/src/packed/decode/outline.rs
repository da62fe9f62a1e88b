//! What a packed file is made of: layers, chunks and ranges.

use std::ops::Range;

use crate::packed::bitstream::{Index, LayerForm};

/// The layers, chunks and ranges of a packed file.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Outline {
    /// The layers, first the one that is drawn first.
    pub layers: Vec<LayerOutline>,
    /// The chunks of all layers, layer by layer.
    pub chunks: Vec<ChunkOutline>,
    /// The ranges of all chunks in the order of the file.
    pub ranges: Vec<RangeOutline>,
}

/// A layer: Gaussians that are spread over the whole scene.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LayerOutline {
    /// Number of Gaussians.
    pub gaussians: u64,
    /// Its chunks.
    pub chunks: Range<usize>,
    /// Levels of refinement of its chunks.
    pub levels: usize,
    /// Parts of the nonzeros of SH-rest of its chunks.
    pub sh_parts: usize,
}

/// A chunk: neighbouring Gaussians of a layer, which are decoded without others.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct ChunkOutline {
    /// Number of its layer.
    pub layer: usize,
    /// Number of its first Gaussian in the file.
    pub first: usize,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Least and largest coordinates of the centres of its Gaussians, or some beyond. They mean nothing if it is the only
    /// chunk of the file.
    pub bounds: [[f32; 3]; 2],
}

/// A range: bytes of a chunk that are fetched, checked and decoded together.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct RangeOutline {
    /// Number of its chunk.
    pub chunk: usize,
    /// What it holds.
    pub kind: RangeKind,
    /// Where it is in the file.
    pub bytes: Range<u64>,
    /// CRC-32 of its bytes.
    pub checksum: u32,
    /// CRC-32 of the integers that it decodes to.
    pub integers: u32,
}

/// What a range holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum RangeKind {
    /// Everything but SH-rest, some of it coarse. Nothing of a chunk is decoded without it.
    Base,
    /// What makes it finer. Those of lower numbers are needed too, which count from 0.
    Refinement(usize),
    /// A part of the nonzeros of SH-rest, those of the largest values in part 0. Those of lower numbers are needed too.
    Sh(usize),
    /// What Gaussians look like while those of the next layer are not there.
    Interim,
}

impl RangeKind {
    /// The kind of range number `k` of a chunk.
    pub(in crate::packed) fn of(form: LayerForm, k: usize) -> Self {
        match k {
            0 => Self::Base,
            _ if k <= form.levels => Self::Refinement(k - 1),
            _ if k < form.interim_range() => Self::Sh(k - 1 - form.levels),
            _ => Self::Interim,
        }
    }
}

impl Outline {
    /// The outline of `index`, whose data start at `data_start` of the file.
    pub(in crate::packed) fn new(index: &Index, data_start: u64) -> Self {
        let layer = |form: &LayerForm| {
            let (levels, sh_parts) = (form.levels, form.parts);
            LayerOutline { levels, sh_parts, ..LayerOutline::default() }
        };
        let mut layers: Vec<LayerOutline> = index.layers.iter().map(layer).collect();
        let mut chunks = Vec::with_capacity(index.chunks.len());
        for (c, chunk) in index.chunks.iter().enumerate() {
            if let Some(layer) = layers.get_mut(chunk.layer) {
                layer.chunks = if layer.gaussians == 0 { c } else { layer.chunks.start }..c + 1;
                layer.gaussians += chunk.gaussians as u64;
            }
            let (first, gaussians, bounds) = (chunk.first, chunk.gaussians, chunk.bounds);
            chunks.push(ChunkOutline { layer: chunk.layer, first, gaussians, bounds });
        }
        let range = |place: &crate::packed::bitstream::Place| {
            let (chunk, kind) = (place.chunk as usize, usize::from(place.kind));
            let found = index.chunks.get(chunk)?;
            let range = found.ranges.get(kind)?;
            Some(RangeOutline {
                chunk,
                kind: RangeKind::of(index.layer(found.layer), kind),
                bytes: data_start.saturating_add(range.start)..data_start.saturating_add(range.end()),
                checksum: range.checksum,
                integers: range.integers,
            })
        };
        Self { layers, chunks, ranges: index.order.iter().filter_map(range).collect() }
    }

    /// The number of a range within its chunk, by which errors name it.
    pub(crate) fn number(&self, range: &RangeOutline) -> usize {
        let layer = self.chunks.get(range.chunk).and_then(|chunk| self.layers.get(chunk.layer));
        let (levels, parts) = layer.map_or((0, 0), |layer| (layer.levels, layer.sh_parts));
        match range.kind {
            RangeKind::Base => 0,
            RangeKind::Refinement(level) => 1 + level,
            RangeKind::Sh(part) => 1 + levels + part,
            RangeKind::Interim => 1 + levels + parts,
        }
    }

    /// Where in the file the last of the bases of the first layer ends: with so many bytes the whole scene is drawn, as
    /// coarsely as that layer shows it.
    #[must_use]
    pub fn first_layer_end(&self) -> u64 {
        let is_first = |range: &&RangeOutline| {
            range.kind == RangeKind::Base
                && self.chunks.get(range.chunk).is_some_and(|chunk| chunk.layer == 0)
        };
        self.ranges.iter().filter(is_first).map(|range| range.bytes.end).max().unwrap_or(0)
    }
}
