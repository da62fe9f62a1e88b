//! The container of a glb (glTF 2.0 specification, "GLB File Format Specification").

use lexisplat::{Error, FormatError, Result};

use crate::numbers::u32_at;

/// First bytes of a glb.
pub(crate) const MAGIC: &[u8] = b"glTF";
/// Version of the container.
pub(super) const VERSION: u32 = 2;
/// Number of bytes of the header: first bytes, version, and length of the file.
pub(super) const HEADER: usize = 12;
/// Number of bytes of a chunk's length and type.
pub(super) const CHUNK_HEADER: usize = 8;
/// Types of chunks.
pub(super) const JSON: [u8; 4] = *b"JSON";
pub(super) const BIN: [u8; 4] = *b"BIN\0";

/// The chunks of a glb that are read.
#[derive(Debug, Default)]
pub(super) struct Chunks<'a> {
    pub(super) json: &'a [u8],
    pub(super) bin: Option<&'a [u8]>,
    pub(super) warnings: Vec<String>,
}

fn truncated(name: &str, what: &str, expected: usize, found: usize) -> Error {
    let (expected, found) = (expected as u64, found as u64);
    Error::format(name, FormatError::Truncated { what: what.to_owned(), expected, found })
}

impl<'a> Chunks<'a> {
    /// Returns the chunks of the glb in `bytes`, which messages call `name`.
    ///
    /// # Errors
    /// [`Error::Format`] for another version, for lengths that do not match the file, and for chunks out of order.
    pub(super) fn read(name: &str, bytes: &'a [u8]) -> Result<Self> {
        if bytes.len() < HEADER {
            return Err(truncated(name, "the header of a glb", HEADER, bytes.len()));
        }
        let (version, length) = (u32_at(bytes, 4), u32_at(bytes, 8) as usize);
        if version != VERSION {
            let problem = FormatError::Version { found: version.into(), supported: VERSION.into() };
            return Err(Error::format(name, problem));
        }
        let Some(bytes) = bytes.get(..length) else {
            return Err(truncated(name, "the glb", length, bytes.len()));
        };
        let mut chunks = Self::default();
        let mut at = HEADER;
        while at < bytes.len() {
            let Some(header) = bytes.get(at..at + CHUNK_HEADER) else {
                return Err(truncated(name, "the header of a chunk", at + CHUNK_HEADER, bytes.len()));
            };
            let is_first = at == HEADER;
            at += CHUNK_HEADER;
            let length = u32_at(header, 0) as usize;
            let Some(chunk) = bytes[at..].get(..length) else {
                return Err(truncated(name, "a chunk", at.saturating_add(length), bytes.len()));
            };
            at += length;
            let kind = &header[4..];
            if is_first != (kind == JSON) {
                let text = if is_first { "the first chunk is not JSON" } else { "there are two JSON chunks" };
                return Err(Error::malformed(name, text));
            }
            if is_first {
                chunks.json = chunk;
            } else if kind == BIN {
                if chunks.bin.replace(chunk).is_some() {
                    return Err(Error::malformed(name, "there are two BIN chunks"));
                }
            } else {
                let kind = kind.escape_ascii();
                let text = format!("a chunk of type '{kind}' is not known, and left out");
                super::warn(&mut chunks.warnings, text);
            }
        }
        if chunks.json.is_empty() {
            return Err(Error::malformed(name, "the JSON chunk is missing"));
        }
        Ok(chunks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(chunks: &[([u8; 4], &[u8])]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, chunk) in chunks {
            body.extend(u32::try_from(chunk.len()).unwrap().to_le_bytes());
            body.extend(kind);
            body.extend(*chunk);
        }
        let length = u32::try_from(HEADER + body.len()).unwrap();
        [MAGIC, &VERSION.to_le_bytes(), &length.to_le_bytes(), &body].concat()
    }

    fn error(bytes: &[u8]) -> String {
        Chunks::read("a", bytes).unwrap_err().to_string()
    }

    #[test]
    fn chunks_are_found_and_unknown_ones_are_skipped() {
        let bytes = glb(&[(JSON, b"{}  "), (*b"what", b"1234"), (BIN, b"5678")]);
        let chunks = Chunks::read("a", &bytes).unwrap();
        assert_eq!((chunks.json, chunks.bin), (&b"{}  "[..], Some(&b"5678"[..])));
        assert!(chunks.warnings[0].contains("'what'"));
        // Bytes after the glb do not belong to it.
        let longer = [&bytes[..], b"rest"].concat();
        assert_eq!(Chunks::read("a", &longer).unwrap().bin, Some(&b"5678"[..]));
    }

    #[test]
    fn chunks_that_lie_or_are_out_of_order_are_refused() {
        let bytes = glb(&[(JSON, b"{}  "), (BIN, b"5678")]);
        for end in 0..bytes.len() {
            assert!(Chunks::read("a", &bytes[..end]).is_err(), "{end}");
        }
        let mut long = bytes.clone();
        long[HEADER] = 200;
        assert!(error(&long).contains("a chunk"), "{}", error(&long));
        let mut old = bytes;
        old[4] = 1;
        assert!(error(&old).contains("version 1"), "{}", error(&old));
        assert!(error(&glb(&[(BIN, b"1234"), (JSON, b"{}  ")])).contains("the first chunk is not JSON"));
        assert!(error(&glb(&[(JSON, b"{}  "), (JSON, b"{}  ")])).contains("two JSON"));
        assert!(error(&glb(&[(JSON, b"{}  "), (BIN, b""), (BIN, b"")])).contains("two BIN"));
        assert!(error(&glb(&[])).contains("missing"));
    }
}
