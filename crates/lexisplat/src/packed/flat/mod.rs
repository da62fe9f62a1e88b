//! Version 2 of packed files, which is read and no longer written: one layer of chunks.

mod decoder;
#[cfg(feature = "fuzzing")]
pub mod fuzzing;
mod streams;
mod symbols;
mod tables;
mod walk;

pub(super) use decoder::FlatDecoder;
pub(super) use streams::Stream;
