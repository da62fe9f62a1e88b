//! The bytes of a file, mapped if possible.
//!
//! # Why this module may use `unsafe`
//! Mapping a file is the only way to read a gigabyte without copying it first. `memmap2` can offer it only as an unsafe
//! function. If another process shortens the file while it is mapped, reading the lost pages raises `SIGBUS`. (Windows
//! forbids the shortening.) A process cannot exclude this for a file that it does not own. Changed contents are harmless
//! here, because every reader treats the bytes as untrusted and takes sizes from the header only once. Callers who cannot
//! accept the risk build without the `mmap` feature, or pass bytes they own.

use std::io::{self, Read};
use std::ops::Deref;
use std::path::Path;

use crate::support::error::{Error, Result};
use crate::support::limits::Limits;

/// The bytes of a file, as a slice. They are the pages of the file if it can be mapped, otherwise a copy.
#[derive(Debug)]
pub struct Input(Bytes);

#[derive(Debug)]
enum Bytes {
    /// Pages of the file itself, which do not count as anonymous memory.
    #[cfg(feature = "mmap")]
    Mapped(memmap2::Mmap),
    /// A copy of the bytes: for pipes, for empty files, and in builds without `mmap`.
    Owned(Vec<u8>),
}

impl Input {
    /// Maps `path` if it is a regular file; otherwise reads it to its end.
    ///
    /// # Errors
    /// [`Error::Io`] that names `path`, also if it is a folder.
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_within(path, &Limits::default())
    }

    /// Opens `path` as [`Self::open`] does, but reads at most [`Limits::bytes`] of a file that cannot be mapped.
    ///
    /// # Errors
    /// [`Error::Io`] that names `path`, also if it is a folder. [`Error::Limit`] if the file is longer.
    pub fn open_within(path: &Path, limits: &Limits) -> Result<Self> {
        let name = path.display().to_string();
        let file = std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
        let kind = file.metadata().map_err(|e| Error::io(path, e))?;
        if kind.is_dir() {
            let text = "it is a folder, and a file is needed: name the file in it";
            return Err(Error::io(path, io::Error::new(io::ErrorKind::IsADirectory, text)));
        }
        #[cfg(feature = "mmap")]
        {
            // An empty mapping is an error on some systems.
            if kind.is_file() && kind.len() > 0 {
                let map = map(&file).map_err(|e| Error::io(path, e))?;
                return Ok(Self(Bytes::Mapped(map)));
            }
        }
        Self::read(&name, file, limits)
    }

    /// Reads `reader` to its end. `name` is its name in errors.
    ///
    /// # Errors
    /// [`Error::Io`] that names `name`, [`Error::Limit`] if there are more bytes than [`Limits::bytes`].
    pub fn read(name: &str, reader: impl Read, limits: &Limits) -> Result<Self> {
        let mut bytes = Vec::new();
        // One byte over the limit tells a file that is too long from a file that just fits.
        reader
            .take(limits.bytes.saturating_add(1))
            .read_to_end(&mut bytes)
            .map_err(|e| Error::io(name, e))?;
        limits.check_file(name, bytes.len() as u64)?;
        Ok(Self::from(bytes))
    }
}

impl Input {
    /// Gives the pages of a mapped file back to the system, which keeps them for as long as it has room. The bytes stay as they
    /// are: a page is read again when it is needed. Otherwise a file of which every part was read counts whole as resident
    /// memory. It does nothing for a copy, and on Windows.
    pub fn release_pages(&self) {
        #[cfg(all(feature = "mmap", unix))]
        if let Bytes::Mapped(map) = &self.0 {
            release(map);
        }
    }
}

impl From<Vec<u8>> for Input {
    fn from(bytes: Vec<u8>) -> Self {
        Self(Bytes::Owned(bytes))
    }
}

#[cfg(feature = "mmap")]
#[expect(unsafe_code, reason = "memory mapping; see the module's documentation")]
fn map(file: &std::fs::File) -> io::Result<memmap2::Mmap> {
    // SAFETY: the mapping is private to this process and read-only, so nothing here can write through it. Another
    // process can still change the file. If it truncates the file, the system ends this process with SIGBUS and
    // never gives it wrong memory. If it writes to the file, bytes may change under a shared slice; no type can rule
    // that out, and no reader here relies on it. The module's documentation says so, and the `mmap` feature turns
    // mapping off.
    unsafe { memmap2::MmapOptions::new().map_copy_read_only(file) }
}

#[cfg(all(feature = "mmap", unix))]
#[expect(unsafe_code, reason = "memory mapping; see the module's documentation")]
fn release(map: &memmap2::Mmap) {
    // SAFETY: the mapping is read-only, so its pages are those of the file, and a page that is read again has the same bytes.
    // So slices of the mapping stay as they are. (`memmap2` warns of writable mappings, which lose what was written.) The
    // file may have changed, as `map` says.
    let advised = unsafe { map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
    // A system that refuses the advice keeps the pages.
    let _ = advised;
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

    /// Kilobytes of the file `name` that are resident in mappings of this process.
    #[cfg(all(feature = "mmap", target_os = "linux"))]
    fn resident(name: &str) -> u64 {
        let mut of_file = false;
        let mut sum = 0;
        for line in std::fs::read_to_string("/proc/self/smaps").unwrap().lines() {
            match line.strip_prefix("Rss:") {
                Some(size) if of_file => {
                    sum += size.trim().trim_end_matches(" kB").parse::<u64>().unwrap();
                }
                Some(_) => {}
                // Only the first line of a mapping has an address and perhaps a path.
                None if line.contains('-') && !line.contains(" kB") => of_file = line.ends_with(name),
                None => {}
            }
        }
        sum
    }

    #[test]
    #[cfg(all(feature = "mmap", target_os = "linux"))]
    fn released_pages_are_not_resident_and_are_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pages-to-release");
        let bytes: Vec<u8> = (0..1_000_000_u32).map(|i| i.wrapping_mul(37).to_le_bytes()[1]).collect();
        std::fs::write(&path, &bytes).unwrap();
        let input = Input::open(&path).unwrap();
        for _ in 0..2 {
            assert_eq!(*input, *bytes);
            assert!(resident("pages-to-release") > 900);
            input.release_pages();
            assert_eq!(resident("pages-to-release"), 0);
        }
        assert_eq!(*input, *bytes);
        Input::from(vec![1, 2]).release_pages();
    }

    /// A mapped file holds the same bytes as a file that was read.
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
            // Replacing the file leaves the mapping as it is. Windows does not allow the replacement.
            #[cfg(unix)]
            {
                std::fs::write(folder.path().join("other"), [9; 10]).unwrap();
                std::fs::rename(folder.path().join("other"), &path).unwrap();
                assert_eq!(*input, *bytes, "{len}, replaced");
            }
        }
        let said = Input::open(folder.path()).unwrap_err().to_string();
        assert!(said.contains("it is a folder"), "{said}");
        let missing = Input::open(&folder.path().join("nothing")).unwrap_err().to_string();
        assert!(missing.contains("nothing"), "{missing}");
    }
}
