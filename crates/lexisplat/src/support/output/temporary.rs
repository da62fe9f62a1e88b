//! A file that is being written: without a name where that is possible, else with one that is remembered.

use std::fs::File;
use std::io;
use std::path::Path;

use tempfile::TempPath;

use super::{Existing, unfinished};

/// The name of a file that is being written.
#[derive(Debug)]
pub(super) struct Temporary(
    /// `None`: it has none.
    Option<TempPath>,
);

/// Makes names of unfinished files.
fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lexisplat-").suffix(".part");
    // A temporary file is private by default; the finished one gets what the umask gives any file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder
}

impl Temporary {
    /// An empty file in `folder`.
    pub(super) fn create(folder: &Path) -> io::Result<(File, Self)> {
        #[cfg(target_os = "linux")]
        if let Ok(file) = super::unnamed::create(folder) {
            return Ok((file, Self(None)));
        }
        Self::create_named(folder)
    }

    fn create_named(folder: &Path) -> io::Result<(File, Self)> {
        unfinished::unless_stopped(|all| {
            let (file, path) = builder().tempfile_in(folder)?.into_parts();
            all.names.push(path.to_path_buf());
            Ok((file, Self(Some(path))))
        })
    }

    /// Gives `file`, which is whole, the name `target`.
    pub(super) fn name(mut self, file: File, target: &Path, existing: Existing) -> io::Result<()> {
        match self.0.take() {
            Some(path) => rename(path, target, existing),
            None => self.name_unnamed(file, target, existing),
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn name_unnamed(self, _: File, _: &Path, _: Existing) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    #[cfg(target_os = "linux")]
    fn name_unnamed(self, mut file: File, target: &Path, existing: Existing) -> io::Result<()> {
        use super::folder_of;
        use super::unnamed::link;
        let linked = unfinished::unless_stopped(|all| {
            match link(&file, target) {
                // No call puts a file without a name in the place of another, so for an instant it has two.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists && existing == Existing::Replace => {
                    let staged = builder().make_in(folder_of(target), |name| link(&file, name))?;
                    staged.into_temp_path().persist(target).map_err(|e| e.error)?;
                }
                linked => linked?,
            }
            all.finished += 1;
            Ok(())
        });
        match linked {
            Err(e) if e.kind() != io::ErrorKind::AlreadyExists && !unfinished::is_stopped() => {
                copy(&mut file, target, existing).map_err(|_| e)
            }
            linked => linked,
        }
    }
}

/// Writes what `file` holds to `target` by way of a named temporary file: for file systems that make files
/// without a name but cannot name them.
#[cfg(target_os = "linux")]
fn copy(file: &mut File, target: &Path, existing: Existing) -> io::Result<()> {
    let (mut named, temporary) = Temporary::create_named(super::folder_of(target))?;
    io::Seek::rewind(file)?;
    io::copy(file, &mut named)?;
    named.sync_all()?;
    temporary.name(named, target, existing)
}

fn rename(path: TempPath, target: &Path, existing: Existing) -> io::Result<()> {
    unfinished::unless_stopped(|all| {
        all.names.retain(|name| *name != *path);
        match existing {
            Existing::Replace => path.persist(target),
            Existing::Refuse => path.persist_noclobber(target),
        }
        .map_err(|e| e.error)?;
        all.finished += 1;
        Ok(())
    })
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(path) = self.0.take() {
            unfinished::remove(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    /// Both kinds, so that each is tested wherever the tests run.
    fn each(test: impl Fn(&Path, fn(&Path) -> io::Result<(File, Temporary)>)) {
        for create in [Temporary::create, Temporary::create_named] {
            let folder = tempfile::tempdir().unwrap();
            test(folder.path(), create);
        }
    }

    #[test]
    fn a_file_replaces_another_or_is_refused() {
        each(|folder, create| {
            let target = folder.join("a");
            for (existing, text, expected) in
                [(Existing::Refuse, "1", "1"), (Existing::Refuse, "2", "1"), (Existing::Replace, "3", "3")]
            {
                let (mut file, temporary) = create(folder).unwrap();
                file.write_all(text.as_bytes()).unwrap();
                let named = temporary.name(file, &target, existing);
                let refused = named.is_err_and(|e| e.kind() == io::ErrorKind::AlreadyExists);
                assert_eq!(refused, text == "2");
                assert_eq!(std::fs::read_to_string(&target).unwrap(), expected);
                assert_eq!(names(folder), ["a"]);
            }
        });
    }

    #[test]
    fn dropped_ones_leave_nothing() {
        each(|folder, create| {
            drop(create(folder).unwrap());
            assert!(names(folder).is_empty());
        });
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_cannot_be_named_is_copied() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(b"all of it").unwrap();
        copy(&mut file, &folder.path().join("a"), Existing::Refuse).unwrap();
        assert_eq!(std::fs::read(folder.path().join("a")).unwrap(), b"all of it");
        assert_eq!(names(folder.path()), ["a"]);
    }
}
