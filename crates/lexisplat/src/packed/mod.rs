//! The packed form: every attribute quantised as far as pictures allow and entropy-coded.
//!
//! [`Packer`] takes a scene and its [`Sensitivity`](crate::Sensitivity) and makes [`Packed`] scenes of any quality;
//! [`Packed::unpack`] gives back a [`Model`](crate::Model) whose SH stay sparse codes. docs/METHOD.md has
//! the mathematics, docs/FORMAT.md the bytes.
//!
//! `encoding.rs` packs a scene whole or in parts. `bitstream/` holds the format that is written, of which
//! `bitstream/geometry_syntax.rs` goes over the Gaussians of a chunk; encoder and decoder share it.

mod bitstream;
mod decode;
mod encode;
mod entropy;
mod scene;

pub(crate) use bitstream::atoms_of_head;
pub(crate) use bitstream::stream::BitCounts;
pub(crate) use decode::available_ranges::{AvailableRanges, Data, DecodeOptions};
pub(crate) use decode::decoder::Decoder;
pub(crate) use encode::canonical::MortonKey;
#[cfg(test)]
pub(crate) use encode::layering::MOST_CHUNK;
pub(crate) use scene::SpilledPacked;

pub use bitstream::stream::StreamBits;
pub use decode::outline::{ChunkOutline, LayerOutline, Outline, RangeKind, RangeOutline};
pub use encode::appearance::{Appearance, AppearanceChange};
pub use encode::curve::curve_order;
pub use encode::pack::{PackOptions, Packer};
pub use encode::preset::Preset;
pub use encode::quantised::{Quantised, Refit};
pub use encode::tiles;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub use entropy::fuzzing;
pub use scene::{Packed, PackedHead, ReachedRecord, TargetRecord};
