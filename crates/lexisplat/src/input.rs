//! A file's bytes, mapped where that is possible.
//!
//! # Why this module may use `unsafe`
//! Mapping a file is the one way to read a gigabyte without copying it first, and `memmap2` can only
//! offer it as an unsafe function: if another process shortens the file while it is mapped, touching
//! the lost pages raises `SIGBUS` (on Windows the system forbids the shortening instead). Nothing in a
//! process can rule that out for a file it does not own. Changed contents, in contrast, are harmless
//! here: every reader treats the bytes as untrusted and takes sizes from the header only once.
//! Callers who cannot accept this build without the `mmap` feature, or pass bytes they own.

use std::ops::Deref;
use std::path::Path;

use crate::error::{Error, Result};

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
        #[cfg(feature = "mmap")]
        {
            let file = std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
            let kind = file.metadata().map_err(|e| Error::io(path, e))?;
            // An empty mapping is an error on some systems.
            if kind.is_file() && kind.len() > 0 {
                let map = map(&file).map_err(|e| Error::io(path, e))?;
                return Ok(Self(Bytes::Mapped(map)));
            }
        }
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
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
    // it. What remains is another process truncating the file while it is mapped, which ends this
    // process with SIGBUS rather than giving it wrong memory; the module's documentation says so, and
    // the `mmap` feature turns it off.
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
