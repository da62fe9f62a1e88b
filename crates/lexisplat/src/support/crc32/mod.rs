//! CRC-32 of bytes.
//!
//! Where there is an instruction for it, crc32fast is fastest. In WebAssembly there is none, and its tables, which do not
//! compress, would be a tenth of what a page loads.

#[cfg(any(test, target_family = "wasm"))]
mod sliced;

#[cfg(not(target_family = "wasm"))]
pub(crate) use crc32fast::{Hasher, hash};
#[cfg(target_family = "wasm")]
pub(crate) use sliced::{Hasher, hash};
