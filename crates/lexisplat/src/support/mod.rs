//! Support for all other modules: errors, limits, input and output, threads, vector instructions.

pub(crate) mod builder;
pub(crate) mod crc32;
pub(crate) mod error;
pub(crate) mod input;
pub(crate) mod inside;
pub(crate) mod limits;
pub(crate) mod maths;
pub(crate) mod memory_budget;
pub(crate) mod order;
pub mod output;
pub(crate) mod parallel;
pub(crate) mod progress;
pub(crate) mod rng;
pub mod simd;
pub(crate) mod sink;
pub(crate) mod spill;
pub(crate) mod stopwatch;
#[cfg(test)]
pub(crate) mod testing;
