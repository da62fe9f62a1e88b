//! Scenes in the formats of other programs, in and out.
//!
//! [`open`] tells by content what a file is and gives a [`SplatSource`](lexisplat::SplatSource), which everything of this
//! project reads. [`write`](fn@write) writes a scene in any of the formats that can be written. docs/FORMATS.md says what
//! each format holds, which axes it has, and what is lost on the way.
//!
//! Scenes in memory have the axes of a trainer's PLY: readers turn to them, writers turn back.

mod axes;
mod compressed_ply;
mod edit;
mod gltf;
mod kind;
mod ksplat;
mod merge;
mod numbers;
mod opacity;
mod open;
mod rows;
mod settle;
mod siblings;
mod sog;
mod source;
mod splat;
mod spz;
mod turn_sh;
mod unknown;
mod write;

pub use edit::Edits;
pub use kind::Kind;
pub use merge::merge;
pub use open::{Opened, open};
pub use siblings::{Siblings, scene_path};
pub use sog::bundle;
pub use source::FormatSource;
pub use write::{Lost, WriteOptions, write};
