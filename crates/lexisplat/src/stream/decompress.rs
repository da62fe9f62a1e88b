//! From a .lexi file to a PLY, a part at a time.

use std::io::Write;
use std::path::Path;

use super::source_order::in_source_order;
use crate::formats::lexi::LexiChunks;
use crate::formats::ply::{PlyWriter, check};
use crate::support::error::{Error, Result};
use crate::support::output::{Output, write_whole};
use crate::support::progress::{Progress, Stage};

/// Writes the dense scene of `lexi` to the PLY `output`, whole or not at all: the bytes that
/// [`lexi::read`](crate::formats::lexi::read) and [`ply::write`](crate::formats::ply::write()) would make. Returns their
/// number.
///
/// # Errors
/// As those two; [`Error::Io`] also for temporary files beside `output`, which a packed file with its
/// source's order needs.
pub fn decompress_file<'a>(
    lexi: &LexiChunks<'_>,
    output: impl Into<Output<'a>>,
    progress: &dyn Progress,
) -> Result<u64> {
    let output = output.into();
    let folder = output.spill_folder()?;
    let mut bytes = 0;
    write_whole(output.of_bytes(size(lexi)?), |writer| {
        bytes = run(lexi, writer, &folder, &|e| Error::io(output.path(), e), progress)?;
        Ok(())
    })?;
    Ok(bytes)
}

/// [`decompress_file`] to a writer; temporary files are where the system wants them.
///
/// # Errors
/// As [`decompress_file`]; [`Error::Writer`] if the writer fails.
pub fn decompress_to(lexi: &LexiChunks<'_>, writer: &mut impl Write, progress: &dyn Progress) -> Result<u64> {
    run(lexi, writer, &std::env::temp_dir(), &Error::writer, progress)
}

/// Bytes of the PLY that `lexi` becomes.
fn size(lexi: &LexiChunks<'_>) -> Result<u64> {
    let like = lexi.empty();
    check(&like)?;
    let ply = PlyWriter::begin(Vec::new(), &like, lexi.len()).map_err(Error::writer)?;
    Ok(ply.bytes + ply.row_bytes() * lexi.len() as u64)
}

fn run(
    lexi: &LexiChunks<'_>,
    writer: &mut impl Write,
    folder: &Path,
    io: &dyn Fn(std::io::Error) -> Error,
    progress: &dyn Progress,
) -> Result<u64> {
    let like = lexi.empty();
    check(&like)?;
    let mut ply = PlyWriter::begin(writer, &like, lexi.len()).map_err(io)?;
    progress.begin(Stage::Write, ply.row_bytes() * lexi.len() as u64);
    in_source_order(lexi, folder, &mut |splats| {
        ply.write(&splats).map_err(io)?;
        progress.advance(ply.row_bytes() * splats.len() as u64);
        Ok(())
    })?;
    progress.end();
    Ok(ply.bytes)
}
