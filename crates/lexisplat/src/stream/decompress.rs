//! Conversion of a .lexi file to a PLY, a part at a time.

use super::source_order::in_source_order;
use crate::formats::lexi::LexiReader;
use crate::formats::ply::write_parts;
use crate::scene::source::SplatSource;
use crate::support::error::Result;
use crate::support::progress::Progress;
use crate::support::sink::Sink;

/// Writes the dense scene of `lexi` as a PLY to `sink`. The bytes are those of [`lexi::read`](crate::formats::lexi::read)
/// and [`ply::write`](crate::formats::ply::write()). Returns their number.
///
/// # Errors
/// Errors of these two functions; [`crate::Error::Io`] for temporary files, which a packed file with its source's order
/// needs; [`crate::Error::Cancelled`].
pub fn decompress<'a>(
    lexi: &LexiReader<'_>,
    sink: impl Into<Sink<'a>>,
    progress: &dyn Progress,
) -> Result<u64> {
    let sink = sink.into();
    let folder = sink.spill_folder()?;
    write_parts(sink, &lexi.empty(), lexi.has_normals(), lexi.len(), progress, |write| {
        in_source_order(lexi, &folder, &mut |splats| {
            progress.check()?;
            write(&splats)
        })
    })
}
