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

mod around;
mod atoms;
mod axes;
mod binary;
mod bytes;
mod chunk;
mod decoder;
mod fine;
#[cfg(feature = "fuzzing")]
pub mod fuzzing;
mod halves;
mod head;
mod index;
mod interim;
mod levels;
mod mean_view;
mod player;
mod range;
mod rest;
#[cfg(any(test, feature = "fuzzing"))]
mod script;
mod shifts;
mod steering;
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
mod walk;

pub(super) use atoms::{WholeAtoms, axes};
pub(super) use axes::rounded as rounded_axes;
pub(super) use chunk::{CodedChunk, Form, LayerForm, lanes};
pub(super) use decoder::LayeredDecoder;
pub(super) use head::Head;
pub(crate) use head::layered_atoms;
pub(super) use index::{Chunk, Index, Place, Range, layer_forms};
pub(super) use interim::{CHANGES, KINDS};
pub(super) use mean_view::{MeanView, seen_row};
pub(super) use range::Recorder;
pub(super) use rest::RestForm;
pub(super) use streams::{Stream, stream_of};
pub(super) use tables::{ALL_CONTEXTS, Histogram, Lookup, Tables};
pub(super) use target::Target;
