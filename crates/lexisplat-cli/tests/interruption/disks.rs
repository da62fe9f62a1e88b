//! Disks without room.

use std::process::{Command, Output, Stdio};

use lexisplat_testing::{Need, missing};

use super::runs::{IN_PARTS, JOBS, OLD, OUTPUT, PROGRAM, in_parts, ready, ready_of_few, said};
use crate::folder::Folder;

/// Mounts a disk of `$SIZE` on `disk`, puts an output there, runs the command, and shows what is left.
const ON_A_DISK: &str = r#"
mount -t tmpfs -o "$OPTIONS" none disk || exit 99
[ "$OLD" = no ] || printf '%s' "$OLD" > disk/made
"$@" > printed
code=$?
ls -A disk
cat disk/* 2>/dev/null
exit $code
"#;

/// Runs the program in `folder` with a small disk mounted on `disk`, and `$TMPDIR` there; what it printed to
/// standard error, and what is left on the disk. `None` where nothing can be mounted.
pub(crate) fn on_a_disk(
    folder: &Folder,
    options: &str,
    old: Option<&[u8]>,
    arguments: &[&str],
) -> Option<(Output, String, String)> {
    std::fs::create_dir_all(folder.path("disk")).unwrap();
    let unshare = |script: &[&str]| {
        let mut command = Command::new("unshare");
        command.current_dir(folder.0.path()).arg("-rm").args(script);
        command
    };
    let mut can = unshare(&["mount", "-t", "tmpfs", "none", "disk"]);
    if !can.output().is_ok_and(|ended| ended.status.success()) {
        missing(Need::Mounts, "`unshare -rm` cannot mount here");
        return None;
    }
    let old = String::from_utf8(old.unwrap_or(b"no").to_vec()).unwrap();
    let mut command = unshare(&[&["sh", "-c", ON_A_DISK, "sh", PROGRAM], arguments].concat());
    let ended = command.env("OPTIONS", options).env("OLD", old).env("TMPDIR", "disk").output().unwrap();
    let (error, left) = (said(ended.stderr.clone()), String::from_utf8_lossy(&ended.stdout).into_owned());
    Some((ended, error, left))
}

/// `job` with its output on the disk.
fn onto_disk<'a>(job: &[&'a str]) -> Vec<&'a str> {
    job.iter().map(|word| if *word == OUTPUT { "disk/made" } else { word }).collect()
}

#[test]
fn a_full_disk_is_said_and_nothing_is_left_on_it() {
    let folder = ready_of_few();
    for job in JOBS {
        // Room for a page of 4 kB beside what is there, and no output is that small.
        for (old, size) in [(None, "size=4k"), (Some(OLD), "size=8k")] {
            let mut arguments = onto_disk(job);
            arguments.push("--overwrite");
            let Some((ended, error, left)) = on_a_disk(&folder, size, old, &arguments) else { return };
            assert_eq!(ended.status.code(), Some(3), "{job:?}: {error}");
            assert!(error.starts_with("error: disk/") && error.contains("No space left"), "{error}");
            assert!(error.contains("help: free space"), "{error}");
            let expected = if old.is_some() { "made\nwhat was there before" } else { "" };
            assert_eq!(left, expected, "{job:?}");
        }
    }
    // The same with room enough.
    let (ended, error, left) = on_a_disk(&folder, "size=8m", None, &onto_disk(JOBS[0])).unwrap();
    assert!(ended.status.success() && left.starts_with("made\n"), "{error}");
}

#[test]
fn temporary_files_without_room_are_named_with_their_folder() {
    let folder = ready();
    in_parts(&folder);
    for job in [&["compress", "scene.ply", "--layout", "f16", "-o", "-"][..], &IN_PARTS] {
        let mut arguments = onto_disk(job);
        arguments.push("--overwrite");
        let Some((ended, error, left)) = on_a_disk(&folder, "size=8k", None, &arguments) else { return };
        assert_eq!((ended.status.code(), left.as_str()), (Some(3), ""), "{error}");
        assert!(error.contains("disk/(temporary file): ") && error.contains("$TMPDIR"), "{error}");
    }
}

#[test]
fn how_much_a_file_takes_is_said() {
    let folder = ready_of_few();
    folder.run(&["decompress", "kept.lexi", "-o", "back.ply"]);
    let bytes = folder.path("back.ply").metadata().unwrap().len();
    let arguments = ["decompress", "kept.lexi", "-o", "disk/made"];
    let Some((_, error, _)) = on_a_disk(&folder, "size=64k", None, &arguments) else { return };
    assert!(error.contains(&format!("the file takes {bytes} bytes")), "{error}");
}

#[test]
fn a_read_only_folder_is_refused_before_the_input_is_read() {
    let folder = Folder::new();
    std::fs::write(folder.path("bad.ply"), "nonsense").unwrap();
    let Some((ended, error, _)) = on_a_disk(&folder, "ro", None, &["compress", "bad.ply", "-o", "disk/made"])
    else {
        return;
    };
    assert_eq!(ended.status.code(), Some(3), "{error}");
    assert!(error.contains("disk/made: no file can be made in the folder disk: Read-only"), "{error}");
}

#[test]
fn standard_output_that_is_full_is_an_error() {
    let folder = ready();
    let full = || Stdio::from(std::fs::File::options().write(true).open("/dev/full").unwrap());
    for arguments in [
        &["compress", "scene.ply", "--cameras", "cameras.json", "-o", "-"][..],
        &["compress", "scene.ply", "--layout", "f16", "-o", "-"],
        &["compress", "scene.ply", "--memory", "100kB", "-o", "-"],
        &["decompress", "kept.lexi", "-o", "-"],
        &["info", "kept.lexi"],
        &["info", "kept.lexi", "--json"],
        &["completions", "bash"],
    ] {
        let mut command = Command::new(PROGRAM);
        let ended = command.current_dir(folder.0.path()).args(arguments).stdout(full()).output().unwrap();
        let error = said(ended.stderr);
        assert_eq!(ended.status.code(), Some(3), "{arguments:?}: {error}");
        assert!(
            error.starts_with("error: standard output: No space left") && error.contains("help: "),
            "{error}"
        );
    }
    assert_eq!(folder.names(), ["cameras.json", "kept.lexi", "scene.ply"]);
}

#[test]
fn standard_error_that_is_full_is_no_error() {
    let folder = ready();
    let full = || Stdio::from(std::fs::File::options().write(true).open("/dev/full").unwrap());
    let run = |arguments: &[&str]| {
        let mut command = Command::new(PROGRAM);
        command.current_dir(folder.0.path()).args(arguments).stderr(full()).output().unwrap().status.code()
    };
    assert_eq!(run(&["compress", "scene.ply", "--memory", "100kB", "-o", "-"]), Some(0));
    assert_eq!(run(&["compress", "gone.ply"]), Some(3));
}

#[test]
fn a_file_over_the_limit_of_its_size_is_an_error() {
    let folder = ready_of_few();
    for job in JOBS {
        let ended = Command::new("sh")
            .current_dir(folder.0.path())
            .args(["-c", "ulimit -f 8; exec \"$0\" \"$@\"", PROGRAM])
            .args(job)
            .output()
            .unwrap();
        let error = said(ended.stderr);
        assert_eq!(ended.status.code(), Some(3), "{job:?}: {error}");
        assert!(error.contains("File too large") && error.contains("ulimit -f"), "{error}");
        assert_eq!(folder.names(), ["cameras.json", "kept.lexi", "scene.ply"]);
    }
}
