//! The packed form: every attribute quantised as far as pictures allow and entropy-coded.
//!
//! [`Packer`] takes a scene and its [`Sensitivity`](crate::Sensitivity) and makes [`Packed`] files of any quality;
//! [`Packed::unpack`] gives back a [`Model`](crate::Model) whose SH stay sparse codes. docs/METHOD.md has
//! the mathematics, docs/FORMAT.md the bytes.
//!
//! `walk.rs` is the heart: one walk over the Gaussians of a chunk that encoder and decoder share.

mod bits;
mod canonical;
mod chunk_codec;
mod chunks;
mod codebook;
mod coder;
mod entropy;
mod fit;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
mod morton;
mod neighbours;
mod pack;
mod parameters;
mod parts;
mod preset;
mod reorder;
mod stream;
mod unpack;

pub(crate) use canonical::{Bounds, Grid, MortonKey};
pub(crate) use chunks::Decoder;
pub(crate) use pack::check;
pub(crate) use parts::{PartPacker, Whole};

pub use pack::{PackOptions, PackReport, Packer};
pub use preset::Preset;
pub use unpack::{Packed, StreamBits, TargetRecord};

/// Gaussians of a chunk: decoded apart from all others, so that decoding is parallel and a viewer need
/// not wait for the whole file.
pub const CHUNK: usize = 32_768;
