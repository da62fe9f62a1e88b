//! A file that is being written. It has no name if the system allows that, and otherwise a temporary name that its group
//! keeps.

use std::fs::File;
use std::io;
use std::path::Path;

use tempfile::TempPath;

use super::destination::Existing;
use super::group::OutputGroup;

/// A file that is being written. Dropping it removes the file.
#[derive(Debug)]
pub(super) struct Temporary {
    /// The temporary name, if the file has one.
    path: Option<TempPath>,
    group: OutputGroup,
}

/// Returns a builder with the names and the permissions of unfinished files.
fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lexisplat-").suffix(".part");
    // A temporary file is private by default. The finished file gets the permissions of any new file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder
}

impl Temporary {
    /// Makes an empty file in `folder`.
    pub(super) fn create(folder: &Path, group: &OutputGroup) -> io::Result<(File, Self)> {
        #[cfg(target_os = "linux")]
        if let Ok(file) = super::unnamed::create(folder) {
            return Ok((file, Self { path: None, group: group.clone() }));
        }
        Self::create_named(folder, group)
    }

    fn create_named(folder: &Path, group: &OutputGroup) -> io::Result<(File, Self)> {
        group.unless_stopped(|state| {
            let (file, path) = builder().tempfile_in(folder)?.into_parts();
            state.names.push(path.to_path_buf());
            Ok((file, Self { path: Some(path), group: group.clone() }))
        })
    }

    /// Gives the whole `file` the name `target`.
    pub(super) fn name(mut self, file: File, target: &Path, existing: Existing) -> io::Result<()> {
        match self.path.take() {
            Some(path) => self.rename(path, target, existing),
            None => self.name_unnamed(file, target, existing),
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn name_unnamed(self, _: File, _: &Path, _: Existing) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    #[cfg(target_os = "linux")]
    fn name_unnamed(self, mut file: File, target: &Path, existing: Existing) -> io::Result<()> {
        use super::destination::folder_of;
        use super::unnamed::link;
        let linked = self.group.unless_stopped(|state| {
            match link(&file, target) {
                // No system call replaces a file by one without a name, so the new file gets a temporary name first.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists && existing == Existing::Replace => {
                    let staged = builder().make_in(folder_of(target), |name| link(&file, name))?;
                    staged.into_temp_path().persist(target).map_err(|e| e.error)?;
                }
                linked => linked?,
            }
            state.finished += 1;
            Ok(())
        });
        match linked {
            Err(e) if e.kind() != io::ErrorKind::AlreadyExists && !self.group.is_stopped() => {
                copy(&mut file, target, existing, &self.group).map_err(|_| e)
            }
            linked => linked,
        }
    }

    fn rename(&self, path: TempPath, target: &Path, existing: Existing) -> io::Result<()> {
        self.group.unless_stopped(|state| {
            state.names.retain(|name| *name != *path);
            match existing {
                Existing::Replace => path.persist(target),
                Existing::Refuse => path.persist_noclobber(target),
            }
            .map_err(|e| e.error)?;
            state.finished += 1;
            Ok(())
        })
    }
}

/// Copies `file` to `target` through a temporary file with a name. Some file systems make files without a name
/// but cannot name them afterwards.
#[cfg(target_os = "linux")]
fn copy(file: &mut File, target: &Path, existing: Existing, group: &OutputGroup) -> io::Result<()> {
    let (mut named, temporary) = Temporary::create_named(super::destination::folder_of(target), group)?;
    io::Seek::rewind(file)?;
    io::copy(file, &mut named)?;
    named.set_permissions(file.metadata()?.permissions())?;
    named.sync_all()?;
    temporary.name(named, target, existing)
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(path) = self.path.take() {
            self.group.remove(path);
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

    /// Runs `test` with both kinds of temporary file.
    fn each(test: impl Fn(&Path, fn(&Path, &OutputGroup) -> io::Result<(File, Temporary)>)) {
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
                let (mut file, temporary) = create(folder, &OutputGroup::default()).unwrap();
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
            drop(create(folder, &OutputGroup::default()).unwrap());
            assert!(names(folder).is_empty());
        });
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_cannot_be_named_is_copied() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(b"all of it").unwrap();
        copy(&mut file, &folder.path().join("a"), Existing::Refuse, &OutputGroup::default()).unwrap();
        assert_eq!(std::fs::read(folder.path().join("a")).unwrap(), b"all of it");
        assert_eq!(names(folder.path()), ["a"]);
    }
}
