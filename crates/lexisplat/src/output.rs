//! Files that appear whole or not at all.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use crate::error::{Error, Result};

/// Bytes of the write buffer.
const BUFFER: usize = 1 << 20;

/// The folder `path` is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Lets `write` fill a temporary file beside `path`, then renames it to `path`.
///
/// An existing file is replaced only by the rename. On any error nothing is left behind.
///
/// # Errors
/// [`Error::Io`] naming `path`, or whatever `write` returns.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let io = |source| Error::io(path, source);
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lexisplat-").suffix(".part");
    // A temporary file is private by default; the finished one gets what the umask gives any file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(folder_of(path)).map_err(io)?;
    let (file, temporary) = temporary.into_parts();
    let mut writer = BufWriter::with_capacity(BUFFER, file);
    write(&mut writer)?;
    writer.flush().map_err(io)?;
    let file = writer.into_inner().map_err(|e| io(e.into_error()))?;
    file.sync_all().map_err(io)?;
    drop(file);
    temporary.persist(path).map_err(|e| io(e.error))?;
    Ok(())
}
