//! The target of an output's path: nothing, a file, a link, a folder or a device.

use std::io;
use std::path::{Path, PathBuf};

use super::destination::{Existing, Output, folder_of};
use crate::support::error::{Error, Result};

/// Largest number of links that are followed one after the other, as in Linux.
const MAX_LINKS: usize = 40;

/// The target of an output.
#[derive(Debug)]
pub(super) enum Resolved {
    /// A regular file of this name, which is no link.
    File(PathBuf),
    /// A pipe or device, which is written to directly. A file renamed over `/dev/null` would replace it for every
    /// process.
    Special,
}

/// Returns the target of `output`.
pub(super) fn resolved(output: &Output<'_>) -> Result<Resolved> {
    let path = output.path;
    let refuse = |kind: io::ErrorKind| Err(Error::io(path, kind.into()));
    match std::fs::metadata(path) {
        Ok(found) if found.is_dir() => refuse(io::ErrorKind::IsADirectory),
        Ok(found) if is_disk(&found) => {
            Err(Error::parameter("output", path.display(), "a file, not a block device"))
        }
        Ok(found) if !found.is_file() => Ok(Resolved::Special),
        Ok(_) if output.existing == Existing::Refuse => refuse(io::ErrorKind::AlreadyExists),
        _ => Ok(Resolved::File(followed(path).map_err(|e| Error::io(path, e))?)),
    }
}

fn is_disk(found: &std::fs::Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        found.file_type().is_block_device()
    }
    #[cfg(not(unix))]
    {
        let _ = found;
        false
    }
}

/// Returns the target of `path` if it is a link, also if the target does not exist; otherwise `path` itself.
fn followed(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match std::fs::read_link(&path) {
            Ok(target) => path = folder_of(&path).join(target),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many links in a row"))
}

/// Adds the folder and advice to `error`, which occurred when a file was made in `folder`.
pub(super) fn in_folder(folder: &Path, error: io::Error) -> io::Error {
    let advice = match error.kind() {
        io::ErrorKind::NotFound => "make it, or name another folder",
        _ => "name another folder",
    };
    let text = format!("no file can be made in the folder {}: {error}; {advice}", folder.display());
    io::Error::new(error.kind(), text)
}
