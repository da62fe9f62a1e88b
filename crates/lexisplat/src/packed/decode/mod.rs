//! The decoder: from bytes that are there, in any order of ranges, to what is drawn.
//!
//! With `bitstream/` and `entropy/` it is all that reads packed files. Of `encode/` these folders use `target.rs` and
//! `canonical.rs`, since an encoder and a decoder of the syntax are one function.

pub(in crate::packed) mod available_ranges;
pub(in crate::packed) mod chunk_decoder;
pub(in crate::packed) mod chunk_unpack;
pub(in crate::packed) mod decoder;
pub(in crate::packed) mod outline;
pub(in crate::packed) mod place;
pub(in crate::packed) mod reorder;
pub(in crate::packed) mod unpack;
