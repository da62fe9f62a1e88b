//! Files that appear whole or not at all.
//!
//! On Linux a file has no name until it is whole, where the file system can do that: then nothing is left of
//! it however the process ends. Elsewhere it is a `.lexisplat-*.part` beside its place until then, which an
//! error removes, and [`stop`] when the process is told to end.

mod place;
mod temporary;
mod unfinished;
#[cfg(target_os = "linux")]
mod unnamed;

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use self::place::{Place, in_folder, place};
use self::temporary::Temporary;
use crate::support::error::{Error, Result};

pub use self::unfinished::{is_stopped, stop};

/// Bytes of the write buffer.
const BUFFER: usize = 1 << 20;

/// What to do about a file that is already there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Existing {
    /// The new file takes its place, in one step.
    #[default]
    Replace,
    /// An error of kind [`io::ErrorKind::AlreadyExists`], also if it came while the new one was written.
    Refuse,
}

/// Where to write a file. A path alone replaces what is there.
#[derive(Debug, Clone, Copy)]
pub struct Output<'a> {
    path: &'a Path,
    existing: Existing,
    bytes: Option<u64>,
}

impl<'a, P: AsRef<Path> + ?Sized> From<&'a P> for Output<'a> {
    fn from(path: &'a P) -> Self {
        Self::new(path, Existing::Replace)
    }
}

impl<'a> Output<'a> {
    /// The file `path`. A link is followed: what it points to is written, and the link stays.
    pub fn new(path: &'a (impl AsRef<Path> + ?Sized), existing: Existing) -> Self {
        Self { path: path.as_ref(), existing, bytes: None }
    }

    /// As the caller named it.
    #[must_use]
    pub fn path(&self) -> &'a Path {
        self.path
    }

    /// The same with its size in bytes, which an error about a full disk then names.
    pub(crate) fn of_bytes(self, bytes: u64) -> Self {
        Self { bytes: Some(bytes), ..self }
    }

    /// Finds out, before any work is done, whether a file could be written here. Leaves nothing.
    ///
    /// # Errors
    /// [`Error::Io`] for a folder, for a file that is there and must not be, and for a folder around it that
    /// is missing or cannot be written to; [`Error::Parameter`] for a disk.
    pub fn check(&self) -> Result<()> {
        if let Place::File(target) = place(self)? {
            let folder = folder_of(&target);
            tempfile::tempfile_in(folder).map_err(|e| Error::io(self.path, in_folder(folder, e)))?;
        }
        Ok(())
    }

    /// Where temporary files go that are as large as this one: beside it, or where the system wants them.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub(crate) fn spill_folder(&self) -> Result<PathBuf> {
        Ok(match place(self)? {
            Place::File(target) => folder_of(&target).to_owned(),
            Place::Special => std::env::temp_dir(),
        })
    }

    /// Says how much room the file needs, if `error` is that it found none.
    fn explained(&self, error: Error) -> Error {
        let full =
            |e: &io::Error| matches!(e.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
        match (error, self.bytes) {
            (Error::Io { file, source }, Some(bytes)) if full(&source) && Path::new(&file) == self.path => {
                let text = format!("{source}; the file takes {bytes} bytes");
                Error::Io { file, source: io::Error::new(source.kind(), text) }
            }
            (error, _) => error,
        }
    }
}

/// The folder `path` is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Lets `write` fill a file that appears under its name when it is whole and on the disk.
///
/// A file that was there is replaced in one step, or refused: see [`Existing`]. On any error nothing is left
/// behind. What is neither file nor folder, such as a pipe or `/dev/null`, is written to as it is.
///
/// # Errors
/// [`Error::Io`] naming the output, or whatever `write` returns.
pub fn write_whole<'a>(
    output: impl Into<Output<'a>>,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<()>,
) -> Result<()> {
    let output = output.into();
    let io = |source| Error::io(output.path, source);
    let fill = |file| {
        let mut writer = BufWriter::with_capacity(BUFFER, file);
        write(&mut writer)?;
        writer.into_inner().map_err(|e| io(e.into_error()))
    };
    let whole = || match place(&output)? {
        Place::Special => {
            let file = OpenOptions::new().write(true).open(output.path).map_err(io)?;
            fill(file)?;
            unfinished::count().map_err(io)
        }
        Place::File(target) => {
            let folder = folder_of(&target);
            let (file, temporary) = Temporary::create(folder).map_err(|e| io(in_folder(folder, e)))?;
            let file = fill(file)?;
            file.sync_all().map_err(io)?;
            temporary.name(file, &target, output.existing).map_err(io)?;
            sync_folder(folder);
            Ok(())
        }
    };
    whole().map_err(|e| output.explained(e))
}

/// Asks for the new name to reach the disk too. Not every system and file system can; the file is whole
/// either way.
fn sync_folder(folder: &Path) {
    if cfg!(unix)
        && let Ok(folder) = File::open(folder)
    {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests;
