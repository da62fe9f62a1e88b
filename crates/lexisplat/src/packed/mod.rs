//! The packed form of a scene: every attribute is quantised as coarsely as pictures allow, and entropy-coded.
//!
//! [`Packer`] takes a scene and its [`Sensitivity`](crate::Sensitivity), and makes [`Packed`] scenes of any quality.
//! [`Packed::unpack`] returns a [`Model`](crate::Model) whose SH coefficients stay sparse codes. docs/METHOD.md has the
//! mathematics, docs/FORMAT.md the bytes.
//!
//! `encode/` is the encoder and `decode/` the decoder. `bitstream/` is the syntax that they share, `entropy/` the coder of
//! its symbols. One function both encodes and decodes a syntax element, for instance in `bitstream/geometry_syntax.rs`.
//! It is generic over a type that writes symbols or reads them.

mod bitstream;
mod curve;
mod decode;
#[cfg(feature = "encode")]
mod encode;
mod entropy;
mod preset;
mod scene;

pub(crate) use bitstream::atoms_of_head;
pub(crate) use bitstream::stream::BitCounts;
#[cfg(feature = "encode")]
pub(crate) use curve::MortonKey;
pub(crate) use decode::available_ranges::{AvailableRanges, Data, DecodeOptions};
pub(crate) use decode::decoder::Decoder;
#[cfg(all(test, feature = "encode"))]
pub(crate) use encode::layering::MOST_CHUNK;
#[cfg(feature = "encode")]
pub(crate) use scene::SpilledPacked;

pub use bitstream::stream::StreamBits;
pub use curve::curve_order;
pub use decode::budget::{Budget, Eye};
pub use decode::outline::{ChunkOutline, LayerOutline, Outline, RangeKind, RangeOutline};
pub use decode::selection::Selection;
#[cfg(feature = "encode")]
pub use encode::appearance::{Appearance, AppearanceChange};
#[cfg(feature = "encode")]
pub use encode::options::{LOD_FIRST_LAYER, PackOptions};
#[cfg(feature = "encode")]
pub use encode::pack::Packer;
#[cfg(feature = "encode")]
pub use encode::quantised::{Quantised, Refit, ToRefit};
#[cfg(feature = "encode")]
pub use encode::tiles;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub use entropy::fuzzing;
pub use preset::Preset;
pub use scene::{Packed, PackedHead, ReachedRecord, TargetRecord};
