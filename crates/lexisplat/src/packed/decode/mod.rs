//! The decoder: from the ranges that are there, which may come in any order, to the values that are drawn.
//!
//! This folder, `bitstream/` and `entropy/` have all code that reads packed files. They use nothing of `encode/`, which the feature
//! `encode` adds.

pub(in crate::packed) mod available_ranges;
pub(in crate::packed) mod budget;
pub(in crate::packed) mod chunk_decoder;
pub(in crate::packed) mod chunk_unpack;
pub(in crate::packed) mod decoder;
pub(in crate::packed) mod outline;
pub(in crate::packed) mod output;
pub(in crate::packed) mod reorder;
pub(in crate::packed) mod selection;
pub(in crate::packed) mod unpack;
