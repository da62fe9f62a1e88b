//! Files without a name until they are whole (`O_TMPFILE` of open(2)).

use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, CWD, Mode, OFlags, linkat, openat};

/// Permissions before the umask, as of any new file.
const MODE: Mode = Mode::from_raw_mode(0o666);

/// Returns the path of an open file in `/proc`, from which a link can be made.
fn of_process(file: &File) -> PathBuf {
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

/// Makes a file in `folder` without a name.
///
/// # Errors
/// If the file system does not support it, if there is no `/proc`, or if no file can be made in `folder`.
pub(super) fn create(folder: &Path) -> io::Result<File> {
    let file = File::from(openat(CWD, folder, OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC, MODE)?);
    std::fs::symlink_metadata(of_process(&file))?;
    Ok(file)
}

/// Gives `file` the name `target`. Fails if `target` exists.
pub(super) fn link(file: &File, target: &Path) -> io::Result<()> {
    Ok(linkat(CWD, of_process(file), CWD, target, AtFlags::SYMLINK_FOLLOW)?)
}
