//! The target of the bytes of a result.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::support::error::{Error, Result};
use crate::support::output::{Output, write_whole};
use crate::support::progress::{Progress, Stage};

/// Number of bytes passed on at a time. Between two such blocks, the work can be cancelled.
const BLOCK: usize = 1 << 20;

/// The target of a result: a file that appears when it is whole, or a writer.
///
/// Paths, [`Output`]s and mutable references to writers convert into a sink:
///
/// ```
/// # use lexisplat::Sink;
/// let file = Sink::from("scene.lexi");
/// let mut bytes = Vec::new();
/// let memory = Sink::from(&mut bytes);
/// ```
#[derive(Debug)]
pub struct Sink<'a>(Target<'a>);

enum Target<'a> {
    File(Output<'a>),
    Writer(&'a mut dyn Write),
}

impl std::fmt::Debug for Target<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(output) => output.fmt(f),
            Self::Writer(_) => f.write_str("Writer"),
        }
    }
}

impl<'a> From<Output<'a>> for Sink<'a> {
    fn from(output: Output<'a>) -> Self {
        Self(Target::File(output))
    }
}

impl<'a, P: AsRef<Path> + ?Sized> From<&'a P> for Sink<'a> {
    fn from(path: &'a P) -> Self {
        Output::from(path).into()
    }
}

impl<'a, W: Write> From<&'a mut W> for Sink<'a> {
    fn from(writer: &'a mut W) -> Self {
        Self(Target::Writer(writer))
    }
}

impl Sink<'_> {
    /// Returns the folder for temporary files as large as the result: the folder of the file, or the system's temporary
    /// folder for a writer.
    pub(crate) fn spill_folder(&self) -> Result<PathBuf> {
        match &self.0 {
            Target::File(output) => output.spill_folder(),
            Target::Writer(_) => Ok(std::env::temp_dir()),
        }
    }

    /// Writes `bytes` and returns their number. Reports [`Stage::Write`]. The method is for writers of further formats.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Writer`], and [`Error::Cancelled`] if `progress` asks for it.
    pub fn write_bytes(self, bytes: &[u8], progress: &dyn Progress) -> Result<u64> {
        self.write(bytes.len() as u64, progress, |writer, refused| writer.write_all(bytes).map_err(refused))
    }

    /// Lets `fill` write all of the `bytes` bytes of a result, and returns their number. The second argument of `fill`
    /// turns an error of the writer into an [`Error`].
    ///
    /// Reports [`Stage::Write`], and ends with [`Error::Cancelled`] if `progress` asks for it.
    pub(crate) fn write(
        self,
        bytes: u64,
        progress: &dyn Progress,
        fill: impl FnOnce(&mut dyn Write, &dyn Fn(io::Error) -> Error) -> Result<()>,
    ) -> Result<u64> {
        progress.begin(Stage::Write, bytes);
        let fill = |writer: &mut dyn Write, refused: &dyn Fn(io::Error) -> Error| {
            let mut counted = Counted { writer, progress, bytes: 0 };
            let named = |e: io::Error| e.downcast().unwrap_or_else(refused);
            fill(&mut counted, &named)?;
            counted.flush().map_err(named)?;
            Ok(counted.bytes)
        };
        let written = match self.0 {
            Target::Writer(writer) => fill(writer, &|source| Error::Writer { source })?,
            Target::File(output) => {
                write_whole(output.of_bytes(bytes), |writer| fill(writer, &|e| Error::io(output.path(), e)))?
            }
        };
        progress.end();
        Ok(written)
    }
}

/// A writer that counts the bytes that pass through it, reports them as progress and can be cancelled.
struct Counted<'a> {
    writer: &'a mut dyn Write,
    progress: &'a dyn Progress,
    bytes: u64,
}

impl Write for Counted<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.progress.check().map_err(io::Error::other)?;
        let written = self.writer.write(&bytes[..bytes.len().min(BLOCK)])?;
        self.bytes += written as u64;
        self.progress.advance(written as u64);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;

    struct Cancelled;

    impl Progress for Cancelled {
        fn is_cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn files_and_writers_get_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let text = vec![7; 3 * BLOCK + 5];
        let mut memory = Vec::new();
        for sink in [Sink::from(&path), Sink::from(&mut memory)] {
            let written = sink
                .write(text.len() as u64, &Silent, |writer, named| writer.write_all(&text).map_err(named))
                .unwrap();
            assert_eq!(written, text.len() as u64);
        }
        assert!(memory == text && std::fs::read(&path).unwrap() == text);
    }

    #[test]
    fn errors_keep_their_kind_and_leave_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let error = Sink::from(&path)
            .write(1, &Cancelled, |writer, named| writer.write_all(&[1]).map_err(named))
            .unwrap_err();
        assert!(matches!(error, Error::Cancelled), "{error}");
        let error =
            Sink::from(&path).write(1, &Silent, |_, _| Err(Error::parameter("a", 1, "2"))).unwrap_err();
        assert_eq!(error.to_string(), "a = 1: 2");
        let broken = Sink::from(&mut Vec::<u8>::new())
            .write(1, &Silent, |_, named| Err(named(io::ErrorKind::BrokenPipe.into())));
        let error = broken.unwrap_err();
        assert!(matches!(&error, Error::Writer { .. }), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
