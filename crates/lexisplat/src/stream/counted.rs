//! A writer that tells how far it is.

use std::io::{self, Write};

use crate::support::progress::Progress;

/// Passes everything on and tells `progress` of the bytes.
pub(super) struct Counted<'a, W> {
    pub(super) writer: W,
    pub(super) progress: &'a dyn Progress,
}

impl<W: Write> Write for Counted<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.writer.write(bytes)?;
        self.progress.advance(written as u64);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}
