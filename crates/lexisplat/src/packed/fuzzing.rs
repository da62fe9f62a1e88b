//! The entropy coders of all versions by themselves, for the fuzz targets. No part of the crate's interface.

pub use super::flat::fuzzing as flat;
pub use super::layered::fuzzing as layered;
