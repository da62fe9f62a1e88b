//! Scenes larger than memory: files to files, a part at a time.
//!
//! What comes out is byte for byte what the functions that hold the whole scene make of it, but for
//! [`pack_file`]. Anonymous memory is bounded whatever the number of Gaussians; temporary files as large as
//! the output, when packing also as the input, lie beside the output, or in the system's folder for
//! them if that is no plain file, and have no name.
//!
//! ```
//! use lexisplat_sample::{SampleOptions, scene};
//! use lexisplat::{CompressOptions, Input, Limits, Silent, lexi, ply, stream};
//!
//! let folder = tempfile::tempdir()?;
//! let [input, small, back] = ["scene.ply", "scene.lexi", "back.ply"].map(|name| folder.path().join(name));
//! ply::write(&input, &scene(&SampleOptions::new(2000, 0)))?;
//!
//! let bytes = Input::open(&input)?;
//! let chunks = ply::PlyChunks::open("scene.ply", &bytes, &ply::ReadOptions::default(), &Silent)?;
//! let done = stream::compress_file(&chunks, &CompressOptions::default(), &small, &Silent)?;
//! assert_eq!(done.gaussians, 2000);
//!
//! let bytes = Input::open(&small)?;
//! let chunks = lexi::LexiChunks::open("scene.lexi", &bytes, &Limits::default())?;
//! stream::decompress_file(&chunks, &back, &Silent)?;
//! assert_eq!(std::fs::metadata(&back)?.len(), std::fs::metadata(&input)?.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod buckets;
mod compress;
mod counted;
mod decompress;
mod importance;
mod order;
mod pack;
mod source_order;
mod survey;

pub use compress::{Compressed, compress_file, compress_to};
pub use decompress::{decompress_file, decompress_to};
pub use importance::Importance;
pub use pack::{PackedFile, pack_file, pack_to};
pub use source_order::in_source_order;
pub use survey::{Survey, lint_ply, survey};
