//! Outputs that are in the way, or no plain files.

use std::os::unix::fs::{FileTypeExt, symlink};
use std::process::Command;

use super::runs::{JOBS, OLD, OUTPUT, program, ready};
use crate::folder::Folder;

/// Returns a folder with a PLY that cannot be read. An error before the PLY is read is one of the output.
fn unread() -> Folder {
    let folder = Folder::new();
    std::fs::write(folder.path("bad"), "nonsense").unwrap();
    std::fs::write(folder.path("old"), OLD).unwrap();
    std::fs::create_dir(folder.path("sub")).unwrap();
    folder
}

#[test]
fn bad_outputs_are_refused_before_any_work() {
    let folder = unread();
    let before = folder.names();
    for (output, overwrite, code, text) in [
        ("old", false, 7, "old exists help: give --overwrite"),
        ("sub", true, 5, "a file, not a folder"),
        ("missing/a", false, 3, "missing/a: no file can be made in the folder missing: No such file"),
        ("old/a", true, 3, "old/a: no file can be made in the folder old: Not a directory"),
        ("/proc/a", true, 3, "/proc/a: no file can be made in the folder /proc: "),
        ("bad", true, 5, "another file than the input"),
        ("sub/../bad", true, 5, "another file than the input"),
    ] {
        for command in ["compress", "decompress"] {
            let mut arguments = vec![command, "bad", "-o", output];
            if overwrite {
                arguments.push("--overwrite");
            }
            let error = folder.fail(&arguments, code).replace('\n', " ");
            assert!(error.contains(text), "{error}");
        }
    }
    assert_eq!(folder.names(), before);
    assert_eq!(std::fs::read(folder.path("old")).unwrap(), OLD);
    // An output that is not refused leaves the input to be refused.
    folder.fail(&["compress", "bad", "-o", "old", "--overwrite"], 4);
}

#[test]
fn two_outputs_are_two_files() {
    let folder = unread();
    for other in ["new", "./new", "sub/../new"] {
        let arguments = ["compress", "bad", "--tol", "0.1", "-o", "new", "--save-dictionary", other];
        let error = folder.fail(&arguments, 5);
        assert!(error.contains("other outputs"), "{error}");
    }
}

#[test]
fn a_file_where_a_folder_should_be_is_not_for_overwriting() {
    let folder = unread();
    let error = folder.fail(&["render", "scene.ply", "-o", "old", "--overwrite", "--device", "cpu"], 3);
    assert!(error.contains("old") && !error.contains("--overwrite"), "{error}");
    assert_eq!(std::fs::read(folder.path("old")).unwrap(), OLD);
}

#[test]
fn links_are_followed() {
    let folder = unread();
    let plain = ["compress", "scene.ply", "--layout", "f16", "-o"];
    folder.run(&[&plain[..], &["plain"]].concat());
    let expected = std::fs::read(folder.path("plain")).unwrap();
    symlink("sub/target", folder.path("link")).unwrap();
    // First to a file that is not there, then in place of it.
    folder.run(&[&plain[..], &["link"]].concat());
    folder.fail(&[&plain[..], &["link"]].concat(), 7);
    std::fs::write(folder.path("sub/target"), OLD).unwrap();
    folder.run(&[&plain[..], &["link", "--overwrite"]].concat());
    assert!(folder.path("link").is_symlink());
    assert!(std::fs::read(folder.path("sub/target")).unwrap() == expected);
    // A link to the input is the input.
    symlink("scene.ply", folder.path("same")).unwrap();
    folder.fail(&[&plain[..], &["same", "--overwrite"]].concat(), 5);
}

#[test]
fn another_name_of_the_input_is_replaced_alone() {
    let folder = Folder::new();
    let before = std::fs::read(folder.path("scene.ply")).unwrap();
    std::fs::hard_link(folder.path("scene.ply"), folder.path("same")).unwrap();
    folder.run(&["compress", "scene.ply", "--layout", "f16", "-o", "same", "--overwrite"]);
    assert!(std::fs::read(folder.path("scene.ply")).unwrap() == before);
    folder.run(&["info", "same"]);
}

#[test]
fn devices_and_pipes_are_written_to_as_they_are() {
    let folder = ready();
    for job in &JOBS[..3] {
        // All but the name of the output.
        let arguments = &job[..job.len() - 1];
        folder.run(&[arguments, &["/dev/null"]].concat());
        folder.run(&[arguments, &["/dev/null", "--overwrite"]].concat());
        let error = folder.fail(&[arguments, &["/dev/full"]].concat(), 3);
        assert!(error.contains("/dev/full: No space left"), "{error}");
        for device in ["/dev/null", "/dev/full"] {
            assert!(std::fs::metadata(device).unwrap().file_type().is_char_device(), "{device}");
        }
        assert!(Command::new("mkfifo").arg(folder.path("pipe")).status().unwrap().success());
        let mut child = program(&folder, &[arguments, &["pipe"]].concat()).spawn().unwrap();
        let found = std::fs::read(folder.path("pipe")).unwrap();
        assert!(child.wait().unwrap().success());
        assert!(folder.path("pipe").metadata().unwrap().file_type().is_fifo());
        std::fs::remove_file(folder.path("pipe")).unwrap();
        folder.run(&[arguments, &["plain", "--overwrite"]].concat());
        assert!(found == std::fs::read(folder.path("plain")).unwrap());
    }
    assert_eq!(folder.names(), ["cameras.json", "kept.lexi", "plain", "scene.ply"]);
}

/// A pipe gives its bytes once: nothing may look at its beginning and then open it again.
#[test]
fn scenes_may_come_from_pipes() {
    let folder = ready();
    let pipe = folder.path("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let render = &["-o", "seen", "--cameras", "cameras.json", "--device", "cpu"][..];
    for (command, scene, options) in [
        ("compress", "scene.ply", &["-o", OUTPUT, "--layout", "f16"][..]),
        ("compress", "scene.ply", &["-o", OUTPUT, "--memory", "100kB"]),
        ("decompress", "kept.lexi", &["-o", OUTPUT]),
        ("render", "scene.ply", render),
        ("render", "kept.lexi", render),
    ] {
        let arguments = |from| [&[command, from, "--overwrite"], options].concat();
        let mut child = program(&folder, &arguments("pipe")).spawn().unwrap();
        std::fs::copy(folder.path(scene), &pipe).unwrap();
        assert!(child.wait().unwrap().success(), "{command} {scene}");
        let piped = folder.files();
        folder.run(&arguments(scene));
        assert!(piped == folder.files(), "{command} {scene}");
    }
}
