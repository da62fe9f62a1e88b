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

pub(in crate::packed) mod atoms;
pub(in crate::packed) mod axes;
pub(in crate::packed) mod broken;
pub(in crate::packed) mod bytes;
pub(in crate::packed) mod chunk;
pub(in crate::packed) mod coarseness;
pub(in crate::packed) mod coded_gaussian;
pub(in crate::packed) mod drawn;
pub(in crate::packed) mod geometry_syntax;
pub(in crate::packed) mod halves;
pub(in crate::packed) mod head;
pub(in crate::packed) mod index;
pub(in crate::packed) mod integer_model;
pub(in crate::packed) mod interim;
pub(in crate::packed) mod morton;
pub(in crate::packed) mod neighbour_context;
pub(in crate::packed) mod parameters;
pub(in crate::packed) mod points_of_view;
pub(in crate::packed) mod refinement;
pub(in crate::packed) mod sh_codes;
pub(in crate::packed) mod stream;
pub(in crate::packed) mod streams;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod trace;
pub(in crate::packed) mod values;

pub(in crate::packed) use atoms::{WholeAtoms, axes};
pub(in crate::packed) use axes::rounded as rounded_axes;
pub(in crate::packed) use chunk::{CodedChunk, Form, LayerForm, RecordedRange, lanes};
pub(in crate::packed) use head::Head;
pub(crate) use head::atoms_of_head;
pub(in crate::packed) use index::{Chunk, Index, Range, RangeId, layer_forms};
pub(in crate::packed) use parameters::{CHANGES, KINDS};
pub(in crate::packed) use points_of_view::{PointsOfView, seen_row};
pub(in crate::packed) use sh_codes::RestForm;
pub(in crate::packed) use streams::{Stream, stream_of};
