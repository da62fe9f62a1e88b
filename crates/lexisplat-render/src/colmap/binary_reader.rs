//! Reads a binary file from front to back. Each count in the file is checked against the number of bytes that follow it.

use std::fmt::{Arguments, Display};
use std::io::{BufRead, ErrorKind, Seek};

use crate::cameras_json::{MAX_CAMERAS, MAX_NAME};
use crate::error::{Error, Result};

/// Reads little-endian values from a reader of known length.
pub(super) struct BinaryReader<'a, R> {
    file: &'a str,
    reader: R,
    left: u64,
}

impl<'a, R: BufRead + Seek> BinaryReader<'a, R> {
    pub(super) fn new(file: &'a str, reader: R, len: u64) -> Self {
        Self { file, reader, left: len }
    }

    /// Returns an error about the file.
    pub(super) fn wrong(&self, what: impl Display, problem: impl Display) -> Error {
        Error::format(self.file, format!("{what}: {problem}"))
    }

    fn failed(&self, what: Arguments<'_>, error: std::io::Error) -> Error {
        if error.kind() == ErrorKind::UnexpectedEof { self.cut(what) } else { Error::io(self.file, error) }
    }

    fn cut(&self, what: Arguments<'_>) -> Error {
        self.wrong(what, "the file ends here; it is cut off or not a file of this kind")
    }

    fn take<const N: usize>(&mut self, what: Arguments<'_>) -> Result<[u8; N]> {
        self.left = self.left.checked_sub(N as u64).ok_or_else(|| self.cut(what))?;
        let mut bytes = [0; N];
        self.reader.read_exact(&mut bytes).map_err(|e| self.failed(what, e))?;
        Ok(bytes)
    }

    pub(super) fn u32(&mut self, what: Arguments<'_>) -> Result<u32> {
        self.take(what).map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self, what: Arguments<'_>) -> Result<u64> {
        self.take(what).map(u64::from_le_bytes)
    }

    pub(super) fn f64s<const N: usize>(&mut self, what: Arguments<'_>) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::from_le_bytes(self.take(what)?);
        }
        Ok(values)
    }

    /// Reads the number of entries that follow. Each entry takes at least `least` bytes.
    pub(super) fn count(&mut self, what: &str, least: u64) -> Result<u64> {
        let count = self.u64(format_args!("number of {what}"))?;
        if count > self.left / least {
            let problem = format!("{count} do not fit in the {} bytes that follow", self.left);
            return Err(self.wrong(format_args!("number of {what}"), problem));
        }
        if count > MAX_CAMERAS as u64 {
            let what = format!("{}: {what}", self.file);
            return Err(Error::limit(what, count, MAX_CAMERAS as u64));
        }
        Ok(count)
    }

    /// Skips `count` entries of `size` bytes.
    pub(super) fn skip(&mut self, count: u64, size: u64, what: Arguments<'_>) -> Result<()> {
        let bytes = count.checked_mul(size).filter(|bytes| *bytes <= self.left);
        let Some((bytes, offset)) = bytes.and_then(|b| Some((b, i64::try_from(b).ok()?))) else {
            let problem = format!("{count} do not fit in the {} bytes that follow", self.left);
            return Err(self.wrong(what, problem));
        };
        self.left -= bytes;
        self.reader.seek_relative(offset).map_err(|e| self.failed(what, e))
    }

    /// Reads a text up to a zero byte.
    pub(super) fn name(&mut self, what: Arguments<'_>) -> Result<String> {
        let mut bytes = Vec::new();
        loop {
            match self.take(what)? {
                [0] => break,
                [byte] if bytes.len() < MAX_NAME => bytes.push(byte),
                _ => return Err(self.wrong(what, format!("over the limit of {MAX_NAME} bytes"))),
            }
        }
        String::from_utf8(bytes).map_err(|e| {
            let lossy = String::from_utf8_lossy(e.as_bytes()).into_owned();
            self.wrong(what, format!("'{lossy}' is not UTF-8"))
        })
    }

    /// Checks that no bytes follow.
    pub(super) fn end(&self, what: &str) -> Result<()> {
        if self.left > 0 {
            return Err(self.wrong(what, format!("{} bytes follow the last one", self.left)));
        }
        Ok(())
    }
}
