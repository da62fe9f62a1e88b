//! Files that appear whole or not at all.
//!
//! On Linux a file has no name until it is whole, if the file system supports that. An unfinished file then disappears
//! however the process ends. On other systems an unfinished file is named `.lexisplat-*.part` and lies in the folder of
//! the output. An error removes it, and so does [`OutputGroup::stop`].

mod destination;
mod group;
mod resolved;
mod temporary;
#[cfg(target_os = "linux")]
mod unnamed;

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use self::destination::folder_of;
use self::resolved::{Resolved, in_folder, resolved};
use self::temporary::Temporary;
use crate::support::error::{Error, Result};

pub use self::destination::{Existing, Output};
pub use self::group::OutputGroup;

/// The bits of a file's mode for reading, writing and running, without those that change the user.
#[cfg(unix)]
const PERMISSIONS: u32 = 0o777;
/// Number of bytes of the write buffer.
const BUFFER: usize = 1 << 20;

impl Output<'_> {
    /// Checks before any work that a file can be written here. Leaves no file behind.
    ///
    /// # Errors
    /// [`Error::Io`] if the path is a folder, if a file exists that must not be replaced, or if the folder around
    /// it is missing or not writable. [`Error::Parameter`] if the path is a block device.
    pub fn check(&self) -> Result<()> {
        if let Resolved::File(target) = resolved(self)? {
            let folder = folder_of(&target);
            tempfile::tempfile_in(folder).map_err(|e| Error::io(self.path, in_folder(folder, e)))?;
        }
        Ok(())
    }

    /// Returns the folder for temporary files as large as this output: the output's own folder, or the system's
    /// temporary folder if the output is no regular file.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub(crate) fn spill_folder(&self) -> Result<PathBuf> {
        Ok(match resolved(self)? {
            Resolved::File(target) => folder_of(&target).to_owned(),
            Resolved::Special => std::env::temp_dir(),
        })
    }

    /// Adds the file's size to `error` if the disk is full.
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

/// Writes a file with `write` and returns the result of `write`. The file appears under its name only when it is whole
/// and on the disk.
///
/// An existing file is replaced in one step, or is an error; see [`Existing`]. An error leaves nothing behind. A pipe
/// or a device such as `/dev/null` is written to directly.
///
/// # Errors
/// [`Error::Io`] that names the output, or any error of `write`.
pub fn write_whole<'a, T>(
    output: impl Into<Output<'a>>,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<T>,
) -> Result<T> {
    let output = output.into();
    let group = output.group.cloned().unwrap_or_default();
    let io = |source| Error::io(output.path, source);
    let fill = |file| {
        let mut writer = BufWriter::with_capacity(BUFFER, file);
        let done = write(&mut writer)?;
        Ok((writer.into_inner().map_err(|e| io(e.into_error()))?, done))
    };
    let whole = || match resolved(&output)? {
        Resolved::Special => {
            let file = OpenOptions::new().write(true).open(output.path).map_err(io)?;
            let (_, done) = fill(file)?;
            group.count().map_err(io)?;
            Ok(done)
        }
        Resolved::File(target) => {
            let folder = folder_of(&target);
            let (file, temporary) =
                Temporary::create(folder, &group).map_err(|e| io(in_folder(folder, e)))?;
            let (file, done) = fill(file)?;
            keep_mode(&file, &target).map_err(io)?;
            file.sync_all().map_err(io)?;
            temporary.name(file, &target, output.existing).map_err(io)?;
            sync_folder(folder);
            Ok(done)
        }
    };
    whole().map_err(|e| output.explained(e))
}

/// Gives `file` the permissions of `target`, which it replaces, if `target` exists.
fn keep_mode(file: &File, target: &Path) -> io::Result<()> {
    #[cfg(unix)]
    let kept = match std::fs::metadata(target) {
        Ok(old) => {
            use std::os::unix::fs::PermissionsExt;
            let mode = old.permissions().mode() & PERMISSIONS;
            file.set_permissions(std::fs::Permissions::from_mode(mode))
        }
        Err(_) => Ok(()),
    };
    #[cfg(not(unix))]
    let kept = {
        let _ = (file, target);
        Ok(())
    };
    kept
}

/// Asks the system to store the new name on the disk too. Some file systems cannot. Errors are ignored, because the file
/// is whole in any case.
fn sync_folder(folder: &Path) {
    if cfg!(unix)
        && let Ok(folder) = File::open(folder)
    {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests;
