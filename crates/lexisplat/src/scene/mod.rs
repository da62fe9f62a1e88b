//! Dense scenes: Gaussians, SH, sources to read scenes from, sensitivity of pictures, statistics.

pub(crate) mod dropped;
pub(crate) mod extra;
pub(crate) mod joined;
pub(crate) mod moved;
pub(crate) mod offset;
pub(crate) mod rounding;
pub(crate) mod sensitivity;
pub mod sh;
pub(crate) mod source;
#[cfg(feature = "encode")]
pub(crate) mod spilled;
pub(crate) mod splats;
pub mod stats;
pub(crate) mod tile_kind;
