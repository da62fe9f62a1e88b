//! Reads the lines of a text file. The memory held for a line is limited, however long the line is.

use std::fmt::Display;
use std::io::{BufRead, Read};

use crate::error::{Error, Result};

/// Longest line that is read as text, in bytes. It has room for the longest name and ten numbers.
const MAX_LINE: usize = 4096;

/// Lines of a reader.
pub(super) struct Lines<'a, R> {
    file: &'a str,
    reader: R,
    /// Number of the last line read, from 1.
    number: u64,
    bytes: Vec<u8>,
}

impl<'a, R: BufRead> Lines<'a, R> {
    pub(super) fn new(file: &'a str, reader: R) -> Self {
        Self { file, reader, number: 0, bytes: Vec::new() }
    }

    /// Returns an error about the last line read.
    pub(super) fn wrong(&self, problem: impl Display) -> Error {
        Error::format(self.file, format!("line {}: {problem}", self.number))
    }

    /// Returns an [`lexisplat::Error::Limit`] on the number of `what`.
    pub(super) fn too_many(&self, what: &str, limit: usize) -> Error {
        Error::limit(format!("{}: {what}", self.file), limit as u64 + 1, limit as u64)
    }

    /// Reads the next line, without white space at its ends; `None` after the last line.
    pub(super) fn line(&mut self) -> Result<Option<String>> {
        if !self.read_piece(MAX_LINE + 1)? {
            return Ok(None);
        }
        self.number += 1;
        if self.bytes.len() > MAX_LINE && !self.bytes.ends_with(b"\n") {
            self.reader.skip_until(b'\n').map_err(|e| Error::io(self.file, e))?;
            return Err(self.wrong(format!("over the limit of {MAX_LINE} bytes")));
        }
        match std::str::from_utf8(&self.bytes) {
            Ok(text) => Ok(Some(text.trim().to_owned())),
            Err(_) => Err(self.wrong("not UTF-8")),
        }
    }

    /// Counts the words of the next line, however long it is.
    pub(super) fn words_of_next(&mut self) -> Result<u64> {
        let (mut words, mut inside, mut any) = (0_u64, false, false);
        while self.read_piece(MAX_LINE)? {
            any = true;
            for byte in &self.bytes {
                let word = !byte.is_ascii_whitespace();
                words += u64::from(word && !inside);
                inside = word;
            }
            if self.bytes.ends_with(b"\n") {
                break;
            }
        }
        self.number += u64::from(any);
        Ok(words)
    }

    /// Reads at most `most` bytes of the rest of a line, and the end of the line. Returns whether there were any bytes.
    fn read_piece(&mut self, most: usize) -> Result<bool> {
        self.bytes.clear();
        let mut piece = self.reader.by_ref().take(most as u64);
        let read = piece.read_until(b'\n', &mut self.bytes).map_err(|e| Error::io(self.file, e))?;
        Ok(read > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::BufReader;

    #[test]
    fn lines_come_apart_whatever_the_buffer() {
        let text = format!(" one \r\n\n{}\n 1 2  3\t4 \nlast", "long ".repeat(3000));
        for size in [1, 3, 7, 1 << 16] {
            let mut lines = Lines::new("a.txt", BufReader::with_capacity(size, text.as_bytes()));
            assert_eq!(lines.line().unwrap().as_deref(), Some("one"));
            assert_eq!(lines.line().unwrap().as_deref(), Some(""));
            assert_eq!(lines.words_of_next().unwrap(), 3000);
            assert_eq!(lines.words_of_next().unwrap(), 4);
            assert_eq!(lines.line().unwrap().as_deref(), Some("last"));
            assert_eq!(lines.line().unwrap(), None);
            assert_eq!(lines.words_of_next().unwrap(), 0);
            assert_eq!(lines.wrong("x").to_string(), "a.txt: line 5: x");
        }
        let mut lines = Lines::new("a.txt", text.as_bytes());
        lines.line().unwrap();
        lines.line().unwrap();
        let long = lines.line().unwrap_err().to_string();
        assert!(long.starts_with("a.txt: line 3: over the limit"), "{long}");
        assert_eq!(lines.words_of_next().unwrap(), 4);
        assert!(Lines::new("a.txt", &[b'a', 0xFF][..]).line().is_err());
    }
}
