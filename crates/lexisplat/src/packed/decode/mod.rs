//! The decoder: from bytes that are there, in any order of ranges, to what is drawn.
//!
//! With `bitstream/` it is all that reads packed files. It shares no code with the encoder.

pub(in crate::packed) mod available_ranges;
pub(in crate::packed) mod chunk_decoder;
pub(in crate::packed) mod chunk_unpack;
pub(in crate::packed) mod decoder;
pub(in crate::packed) mod outline;
pub(in crate::packed) mod place;
pub(in crate::packed) mod reorder;
pub(in crate::packed) mod unpack;
