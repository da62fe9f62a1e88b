//! The outline of a packed file: its layers, chunks and ranges.

use std::fmt;
use std::ops::Range;

use crate::packed::bitstream::{Index, LayerForm};

/// The layers, chunks and ranges of a packed file.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Outline {
    /// The layers, in the order in which they are drawn.
    pub layers: Vec<LayerOutline>,
    /// The chunks of all layers, layer by layer.
    pub chunks: Vec<ChunkOutline>,
    /// The ranges of all chunks, in the order of the file.
    pub ranges: Vec<RangeOutline>,
}

/// A layer: Gaussians that are spread over the whole scene.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LayerOutline {
    /// Number of Gaussians.
    pub gaussians: u64,
    /// Indices of its chunks in [`Outline::chunks`].
    pub chunks: Range<usize>,
    /// Number of refinements of each of its chunks.
    pub refinements: usize,
    /// Number of SH parts of each of its chunks.
    pub sh_parts: usize,
}

/// A chunk: neighbouring Gaussians of a layer, which are decoded without other chunks.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct ChunkOutline {
    /// Index of its layer in [`Outline::layers`].
    pub layer: usize,
    /// Index of its first Gaussian in the file.
    pub first: usize,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Coordinates that are at most the least, and at least the largest, of the centres of its Gaussians. Zeros if it is
    /// the only chunk of the file.
    pub bounds: [[f32; 3]; 2],
    /// Indices of the chunks of the next layer around it in [`Outline::chunks`]. While one of them is missing, some of its
    /// Gaussians are drawn so that they fill the place. None in the last layer.
    pub next: Range<usize>,
}

impl ChunkOutline {
    /// Returns the square of the distance from `point` to the bounds; 0 within.
    pub(crate) fn square_distance(&self, point: [f32; 3]) -> f32 {
        let [least, most] = self.bounds;
        let off = |k: usize| (least[k] - point[k]).max(point[k] - most[k]).max(0.0);
        (0..3).map(|k| off(k) * off(k)).sum()
    }
}

/// A range: bytes of a chunk that are fetched, verified and decoded together.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct RangeOutline {
    /// Index of its chunk in [`Outline::chunks`].
    pub chunk: usize,
    /// The kind of its content.
    pub kind: RangeKind,
    /// Its offset in the file, in bytes.
    pub bytes: Range<u64>,
    /// CRC-32 of its bytes.
    pub checksum: u32,
    /// CRC-32 of the integers that it decodes to.
    pub integers: u32,
}

/// The kind of the content of a range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum RangeKind {
    /// Everything but SH-rest, some of it coarse. No range of a chunk can be decoded without it.
    Base,
    /// A refinement of the base, by its number from 0. It needs all refinements of lower numbers.
    Refinement(usize),
    /// An SH part: the nonzeros of some sizes, by its number from 0. Part 0 has the largest values. A part needs all
    /// parts of lower numbers.
    Sh(usize),
    /// Interim changes: changes of Gaussians while those of the next layer are missing.
    Interim,
}

impl RangeKind {
    /// Returns the kind of range `k` of a chunk.
    pub(in crate::packed) fn of(form: LayerForm, k: usize) -> Self {
        match k {
            0 => Self::Base,
            _ if k <= form.refinements => Self::Refinement(k - 1),
            _ if k < form.interim_range() => Self::Sh(k - 1 - form.refinements),
            _ => Self::Interim,
        }
    }
}

impl fmt::Display for RangeKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Base => f.write_str("the base"),
            // The format numbers refinements from 1, and SH parts from 0.
            Self::Refinement(k) => write!(f, "refinement {}", k + 1),
            Self::Sh(k) => write!(f, "part {k} of SH-rest"),
            Self::Interim => f.write_str("the range of interim changes"),
        }
    }
}

impl Outline {
    /// Creates the outline of `index`. The data start at byte `data_start` of the file.
    pub(in crate::packed) fn new(index: &Index, data_start: u64) -> Self {
        let layer = |form: &LayerForm| LayerOutline {
            refinements: form.refinements,
            sh_parts: form.sh_parts,
            ..LayerOutline::default()
        };
        let mut layers: Vec<LayerOutline> = index.layers.iter().map(layer).collect();
        let mut chunks = Vec::with_capacity(index.chunks.len());
        for (c, chunk) in index.chunks.iter().enumerate() {
            if let Some(layer) = layers.get_mut(chunk.layer) {
                layer.chunks = if layer.gaussians == 0 { c } else { layer.chunks.start }..c + 1;
                layer.gaussians += chunk.gaussians as u64;
            }
            let (first, gaussians, bounds) = (chunk.first, chunk.gaussians, chunk.bounds);
            chunks.push(ChunkOutline { layer: chunk.layer, first, gaussians, bounds, next: index.around(c) });
        }
        let range = |id: &crate::packed::bitstream::RangeId| {
            let (chunk, kind) = (id.chunk as usize, usize::from(id.kind));
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

    /// Returns the index of a range within its chunk, by which errors name it.
    pub(crate) fn number(&self, range: &RangeOutline) -> usize {
        let layer = self.chunks.get(range.chunk).and_then(|chunk| self.layers.get(chunk.layer));
        let (refinements, sh_parts) = layer.map_or((0, 0), |layer| (layer.refinements, layer.sh_parts));
        match range.kind {
            RangeKind::Base => 0,
            RangeKind::Refinement(k) => 1 + k,
            RangeKind::Sh(k) => 1 + refinements + k,
            RangeKind::Interim => 1 + refinements + sh_parts,
        }
    }

    /// Returns the offset in the file, in bytes, where the bases of the first layer end. With so many bytes the whole scene
    /// is drawn, as coarsely as that layer shows it.
    #[must_use]
    pub fn first_layer_end(&self) -> u64 {
        let is_first = |range: &&RangeOutline| {
            range.kind == RangeKind::Base
                && self.chunks.get(range.chunk).is_some_and(|chunk| chunk.layer == 0)
        };
        self.ranges.iter().filter(is_first).map(|range| range.bytes.end).max().unwrap_or(0)
    }
}
