use super::*;
use std::io::Write;

fn put(output: Output<'_>, text: &str) -> Result<()> {
    write_whole(output, |writer| writer.write_all(text.as_bytes()).map_err(|e| Error::io(output.path(), e)))
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn kind(result: Result<()>) -> io::ErrorKind {
    match result {
        Err(Error::Io { source, .. }) => source.kind(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn one_that_came_meanwhile_is_refused_or_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    for (existing, expected) in [(Existing::Refuse, "theirs"), (Existing::Replace, "mine")] {
        let _ = std::fs::remove_file(&path);
        let output = Output::new(&path, existing);
        output.check().unwrap();
        let done = write_whole(output, |writer| {
            std::fs::write(&path, "theirs").unwrap();
            writer.write_all(b"mine").map_err(|e| Error::io(&path, e))
        });
        assert_eq!(done.is_ok(), existing == Existing::Replace);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), expected);
        assert_eq!(names(folder.path()), ["a"]);
    }
    let output = Output::new(&path, Existing::Refuse);
    assert_eq!(kind(output.check()), io::ErrorKind::AlreadyExists);
    assert_eq!(kind(put(output, "")), io::ErrorKind::AlreadyExists);
}

#[test]
fn an_error_of_the_writer_leaves_what_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    put((&path).into(), "old").unwrap();
    for existing in [Existing::Replace, Existing::Refuse] {
        let done: Result<()> = write_whole(Output::new(&path, existing), |writer| {
            writer.write_all(&[0; 3 << 20]).unwrap();
            Err(Error::io("x", io::ErrorKind::Other.into()))
        });
        assert!(done.is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()), ["a"]);
    }
}

#[test]
fn folders_and_missing_folders_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let output = Output::from(folder.path());
    assert_eq!(kind(output.check()), io::ErrorKind::IsADirectory);
    assert_eq!(kind(put(output, "")), io::ErrorKind::IsADirectory);
    let path = folder.path().join("missing").join("a");
    for result in [Output::from(&path).check(), put((&path).into(), "")] {
        let text = result.as_ref().unwrap_err().to_string();
        assert!(text.contains("missing: ") && text.starts_with(&path.display().to_string()), "{text}");
        assert_eq!(kind(result), io::ErrorKind::NotFound);
    }
}

#[test]
fn a_full_disk_is_said_with_what_the_file_takes() {
    let path = Path::new("a");
    let full = || Error::io(path, io::ErrorKind::StorageFull.into());
    let text = Output::from(path).of_bytes(77).explained(full()).to_string();
    assert!(text.ends_with("; the file takes 77 bytes"), "{text}");
    let other = Output::from("b").of_bytes(77).explained(full()).to_string();
    assert!(!other.contains("77"), "{other}");
}

#[cfg(unix)]
#[test]
fn links_stay_and_what_they_point_to_is_written() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("far")).unwrap();
    symlink("far/b", at("b")).unwrap();
    symlink("b", at("a")).unwrap();
    for text in ["first", "second"] {
        put((&at("a")).into(), text).unwrap();
        assert_eq!(std::fs::read_to_string(at("far/b")).unwrap(), text);
        assert!(at("a").is_symlink() && at("b").is_symlink());
    }
    assert_eq!(kind(put(Output::new(&at("a"), Existing::Refuse), "")), io::ErrorKind::AlreadyExists);
    symlink("round", at("round")).unwrap();
    assert!(put((&at("round")).into(), "").is_err());
    assert_eq!((names(folder.path()).len(), names(&at("far"))), (4, vec!["b".to_owned()]));
}

#[cfg(unix)]
#[test]
fn permissions_are_those_of_any_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let [plain, path] = ["plain", "a"].map(|name| folder.path().join(name));
    std::fs::write(&plain, "").unwrap();
    for _ in 0..2 {
        put((&path).into(), "").unwrap();
        let mode = |path: &Path| path.metadata().unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&plain));
    }
}

#[cfg(unix)]
#[test]
fn a_file_that_is_replaced_keeps_its_permissions() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let mode = || path.metadata().unwrap().permissions().mode() & 0o7777;
    std::fs::write(&path, "old").unwrap();
    for (set, kept) in [(0o600, 0o600), (0o640, 0o640), (0o666, 0o666), (0o444, 0o444), (0o4755, 0o755)] {
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(set)).unwrap();
        put((&path).into(), "new").unwrap();
        assert_eq!((mode(), std::fs::read_to_string(&path).unwrap().as_str()), (kept, "new"), "{set:o}");
    }
    // A temporary file that has a name, as on file systems that need one.
    let (mut file, temporary) = Temporary::create(folder.path(), &OutputGroup::default()).unwrap();
    file.write_all(b"newer").unwrap();
    keep_mode(&file, &path).unwrap();
    temporary.name(file, &path, Existing::Replace).unwrap();
    assert_eq!(mode(), 0o755);
}

#[cfg(target_os = "linux")]
#[test]
fn devices_are_written_to_as_they_are() {
    for existing in [Existing::Replace, Existing::Refuse] {
        let null = Output::new("/dev/null", existing);
        null.check().unwrap();
        put(null, "gone").unwrap();
        assert_eq!(null.spill_folder().unwrap(), std::env::temp_dir());
        assert_eq!(kind(put(Output::new("/dev/full", existing), "text")), io::ErrorKind::StorageFull);
    }
    assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
}

#[test]
fn a_stopped_group_finishes_no_output() {
    let folder = tempfile::tempdir().unwrap();
    let [path, other] = ["a", "b"].map(|name| folder.path().join(name));
    let group = OutputGroup::default();
    let output = || Output::new(&path, Existing::Replace).within(&group);
    let done = write_whole(output(), |_| {
        assert_eq!(group.stop(1), Some(0));
        Ok(())
    });
    assert!(done.is_err() && put(output(), "late").is_err());
    put((&other).into(), "of no group").unwrap();
    assert_eq!(names(folder.path()), ["b"]);
}
