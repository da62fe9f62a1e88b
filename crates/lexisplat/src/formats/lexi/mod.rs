//! The .lexi file: a safetensors file whose tensors are a [`Model`](crate::Model).
//!
//! docs/FORMAT.md is the specification. Every byte is covered by a CRC-32: each tensor by an entry of the
//! metadata key `checksums`, the header by the tensor `checksum.header`.

mod chunks;
mod dictionary_file;
mod exact;
mod packed;
mod read;
mod schema;
mod spilled;
mod tensors;
mod write;

pub use chunks::LexiChunks;
pub use dictionary_file::{read_dictionary, read_dictionary_bytes, write_dictionary};
pub(crate) use packed::{SpilledPacked, write_spilled_packed};
pub use packed::{packed_bytes, packed_tensor_bytes, write_packed};
pub use read::{Contents, open, open_bytes, read, read_bytes, unpack};
pub use schema::{MAX_VERSION, PACKED_VERSION, VERSION};
pub(crate) use spilled::{Extras, SpilledModel};
pub(crate) use write::is_sh;
pub use write::{attribute_bytes, file_bytes, sh_bytes, write};
