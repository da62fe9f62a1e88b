//! Files beside the opened file, for formats of several files.

use std::borrow::Cow;
use std::fmt;
use std::path::Path;

use lexisplat::{Error, Input, Limits, Result, file_inside};

/// Names of the file that makes a folder a scene ([`Kind::Sog`](crate::Kind::Sog)): of a SOG, and of a streamed SOG.
const INDICES: [&str; 2] = ["meta.json", "lod-meta.json"];
/// Largest size of a file beside a scene, in bytes. The header of a WebP has 32 bits for the number of bytes after its
/// first 8 bytes (RFC 9649, 2.4).
const MOST_BYTES: u64 = u32::MAX as u64 + 8;
/// Largest number of folders between the folder of a scene and one of its files.
const MOST_FOLDERS: usize = 8;
/// Largest number of bytes of a name, as in file systems (`NAME_MAX`).
const MOST_NAME: usize = 255;

/// Reads a file by its plain name.
type Read<'a> = dyn Fn(&str, &Limits) -> Result<Input> + Sync + 'a;

/// The files that a scene's file names.
///
/// The file of a scene may come from anybody, and so may the names in it and the files around it. Names must be plain:
/// without separators, drives and addresses, and neither `.` nor `..`. Names of a streamed SOG may have plain folders
/// before them. Only regular files are read, and only if they are inside the one folder after links are followed
/// ([`file_inside`]).
#[derive(Clone, Copy)]
pub struct Siblings<'a>(From<'a>);

#[derive(Clone, Copy)]
enum From<'a> {
    Nowhere,
    Folder(&'a Path),
    Given(&'a Read<'a>),
}

impl<'a> Siblings<'a> {
    /// No files. A scene that names other files is refused.
    pub const NONE: Siblings<'static> = Siblings(From::Nowhere);

    /// Returns the files in the folder of the file `path`.
    #[must_use]
    pub fn of(path: &'a Path) -> Self {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        Self(From::Folder(folder.unwrap_or(Path::new("."))))
    }

    /// Files that `read` returns by their plain names, within the limits. Names of a streamed SOG have `/` between
    /// folders.
    #[must_use]
    pub fn given(read: &'a Read<'a>) -> Self {
        Self(From::Given(read))
    }

    /// Reads the file `path`, which is beside `file` or in folders beside it. `path` has `/` between folders.
    pub(crate) fn read_below(&self, file: &str, path: &str, limits: &Limits) -> Result<Input> {
        path.split('/').try_for_each(|name| check_plain(file, name))?;
        if path.split('/').count() > MOST_FOLDERS + 1 {
            let problem = format!("'{}' is in more than {MOST_FOLDERS} folders", path.escape_debug());
            return Err(Error::malformed(file, problem));
        }
        match self.0 {
            From::Nowhere => {
                let problem = format!("the file '{path}' belongs to it, and its folder is not known");
                Err(Error::malformed(file, problem))
            }
            From::Folder(folder) => Input::open_within(&file_inside(folder, path, MOST_BYTES)?, limits),
            From::Given(read) => read(path, limits),
        }
    }
}

impl fmt::Debug for Siblings<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            From::Nowhere => f.write_str("Siblings::NONE"),
            From::Folder(folder) => f.debug_tuple("Siblings::of").field(&folder).finish(),
            From::Given(_) => f.write_str("Siblings::given"),
        }
    }
}

/// Returns an error if `name`, which is written in `file`, could lead out of a folder.
pub(crate) fn check_plain(file: &str, name: &str) -> Result<()> {
    let bad = |c: char| matches!(c, '/' | '\\' | ':') || c.is_control();
    if name.is_empty() || name.len() > MOST_NAME || matches!(name, "." | "..") || name.contains(bad) {
        let name: String = name.chars().take(MOST_NAME).collect();
        let problem = format!("'{}' is not the plain name of a file beside it", name.escape_debug());
        return Err(Error::malformed(file, problem));
    }
    Ok(())
}

/// Returns the file to open for `path`: the `meta.json` or `lod-meta.json` of a folder that has one, otherwise `path`
/// itself.
#[must_use]
pub fn scene_path(path: &Path) -> Cow<'_, Path> {
    let index = INDICES.map(|name| path.join(name)).into_iter().find(|index| index.is_file());
    index.filter(|_| path.is_dir()).map_or(Cow::Borrowed(path), Cow::Owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_names_are_read() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("inner")).unwrap();
        std::fs::write(folder.path().join("a.webp"), b"outer").unwrap();
        std::fs::write(folder.path().join("inner/a.webp"), b"inner").unwrap();
        std::fs::write(folder.path().join("inner/meta.json"), b"{}").unwrap();
        let file = folder.path().join("inner/meta.json");
        assert_eq!(*scene_path(&folder.path().join("inner")), *file);
        assert_eq!(*scene_path(folder.path()), *folder.path());
        let siblings = Siblings::of(&file);
        let limits = Limits::default();
        assert_eq!(*siblings.read_below("m", "a.webp", &limits).unwrap(), *b"inner");
        assert!(Siblings::NONE.read_below("m", "a.webp", &limits).is_err());
        let absolute = folder.path().join("a.webp").display().to_string();
        for name in
            ["", ".", "..", "../a.webp", "..\\a.webp", "C:a", "http://a", "a\0", "inner//a", &absolute]
        {
            let error = siblings.read_below("m", name, &limits).unwrap_err();
            assert!(error.to_string().contains("plain name"), "{error}");
        }
        assert!(
            siblings.read_below("m", "none.webp", &limits).unwrap_err().to_string().contains("none.webp")
        );
    }
}
