//! The decoder of lexisplat for browsers and Node, as WebAssembly, and with the feature `viewer` the parts of the viewer page.
//!
//! People use the npm package `lexisplat` (`web/` in the repository). Its JavaScript fetches the bytes and owns the workers. This
//! crate does the rest:
//!
//! | feature | type, and where it runs | purpose |
//! |---|---|---|
//! | `feed` | [`Feed`], on the main thread | takes the bytes of a file as they arrive, and tells which chunk to decode next |
//! | `stream` | [`Stream`], on the main thread | takes the ranges of a large file that a view needs within a budget |
//! | `feed` | [`Decoder`], in each worker | decodes chunks, which it gets as [jobs](Feed::job) |
//! | `files` | [`Whole`], in a worker | decodes files that cannot be decoded in part |
//!
//! Pages load what they need: the npm package has one WebAssembly module of `feed` and one of `files`.
//!
//! The feature `viewer` adds:
//!
//! | function or type, and where it runs | purpose |
//! |---|---|
//! | `open_scene`, in a worker | reads a scene of any format and returns its parts in the form that the GPU holds |
//! | `Viewer`, on the main thread | draws one or two scenes of such parts by WebGPU, or lets a [`Processor`] draw them |
//!
//! The feature `processor` has [`Processor`], which draws such parts in a worker, without a GPU. It is a module of its own, which
//! browsers with WebGPU do not load.
//!
//! No function panics, whatever bytes it is given. Errors become JavaScript's `Error` with the library's message.

#[cfg(any(feature = "feed", feature = "files"))]
mod chunk;
#[cfg(feature = "feed")]
mod decoder;
#[cfg(feature = "feed")]
mod feed;
#[cfg(any(feature = "feed", feature = "files"))]
mod header;
#[cfg(feature = "feed")]
mod job;
#[cfg(feature = "viewer")]
mod parts;
#[cfg(feature = "processor")]
mod processor;
#[cfg(any(feature = "processor", feature = "viewer"))]
mod processor_view;
#[cfg(feature = "stream")]
mod stream;
#[cfg(all(feature = "viewer", target_family = "wasm"))]
mod viewer;
#[cfg(feature = "files")]
mod whole;

#[cfg(any(feature = "feed", feature = "files"))]
pub use chunk::Chunk;
#[cfg(feature = "feed")]
pub use decoder::Decoder;
#[cfg(feature = "feed")]
pub use feed::Feed;
#[cfg(feature = "viewer")]
pub use parts::open_scene;
#[cfg(feature = "processor")]
pub use processor::{Composed, Processor};
#[cfg(feature = "stream")]
pub use stream::Stream;
#[cfg(all(feature = "viewer", target_family = "wasm"))]
pub use viewer::Viewer;
#[cfg(feature = "files")]
pub use whole::Whole;

#[cfg(any(feature = "feed", feature = "files"))]
use lexisplat::Limits;
use wasm_bindgen::JsError;

/// Largest number of bytes of arrays made of one file. It is half of what 32-bit WebAssembly can address, so that a file
/// is refused before memory runs out.
#[cfg(any(feature = "feed", feature = "files"))]
const MOST_BYTES: u64 = 2 << 30;

/// Returns the limits of all readers of this crate.
#[cfg(any(feature = "feed", feature = "files"))]
fn limits() -> Limits {
    Limits::default().with_bytes(MOST_BYTES)
}

/// Returns the error for JavaScript.
fn thrown(error: impl std::fmt::Display) -> JsError {
    JsError::new(&error.to_string())
}
