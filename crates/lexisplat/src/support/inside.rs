//! Files whose names are read from another file.
//!
//! A scene of several files, a data set or a list may come from a stranger, and so may the names and the links in it. A
//! named file is read only if it is a regular file inside of the folder that the user named. A link could otherwise lead
//! to a private file, to a pipe, for which a reader waits without end, or to a device, which gives bytes without end.

use std::path::{Path, PathBuf};

use crate::support::error::{Error, Result};

/// Returns the path of `name` in the folder `folder`, with links resolved. It may be a file or a folder.
///
/// # Errors
/// [`Error::Io`] if there is no such path, [`Error::Format`] if it is not inside of `folder`. Both name the path.
pub fn inside(folder: &Path, name: impl AsRef<Path>) -> Result<PathBuf> {
    let path = folder.join(name);
    let found = path.canonicalize().map_err(|e| Error::io(&path, e))?;
    let within = folder.canonicalize().map_err(|e| Error::io(folder, e))?;
    if found.starts_with(&within) {
        return Ok(found);
    }
    let problem = format!(
        "it leads out of the folder '{}', and what a file names is read only inside of it: to '{}'",
        folder.display(),
        found.display()
    );
    Err(Error::malformed(path.display().to_string(), problem))
}

/// Returns the path as [`inside`] does, for a regular file of at most `most` bytes.
///
/// # Errors
/// As [`inside`], [`Error::Format`] if the path is not a regular file, and [`Error::Limit`] if the file is longer.
pub fn file_inside(folder: &Path, name: impl AsRef<Path>, most: u64) -> Result<PathBuf> {
    let path = folder.join(name.as_ref());
    let found = inside(folder, name)?;
    let about = found.metadata().map_err(|e| Error::io(&path, e))?;
    if !about.is_file() {
        let problem =
            "it is a folder, a pipe or a device, and what a file names is read only if it is a regular file";
        return Err(Error::malformed(path.display().to_string(), problem));
    }
    match about.len() {
        len if len > most => Err(Error::limit(format!("bytes of {}", path.display()), len, most, None)),
        _ => Ok(found),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn only_regular_files_inside_of_the_folder_are_found() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        std::fs::create_dir_all(at("scene/part")).unwrap();
        std::fs::write(at("private"), [0; 9]).unwrap();
        std::fs::write(at("scene/part/a"), [0; 9]).unwrap();
        symlink(at("private"), at("scene/out")).unwrap();
        symlink("part/a", at("scene/in")).unwrap();
        symlink("/dev/zero", at("scene/zero")).unwrap();
        symlink(root.path(), at("scene/up")).unwrap();
        symlink(at("scene"), at("linked")).unwrap();
        // The folder itself may be a link, for the user named it.
        for folder in [at("scene"), at("linked")] {
            let found = |name: &str, most| file_inside(&folder, name, most);
            let expected = at("scene/part/a").canonicalize().unwrap();
            assert_eq!(found("part/a", 9).unwrap(), expected);
            assert_eq!(found("in", 9).unwrap(), expected);
            assert_eq!(found("part/../in", 9).unwrap(), expected);
            assert!(matches!(found("in", 8), Err(Error::Limit { found: 9, limit: 8, .. })));
            let absolute = at("private").display().to_string();
            for name in ["out", "zero", "up/private", "../private", "/dev/zero", &absolute] {
                let said = found(name, u64::MAX).unwrap_err().to_string();
                assert!(said.contains("leads out of the folder"), "{name}: {said}");
            }
            assert!(found("part", 9).unwrap_err().to_string().contains("regular file"));
            assert!(matches!(found("none", 9), Err(Error::Io { .. })));
        }
        // A device inside of the folder is not a regular file either.
        let said = file_inside(Path::new("/dev"), "zero", u64::MAX).unwrap_err().to_string();
        assert!(said.contains("regular file"), "{said}");
    }
}
