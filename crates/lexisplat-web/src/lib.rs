//! The decoder of lexisplat for browsers and Node, as WebAssembly, and with the feature `viewer` what the viewer page is
//! made of.
//!
//! The npm package `lexisplat` (`web/` in the repository) is what people use. Its JavaScript fetches bytes and owns the
//! workers. What is here does the rest:
//!
//! | where | what |
//! |---|---|
//! | [`Feed`], on the main thread | takes the bytes of a file as they come, and says which chunk is worth decoding next |
//! | [`Decoder`], in each worker | decodes chunks, which it gets as [jobs](Feed::job) |
//! | [`Whole`], in a worker | decodes files that cannot be decoded in part |
//!
//! No function panics, whatever bytes it is given. Errors become JavaScript's `Error` with the library's message.

mod chunk;
mod decoder;
mod feed;
mod job;
mod whole;

pub use chunk::Chunk;
pub use decoder::Decoder;
pub use feed::Feed;
pub use whole::Whole;

use lexisplat::Limits;
use wasm_bindgen::JsError;

/// Most bytes of arrays made of one file: half of what 32-bit WebAssembly can address, so that a file is refused before memory
/// runs out.
const MOST_BYTES: u64 = 2 << 30;

/// The limits of all readers here.
fn limits() -> Limits {
    Limits::default().with_bytes(MOST_BYTES)
}

/// The error that JavaScript sees.
fn thrown(error: impl std::fmt::Display) -> JsError {
    JsError::new(&error.to_string())
}
