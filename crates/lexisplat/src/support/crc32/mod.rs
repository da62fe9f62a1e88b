//! CRC-32 of bytes.
//!
//! The crate crc32fast is fastest where the CPU has an instruction for CRC-32. WebAssembly has no such instruction. There,
//! the tables of crc32fast, which do not compress, would be a tenth of the bytes that a page loads.

#[cfg(any(test, target_family = "wasm"))]
mod sliced;

#[cfg(not(target_family = "wasm"))]
pub(crate) use crc32fast::{Hasher, hash};
#[cfg(target_family = "wasm")]
pub(crate) use sliced::{Hasher, hash};
