//! gzip and Zstandard, with sizes that are known in advance.

use std::io::{self, Read, Write};

use flate2::Compression;
use flate2::bufread::GzDecoder;
use flate2::write::GzEncoder;
use lexisplat::{Error, FormatError, Result};

/// Compression level of deflate, 0 to 9 (`Z_DEFAULT_COMPRESSION` of the reference).
const DEFLATE_LEVEL: u32 = 6;
/// Compression level of Zstandard (`compressZstd` of the reference).
const ZSTD_LEVEL: i32 = 12;

/// Reads the bytes inside a gzip file, or the bytes of a file that was inflated before.
pub(super) struct Gunzip<'a> {
    name: &'a str,
    decoder: Box<dyn Read + 'a>,
}

impl<'a> Gunzip<'a> {
    pub(super) fn new(name: &'a str, bytes: &'a [u8]) -> Self {
        Self { name, decoder: Box::new(GzDecoder::new(bytes)) }
    }

    /// Returns a reader of `bytes` without inflating.
    pub(super) fn plain(name: &'a str, bytes: &'a [u8]) -> Self {
        Self { name, decoder: Box::new(bytes) }
    }

    /// Fills `out` with bytes. Errors call them `what`.
    pub(super) fn fill(&mut self, what: &str, out: &mut [u8]) -> Result<()> {
        let mut done = 0;
        while done < out.len() {
            match self.decoder.read(&mut out[done..]) {
                Ok(0) => {
                    let (expected, found) = (out.len() as u64, done as u64);
                    let problem = FormatError::Truncated { what: what.to_owned(), expected, found };
                    return Err(Error::format(self.name, problem));
                }
                Ok(more) => done += more,
                Err(error) => return Err(self.damaged(what, &error)),
            }
        }
        Ok(())
    }

    /// Returns all remaining bytes, at most `most`.
    pub(super) fn rest(mut self, what: &str, most: u64) -> Result<Vec<u8>> {
        let mut rest = Vec::new();
        let read = (&mut self.decoder).take(most.saturating_add(1)).read_to_end(&mut rest);
        read.map_err(|error| self.damaged(what, &error))?;
        if rest.len() as u64 > most {
            return Err(Error::malformed(self.name, format!("more than {most} bytes of {what}")));
        }
        Ok(rest)
    }

    fn damaged(&self, what: &str, error: &io::Error) -> Error {
        Error::malformed(self.name, format!("{what}: the gzip stream is damaged: {error}"))
    }
}

/// Returns `parts` as a gzip file without a name and a time.
pub(super) fn gzip(parts: &[&[u8]]) -> Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(DEFLATE_LEVEL));
    for part in parts {
        encoder.write_all(part).map_err(|source| Error::Writer { source })?;
    }
    encoder.finish().map_err(|source| Error::Writer { source })
}

/// Fills `out` with the contents of the Zstandard frame `bytes`, which must have exactly this length.
pub(super) fn unzstd(name: &str, what: &str, bytes: &[u8], out: &mut [u8]) -> Result<()> {
    let damaged =
        |error: String| Error::malformed(name, format!("{what}: the Zstandard frame is damaged: {error}"));
    #[cfg(feature = "zstd")]
    let found = zstd::bulk::decompress_to_buffer(bytes, out).map_err(|error| damaged(error.to_string()))?;
    #[cfg(not(feature = "zstd"))]
    let found = structured_zstd::decoding::FrameDecoder::new()
        .decode_all(bytes, out)
        .map_err(|error| damaged(error.to_string()))?;
    if found == out.len() {
        return Ok(());
    }
    let problem =
        FormatError::Truncated { what: what.to_owned(), expected: out.len() as u64, found: found as u64 };
    Err(Error::format(name, problem))
}

/// Returns `bytes` as a Zstandard frame.
pub(super) fn zstd(bytes: &[u8]) -> Result<Vec<u8>> {
    #[cfg(feature = "zstd")]
    return zstd::bulk::compress(bytes, ZSTD_LEVEL).map_err(|source| Error::Writer { source });
    #[cfg(not(feature = "zstd"))]
    Ok(structured_zstd::encoding::compress_to_vec(
        bytes,
        structured_zstd::encoding::CompressionLevel::from_level(ZSTD_LEVEL),
    ))
}
