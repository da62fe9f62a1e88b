//! Formats and containers: PLY and .lexi.

pub mod lexi;
pub mod ply;
