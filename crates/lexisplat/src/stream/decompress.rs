//! From a .lexi file to a PLY, a part at a time.

use super::source_order::in_source_order;
use crate::formats::lexi::LexiChunks;
use crate::formats::ply::{PlyWriter, check, file_bytes};
use crate::support::error::Result;
use crate::support::progress::Progress;
use crate::support::sink::Sink;

/// Writes the dense scene of `lexi` as a PLY to `sink`: the bytes that [`lexi::read`](crate::formats::lexi::read)
/// and [`ply::write`](crate::formats::ply::write()) would make. Returns their number.
///
/// # Errors
/// As those two; [`crate::Error::Io`] also for temporary files, which a packed file with its source's order
/// needs; [`crate::Error::Cancelled`].
pub fn decompress<'a>(
    lexi: &LexiChunks<'_>,
    sink: impl Into<Sink<'a>>,
    progress: &dyn Progress,
) -> Result<u64> {
    let sink = sink.into();
    let folder = sink.spill_folder()?;
    let like = lexi.empty();
    check(&like)?;
    sink.write(file_bytes(&like, lexi.len()), progress, |writer, named| {
        let mut ply = PlyWriter::begin(writer, &like, lexi.len()).map_err(named)?;
        in_source_order(lexi, &folder, &mut |splats| ply.write(&splats).map_err(named))
    })
}
