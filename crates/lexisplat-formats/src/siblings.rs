//! Files beside the one that is opened, for formats of several files.

use std::borrow::Cow;
use std::fmt;
use std::path::Path;

use lexisplat::{Error, Input, Limits, Result, file_inside};

/// Names of the file of a folder that is a scene ([`Kind::Sog`](crate::Kind::Sog)): of one SOG, and of a streamed one.
const INDICES: [&str; 2] = ["meta.json", "lod-meta.json"];
/// Most bytes of a file beside a scene: a WebP counts its own in 32 bits, after 8 of them (RFC 9649, 2.4).
const MOST_BYTES: u64 = u32::MAX as u64 + 8;
/// Most folders between the folder of a scene and a file of it.
const MOST_FOLDERS: usize = 8;
/// Most bytes of a name, as file systems have it (`NAME_MAX`).
const MOST_NAME: usize = 255;

/// Reads a file by its plain name.
type Read<'a> = dyn Fn(&str, &Limits) -> Result<Input> + Sync + 'a;

/// Where the files lie that a file names.
///
/// A file of a scene comes from outside, and so do the names in it and the files there. Names may only be plain: without
/// separators, drives and addresses, and neither `.` nor `..`; those of a streamed SOG may have folders that are. Only regular
/// files are read that are inside of the one folder when links are followed ([`file_inside`]).
#[derive(Clone, Copy)]
pub struct Siblings<'a>(From<'a>);

#[derive(Clone, Copy)]
enum From<'a> {
    Nowhere,
    Folder(&'a Path),
    Given(&'a Read<'a>),
}

impl<'a> Siblings<'a> {
    /// No other files: a scene that names some is refused.
    pub const NONE: Siblings<'static> = Siblings(From::Nowhere);

    /// The files in the folder of the file `path`.
    #[must_use]
    pub fn of(path: &'a Path) -> Self {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        Self(From::Folder(folder.unwrap_or(Path::new("."))))
    }

    /// The files that `read` gives by their plain names, within the limits. Those of a streamed SOG have `/` between folders.
    #[must_use]
    pub fn given(read: &'a Read<'a>) -> Self {
        Self(From::Given(read))
    }

    /// The file `path` beside `file`, or in folders beside it, with `/` between them.
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

/// Refuses `name`, which `file` says, if it leads out of a folder.
pub(crate) fn check_plain(file: &str, name: &str) -> Result<()> {
    let bad = |c: char| matches!(c, '/' | '\\' | ':') || c.is_control();
    if name.is_empty() || name.len() > MOST_NAME || matches!(name, "." | "..") || name.contains(bad) {
        let name: String = name.chars().take(MOST_NAME).collect();
        let problem = format!("'{}' is not the plain name of a file beside it", name.escape_debug());
        return Err(Error::malformed(file, problem));
    }
    Ok(())
}

/// The file to open for `path`: `meta.json` or `lod-meta.json` for a folder that has it, else `path` itself.
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
