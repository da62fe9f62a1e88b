//! The encoder: from a scene and its sensitivity to a packed scene of any quality.

pub(in crate::packed) mod appearance;
pub(in crate::packed) mod canonical;
pub(in crate::packed) mod codebook;
pub(in crate::packed) mod coder;
pub(in crate::packed) mod encoding;
pub(in crate::packed) mod fit;
pub(in crate::packed) mod floor;
pub(in crate::packed) mod interim;
pub(in crate::packed) mod layering;
pub(in crate::packed) mod neighbours;
pub(in crate::packed) mod octaves;
pub(in crate::packed) mod options;
pub(in crate::packed) mod pack;
pub(in crate::packed) mod quantised;
pub(in crate::packed) mod removal;
pub(in crate::packed) mod sample_sums;
pub(in crate::packed) mod settled;
pub mod tiles;
pub(in crate::packed) mod transcribe;
