//! A file's bytes, mapped where that is possible.
//!
//! # Why this module may use `unsafe`
//! Mapping a file is the one way to read a gigabyte without copying it first, and `memmap2` can only
//! offer it as an unsafe function: if another process shortens the file while it is mapped, touching
//! the lost pages raises `SIGBUS` (on Windows the system forbids the shortening instead). Nothing in a
//! process can rule that out for a file it does not own. Changed contents, in contrast, are harmless
//! here: every reader treats the bytes as untrusted and takes sizes from the header only once.
//! Callers who cannot accept this build without the `mmap` feature, or pass bytes they own.

use std::io::Read;
use std::ops::Deref;
use std::path::Path;

use crate::support::error::{Error, Result};
use crate::support::limits::Limits;

/// The bytes of a file, as a slice: its own pages where it can be mapped, else a copy.
#[derive(Debug)]
pub struct Input(Bytes);

#[derive(Debug)]
enum Bytes {
    /// Pages of the file itself; they do not count as anonymous memory.
    #[cfg(feature = "mmap")]
    Mapped(memmap2::Mmap),
    /// A copy, for pipes, empty files and builds without `mmap`.
    Owned(Vec<u8>),
}

impl Input {
    /// Maps the regular file `path`, or reads anything else to its end.
    ///
    /// # Errors
    /// [`Error::Io`] naming `path`.
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_within(path, &Limits::default())
    }

    /// [`Self::open`] that reads no more than [`Limits::bytes`] of what cannot be mapped.
    ///
    /// # Errors
    /// [`Error::Io`] naming `path`, [`Error::Limit`] if there is more.
    pub fn open_within(path: &Path, limits: &Limits) -> Result<Self> {
        let name = path.display().to_string();
        let file = std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
        #[cfg(feature = "mmap")]
        {
            let kind = file.metadata().map_err(|e| Error::io(path, e))?;
            // An empty mapping is an error on some systems.
            if kind.is_file() && kind.len() > 0 {
                let map = map(&file).map_err(|e| Error::io(path, e))?;
                return Ok(Self(Bytes::Mapped(map)));
            }
        }
        Self::read(&name, file, limits)
    }

    /// All that `reader` gives, but no more than [`Limits::bytes`]; errors call it `name`.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Limit`], naming `name`.
    pub fn read(name: &str, reader: impl Read, limits: &Limits) -> Result<Self> {
        let mut bytes = Vec::new();
        // A byte more tells too long from just as long.
        reader
            .take(limits.bytes.saturating_add(1))
            .read_to_end(&mut bytes)
            .map_err(|e| Error::io(name, e))?;
        limits.check_file(name, bytes.len() as u64)?;
        Ok(Self::from(bytes))
    }
}

impl From<Vec<u8>> for Input {
    fn from(bytes: Vec<u8>) -> Self {
        Self(Bytes::Owned(bytes))
    }
}

#[cfg(feature = "mmap")]
#[expect(unsafe_code, reason = "memory mapping; see the module's documentation")]
fn map(file: &std::fs::File) -> std::io::Result<memmap2::Mmap> {
    // SAFETY: the mapping is private to this process and read-only, so nothing here can write through
    // it. What remains is another process: if it truncates the file while it is mapped, the system ends
    // this one with SIGBUS rather than giving it wrong memory; if it writes to the file, bytes may change
    // under a shared slice, which no type can rule out and no reader here relies on. The module's
    // documentation says so, and the `mmap` feature turns it off.
    unsafe { memmap2::MmapOptions::new().map_copy_read_only(file) }
}

impl Deref for Input {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match &self.0 {
            #[cfg(feature = "mmap")]
            Bytes::Mapped(map) => map,
            Bytes::Owned(bytes) => bytes,
        }
    }
}

impl AsRef<[u8]> for Input {
    fn as_ref(&self) -> &[u8] {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The safe twin: what is mapped is what is read.
    #[test]
    fn mapped_bytes_are_those_of_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        for len in [0, 1, 4095, 4096, 4097, 100_000] {
            let bytes: Vec<u8> = (0..len).map(|i: u32| i.wrapping_mul(37).to_le_bytes()[1]).collect();
            std::fs::write(&path, &bytes).unwrap();
            let input = Input::open(&path).unwrap();
            assert_eq!(*input, *bytes, "{len}");
            #[cfg(feature = "mmap")]
            assert_eq!(matches!(input.0, Bytes::Mapped(_)), len > 0, "{len}");
            let read = Input::read("file", std::fs::File::open(&path).unwrap(), &Limits::default()).unwrap();
            assert_eq!(*read, *bytes, "{len}");
            // Another file of the same name leaves the mapping alone; Windows does not let it come.
            #[cfg(unix)]
            {
                std::fs::write(folder.path().join("other"), [9; 10]).unwrap();
                std::fs::rename(folder.path().join("other"), &path).unwrap();
                assert_eq!(*input, *bytes, "{len}, replaced");
            }
        }
        let missing = Input::open(&folder.path().join("nothing")).unwrap_err().to_string();
        assert!(missing.contains("nothing"), "{missing}");
    }
}
