//! The packed form: every attribute quantised as far as pictures allow and entropy-coded.
//!
//! [`Packer`] takes a scene and its [`Sensitivity`](crate::Sensitivity) and makes [`Packed`] scenes of any quality;
//! [`Packed::unpack`] gives back a [`Model`](crate::Model) whose SH stay sparse codes. docs/METHOD.md has
//! the mathematics, docs/FORMAT.md the bytes.
//!
//! `encoding.rs` packs a scene whole or in parts. `bitstream/` holds the format that is written, of which
//! `bitstream/geometry_syntax.rs` goes over the Gaussians of a chunk; encoder and decoder share it.

mod alone;
mod appearance;
mod available_ranges;
mod bits;
mod bitstream;
mod canonical;
mod codebook;
mod coder;
mod curve;
mod decoder;
mod encoding;
mod fit;
mod floor;
mod layering;
mod morton;
mod neighbours;
mod octaves;
mod outline;
mod pack;
mod parameters;
mod place;
mod preset;
mod quantised;
mod removal;
mod reorder;
mod scene;
mod stream;
pub mod tiles;
mod unpack;

pub(crate) use available_ranges::{AvailableRanges, Data, DecodeOptions};
pub(crate) use bitstream::atoms_of_head;
pub(crate) use canonical::MortonKey;
pub(crate) use decoder::Decoder;
#[cfg(test)]
pub(crate) use layering::MOST_CHUNK;
pub(crate) use scene::SpilledPacked;
pub(crate) use stream::BitCounts;

pub use appearance::{Appearance, AppearanceChange};
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub use bitstream::fuzzing;
pub use curve::curve_order;
pub use outline::{ChunkOutline, LayerOutline, Outline, RangeKind, RangeOutline};
pub use pack::{PackOptions, Packer};
pub use preset::Preset;
pub use quantised::{Quantised, Refit};
pub use scene::{Packed, PackedHead, ReachedRecord, TargetRecord};
pub use stream::StreamBits;
