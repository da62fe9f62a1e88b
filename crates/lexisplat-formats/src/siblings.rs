//! Files beside the one that is opened, for formats of several files.

use std::borrow::Cow;
use std::fmt;
use std::path::Path;

use lexisplat::{Error, Input, Limits, Result};

/// Name of the file of a folder that is a scene ([`Kind::Sog`](crate::Kind::Sog)).
const META: &str = "meta.json";
/// Most bytes of a name, as file systems have it (`NAME_MAX`).
const MOST_NAME: usize = 255;

/// Reads a file by its plain name.
type Read<'a> = dyn Fn(&str, &Limits) -> Result<Input> + Sync + 'a;

/// Where the files lie that a file names.
///
/// A file of a scene comes from outside, and so do the names in it. They may only be plain: without separators, drives and
/// addresses, and neither `.` nor `..`. Nothing outside of the one folder is read.
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

    /// The files that `read` gives by their plain names, within the limits.
    #[must_use]
    pub fn given(read: &'a Read<'a>) -> Self {
        Self(From::Given(read))
    }

    /// The file `name` beside `file`.
    pub(crate) fn read(&self, file: &str, name: &str, limits: &Limits) -> Result<Input> {
        check_plain(file, name)?;
        match self.0 {
            From::Nowhere => {
                let problem = format!("the file '{name}' belongs to it, and its folder is not known");
                Err(Error::malformed(file, problem))
            }
            From::Folder(folder) => Input::open_within(&folder.join(name), limits),
            From::Given(read) => read(name, limits),
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

/// The file to open for `path`: `meta.json` for a folder that has it, else `path` itself.
#[must_use]
pub fn scene_path(path: &Path) -> Cow<'_, Path> {
    let meta = path.join(META);
    if path.is_dir() && meta.is_file() { Cow::Owned(meta) } else { Cow::Borrowed(path) }
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
        assert_eq!(*siblings.read("m", "a.webp", &limits).unwrap(), *b"inner");
        assert!(Siblings::NONE.read("m", "a.webp", &limits).is_err());
        let absolute = folder.path().join("a.webp").display().to_string();
        for name in ["", ".", "..", "../a.webp", "a/b", "..\\a.webp", "C:a", "http://a", "a\0", &absolute] {
            let error = siblings.read("m", name, &limits).unwrap_err();
            assert!(error.to_string().contains("plain name"), "{error}");
        }
        assert!(siblings.read("m", "none.webp", &limits).unwrap_err().to_string().contains("none.webp"));
    }
}
