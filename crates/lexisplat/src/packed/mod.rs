//! The packed form: every attribute quantised as far as pictures allow and entropy-coded.
//!
//! [`Packer`] takes a scene and its [`Sensitivity`](crate::Sensitivity) and makes [`Packed`] scenes of any quality;
//! [`Packed::unpack`] gives back a [`Model`](crate::Model) whose SH stay sparse codes. docs/METHOD.md has
//! the mathematics, docs/FORMAT.md the bytes.
//!
//! `encoding.rs` packs a scene whole or in parts. `layered/` holds the format that is written, of which
//! `layered/walk.rs` goes over the Gaussians of a chunk; encoder and decoder share it. `flat/` reads version 2.

mod alone;
mod appearance;
mod atoms;
mod bits;
mod canonical;
mod chunks;
mod codebook;
mod coder;
mod curve;
mod decoder;
mod encoding;
mod fit;
mod flat;
mod floor;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
mod held;
mod layered;
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

pub(crate) use canonical::MortonKey;
pub(crate) use chunks::LayeredChunks;
pub(crate) use decoder::Decoder;
pub(crate) use held::{Data, Held, Wish};
pub(crate) use layered::layered_atoms;
pub(crate) use scene::{Coding, Flat, SpilledPacked};
pub(crate) use stream::BitCounts;

pub use appearance::{Appearance, AppearanceChange};
pub use curve::curve_order;
pub use outline::{ChunkOutline, LayerOutline, Outline, RangeKind, RangeOutline};
pub use pack::{PackOptions, Packer};
pub use preset::Preset;
pub use quantised::{Quantised, Refit};
pub use scene::{Packed, PackedHead, ReachedRecord, TargetRecord};
pub use stream::StreamBits;

/// Gaussians of a chunk of version 2, in which each chunk is decoded without the others. A file of version 3 says how many
/// Gaussians each of its chunks has.
pub const CHUNK: usize = 32_768;
