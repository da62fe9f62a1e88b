//! Conversion of scenes larger than memory, a part at a time.
//!
//! A scene comes from any [`SplatSource`], and a result goes to any [`Sink`](crate::Sink). The bytes are those of the
//! functions that hold the whole scene, except for [`pack`]. Anonymous memory does not grow with the number of Gaussians.
//! Temporary files are as large as the output, and for packing also as large as the input. They have no name. They lie in
//! the folder of the output, or in the system's folder for temporary files if the output is no plain file.
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
//! let source = ply::PlySource::open("scene.ply", &bytes, &ply::ReadOptions::default(), &Silent)?;
//! let done = stream::compress(&source, &CompressOptions::default(), lexi::CodeLayout::Compact, &small, &Silent)?;
//! assert_eq!(done.gaussians, 2000);
//!
//! let bytes = Input::open(&small)?;
//! let reader = lexi::LexiReader::open("scene.lexi", &bytes, &Limits::default())?;
//! stream::decompress(&reader, &back, &Silent)?;
//! assert_eq!(std::fs::metadata(&back)?.len(), std::fs::metadata(&input)?.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod buckets;
#[cfg(feature = "encode")]
mod compress;
mod decompress;
#[cfg(feature = "encode")]
mod observer;
#[cfg(feature = "encode")]
mod order;
#[cfg(feature = "encode")]
mod pack;
mod rows;
mod source_order;
mod survey;

#[cfg(feature = "encode")]
pub use crate::packed::tiles::PackedFile;
#[cfg(feature = "encode")]
pub use compress::{Compressed, compress};
pub use decompress::decompress;
#[cfg(feature = "encode")]
pub use observer::{Observed, Observer};
#[cfg(feature = "encode")]
pub use pack::pack;
#[cfg(all(test, feature = "encode"))]
pub(crate) use pack::run as pack_in_buckets;
#[cfg(feature = "encode")]
pub(crate) use rows::RowLayout;
pub use source_order::in_source_order;
pub use survey::{Survey, lint, survey};

use std::ops::Range;

use crate::scene::source::SplatSource;
use crate::scene::splats::Splats;
use crate::support::error::Result;
use crate::support::parallel::AT_ONCE;
use crate::support::progress::Progress;

/// Reads Gaussians `rows` of `source` into `splats`, [`AT_ONCE`] of them at a time. Calls `take` after each read, with the
/// number of the first Gaussian that was read. Reports the bytes read to `progress`.
pub(crate) fn each_part(
    source: &dyn SplatSource,
    rows: Range<usize>,
    splats: &mut Splats,
    progress: &dyn Progress,
    take: &mut dyn FnMut(usize, &mut Splats) -> Result<()>,
) -> Result<()> {
    for start in rows.clone().step_by(AT_ONCE) {
        progress.check()?;
        let range = start..rows.end.min(start + AT_ONCE);
        source.read(range.clone(), splats)?;
        take(start, splats)?;
        progress.advance(range.len() as u64 * source.row_bytes());
    }
    Ok(())
}
