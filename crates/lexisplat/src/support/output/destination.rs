//! The path of an output, and the treatment of a file that exists there.

use std::path::Path;

use super::group::OutputGroup;

/// The treatment of a file that already exists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Existing {
    /// The new file replaces the old one in one step.
    #[default]
    Replace,
    /// The write fails with [`io::ErrorKind::AlreadyExists`](std::io::ErrorKind::AlreadyExists), also if the file was made during the write.
    Refuse,
}

/// The path of a file to write. A path converts into an output that replaces an existing file.
#[derive(Debug, Clone, Copy)]
pub struct Output<'a> {
    pub(super) path: &'a Path,
    pub(super) existing: Existing,
    pub(super) bytes: Option<u64>,
    pub(super) group: Option<&'a OutputGroup>,
}

impl<'a, P: AsRef<Path> + ?Sized> From<&'a P> for Output<'a> {
    fn from(path: &'a P) -> Self {
        Self::new(path, Existing::Replace)
    }
}

impl<'a> Output<'a> {
    /// Creates an output to `path`. If `path` is a link, the file that it points to is written, and the link stays.
    pub fn new(path: &'a (impl AsRef<Path> + ?Sized), existing: Existing) -> Self {
        Self { path: path.as_ref(), existing, bytes: None, group: None }
    }

    /// Makes the output a member of `group`, which can end it.
    #[must_use]
    pub fn within(self, group: &'a OutputGroup) -> Self {
        Self { group: Some(group), ..self }
    }

    /// Returns the path as the caller named it.
    #[must_use]
    pub fn path(&self) -> &'a Path {
        self.path
    }

    /// Sets the size in bytes. The error of a full disk states it.
    pub(crate) fn of_bytes(self, bytes: u64) -> Self {
        Self { bytes: Some(bytes), ..self }
    }
}

/// Returns the folder that `path` is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
