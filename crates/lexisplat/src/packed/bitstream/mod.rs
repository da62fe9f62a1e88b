//! The format of packed files: layers of chunks that are decoded coarse to fine.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "a chunk has at most 65,536 Gaussians, and values are within limits that are checked or clamped"
)]
#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes are written out, since iterators over several arrays do not become vector code"
)]

mod adaptive_bits;
mod atoms;
mod axes;
mod bytes;
mod chunk;
mod decoder;
mod fill_in;
#[cfg(feature = "fuzzing")]
pub mod fuzzing;
mod geometry_syntax;
mod halves;
mod head;
mod index;
mod integer_model;
mod log_probabilities;
mod mean_view;
mod neighbour_context;
mod rans_decoder;
mod rans_encoder;
mod refinement;
#[cfg(any(test, feature = "fuzzing"))]
mod script;
mod sh_codes;
mod shifts;
mod streams;
mod symbols;
mod tables;
mod target;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod trace;
mod transcribe;
mod unpack;
mod values;

pub(super) use atoms::{WholeAtoms, axes};
pub(super) use axes::rounded as rounded_axes;
pub(super) use chunk::{CodedChunk, Form, LayerForm, lanes};
pub(super) use decoder::BitstreamDecoder;
pub(super) use fill_in::{CHANGES, KINDS};
pub(super) use head::Head;
pub(crate) use head::atoms_of_head;
pub(super) use index::{Chunk, Index, Place, Range, layer_forms};
pub(super) use mean_view::{MeanView, seen_row};
pub(super) use rans_encoder::SymbolRecorder;
pub(super) use sh_codes::RestForm;
pub(super) use streams::{Stream, stream_of};
pub(super) use tables::{ALL_CONTEXTS, Histogram, Lookup, Tables};
pub(super) use target::Target;
