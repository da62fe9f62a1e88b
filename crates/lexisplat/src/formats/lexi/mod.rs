//! The .lexi file: a safetensors file that holds a [`Model`](crate::Model) or a
//! [`Packed`](crate::packed::Packed) scene.
//!
//! docs/FORMAT.md is the specification. Every byte is covered by a CRC-32. The metadata key `checksums` has an entry for
//! each tensor, and the tensor `checksum.header` covers the header. In packed files, one CRC-32 covers the header and the
//! tensor `packed.head`. This tensor holds a CRC-32 for each range of `packed.data`.

mod checked;
mod dictionary_file;
mod exact;
mod exact_tensors;
mod extra_column;
mod feed;
mod fields;
mod header;
mod json;
mod layout;
mod packed;
mod reader;
mod schema;
#[cfg(feature = "encode")]
mod spilled;
mod tensors;
mod write;

pub use dictionary_file::{read_dictionary, read_dictionary_bytes, write_dictionary};
pub use feed::{ChunkChange, DrawnChunks, FeedOptions, LexiFeed, StreamedScene};
pub use layout::{CodeLayout, Layout};
pub use reader::{LexiReader, read, read_bytes};
pub use schema::{MAX_VERSION, PACKED_VERSION, VERSION};
#[cfg(feature = "encode")]
pub(crate) use spilled::SpilledModel;
pub use write::{LexiWriter, write};
