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
pub(in crate::packed) mod bits;
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
pub(in crate::packed) mod morton;
mod neighbour_context;
pub(in crate::packed) mod parameters;
mod rans_decoder;
mod rans_encoder;
mod refinement;
#[cfg(any(test, feature = "fuzzing"))]
mod script;
mod sh_codes;
mod shifts;
pub(in crate::packed) mod stream;
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

pub(in crate::packed) use atoms::{WholeAtoms, axes};
pub(in crate::packed) use axes::rounded as rounded_axes;
pub(in crate::packed) use chunk::{CodedChunk, Form, LayerForm, lanes};
pub(in crate::packed) use decoder::BitstreamDecoder;
pub(in crate::packed) use fill_in::{CHANGES, KINDS};
pub(in crate::packed) use head::Head;
pub(crate) use head::atoms_of_head;
pub(in crate::packed) use index::{Chunk, Index, Place, Range, layer_forms};
pub(in crate::packed) use mean_view::{MeanView, seen_row};
pub(in crate::packed) use rans_encoder::SymbolRecorder;
pub(in crate::packed) use sh_codes::RestForm;
pub(in crate::packed) use streams::{Stream, stream_of};
pub(in crate::packed) use tables::{ALL_CONTEXTS, Histogram, Lookup, Tables};
pub(in crate::packed) use target::Target;
