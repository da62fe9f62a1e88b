//! What is at an output's path: nothing, a file, a link, something that only looks like a file.

use std::io;
use std::path::{Path, PathBuf};

use super::{Existing, Output, folder_of};
use crate::support::error::{Error, Result};

/// Links that are followed, one to the next: as many as Linux follows.
const MAX_LINKS: usize = 40;

/// Where a file goes.
#[derive(Debug)]
pub(super) enum Place {
    /// This name, which is no link.
    File(PathBuf),
    /// A pipe or device, to be written to as it is: a file renamed over `/dev/null` would replace it for
    /// everyone.
    Special,
}

/// Where `output` goes.
pub(super) fn place(output: &Output<'_>) -> Result<Place> {
    let path = output.path;
    let refuse = |kind: io::ErrorKind| Err(Error::io(path, kind.into()));
    match std::fs::metadata(path) {
        Ok(found) if found.is_dir() => refuse(io::ErrorKind::IsADirectory),
        Ok(found) if is_disk(&found) => Err(Error::parameter("output", path.display(), "a file, not a disk")),
        Ok(found) if !found.is_file() => Ok(Place::Special),
        Ok(_) if output.existing == Existing::Refuse => refuse(io::ErrorKind::AlreadyExists),
        _ => Ok(Place::File(followed(path).map_err(|e| Error::io(path, e))?)),
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

/// What `path` points to if it is a link, whether that is there or not; else `path`.
fn followed(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match std::fs::read_link(&path) {
            Ok(target) => path = folder_of(&path).join(target),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many links, one to the next"))
}

/// `error` of making a file in `folder`, saying so.
pub(super) fn in_folder(folder: &Path, error: io::Error) -> io::Error {
    let advice = match error.kind() {
        io::ErrorKind::NotFound => "make it, or name another folder",
        _ => "name another folder",
    };
    let text = format!("no file can be made in the folder {}: {error}; {advice}", folder.display());
    io::Error::new(error.kind(), text)
}
