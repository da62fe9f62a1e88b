//! Ctrl-C, `kill` and a closed terminal.

use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use lexisplat::ply;
use lexisplat_sample::{SampleOptions, scene};
use lexisplat_testing::{Need, missing};

use super::runs::{
    JOBS, OLD, OUTPUT, PATIENCE, PROGRAM, assert_old_or_new, code, program, ready, said, send, undisturbed,
    wait_until_watching,
};
use crate::folder::{Folder, LEAST};

/// Signals with their numbers and exit codes.
const SIGNALS: [(&str, i32, i32); 3] = [("HUP", 1, 129), ("INT", 2, 130), ("TERM", 15, 143)];
/// When signals come, as shares of an undisturbed run.
const MOMENTS: [f64; 3] = [0.1, 0.6, 0.95];
/// Gaussians of a scene that is not written in an instant.
const LONG: usize = 150_000;

#[test]
fn signals_have_their_codes_and_leave_nothing_half() {
    let folder = ready();
    let before = folder.names();
    let mut stopped = 0;
    for job in JOBS {
        let (whole, duration) = undisturbed(&folder, job);
        for ((signal, number, expected), moment) in SIGNALS.into_iter().zip(MOMENTS) {
            for old in [None, Some(OLD)] {
                let _ = std::fs::remove_file(folder.path(OUTPUT));
                let mut arguments = job.to_vec();
                if let Some(old) = old {
                    std::fs::write(folder.path(OUTPUT), old).unwrap();
                    arguments.push("--overwrite");
                }
                let clock = Instant::now();
                let child = program(&folder, &arguments).spawn().unwrap();
                wait_until_watching(&child, number);
                std::thread::sleep(duration.mul_f64(moment).saturating_sub(clock.elapsed()));
                send(&child, signal);
                let ended = child.wait_with_output().unwrap();
                let new = assert_old_or_new(&folder, &before, old, &whole);
                let text = said(ended.stderr);
                if new {
                    assert!(ended.status.success(), "{job:?}: {text}");
                } else {
                    stopped += 1;
                    assert_eq!(code(ended.status), expected, "{job:?}: {text}");
                    assert!(text.starts_with(&format!("error: stopped by SIG{signal}")), "{text}");
                }
            }
        }
        let _ = std::fs::remove_file(folder.path(OUTPUT));
    }
    assert!(stopped > 0, "every run was done before its signal");
}

/// A run that waits for standard input, so that it is stopped for sure.
fn waiting(folder: &Folder, arguments: &[&str]) -> std::process::Child {
    let child = program(folder, arguments).stdin(Stdio::piped()).spawn().unwrap();
    wait_until_watching(&child, 15);
    child
}

#[test]
fn what_is_said_fits_what_was_written() {
    let folder = Folder::new();
    for (arguments, expected) in [
        (&["compress", "-", "-o", OUTPUT][..], "error: stopped by SIGTERM; no output was written\n"),
        (&["compress", "-", "-o", OUTPUT, "--quiet"], "error: stopped by SIGTERM; no output was written\n"),
        (&["decompress", "-"], "error: stopped by SIGTERM; standard output is incomplete\n"),
        (&["info", "-"], "error: stopped by SIGTERM\n"),
    ] {
        let mut child = waiting(&folder, arguments);
        // Standard input is read after the command has said what it writes.
        let mut stdin = child.stdin.take().unwrap();
        stdin.write_all(&vec![0; 1 << 20]).unwrap();
        send(&child, "TERM");
        let ended = child.wait_with_output().unwrap();
        // Until here, or the command would find the input's end, and an error of its own.
        drop(stdin);
        assert_eq!(code(ended.status), 143);
        assert_eq!(said(ended.stderr), expected);
    }
    assert_eq!(folder.names(), ["scene.ply"]);
}

#[test]
fn a_hang_up_that_nohup_ignores_stays_ignored() {
    let folder = Folder::of(LEAST);
    let mut child = Command::new("sh")
        .args([
            "-c",
            "trap '' HUP; exec \"$0\" \"$@\"",
            PROGRAM,
            "compress",
            "-",
            "-o",
            OUTPUT,
            "--quiet",
            "--memory",
            "100kB",
        ])
        .current_dir(folder.0.path())
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until_watching(&child, 15);
    send(&child, "HUP");
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(&std::fs::read(folder.path("scene.ply")).unwrap()).unwrap();
    drop(stdin);
    assert!(child.wait().unwrap().success());
    assert_eq!(folder.names(), [OUTPUT, "scene.ply"]);
}

#[test]
fn pictures_that_were_written_are_whole() {
    let folder = Folder::new();
    let drawing = ["render", "scene.ply", "-o", "seen", "--orbit", "60", "--width", "300", "--device", "cpu"];
    let child = program(&folder, &drawing).spawn().unwrap();
    let pictures = || {
        let entries = std::fs::read_dir(folder.path("seen")).into_iter().flatten();
        entries.map(|e| e.unwrap().path()).collect::<Vec<_>>()
    };
    let clock = Instant::now();
    while pictures().len() < 2 && clock.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(1));
    }
    send(&child, "INT");
    let ended = child.wait_with_output().unwrap();
    let text = said(ended.stderr);
    let found = pictures();
    assert_eq!(code(ended.status), 130, "{text}");
    let outcome = format!("; {} outputs are complete, no other was written\n", found.len());
    assert!((2..60).contains(&found.len()) && text.ends_with(&outcome), "{text}");
    for path in found {
        assert!(image::open(&path).is_ok(), "{}", path.display());
    }
}

/// Without `/proc` a file without a name cannot be given one, as on systems that have no such files.
#[test]
fn temporary_files_that_have_a_name_are_removed() {
    let hidden = "mount -t tmpfs none /proc && exec \"$0\" \"$@\"";
    let in_namespace = || {
        let mut command = Command::new("unshare");
        command.args(["-rm", "sh", "-c", hidden]).stderr(Stdio::piped()).stdout(Stdio::null());
        command
    };
    if !in_namespace().arg("true").status().is_ok_and(|status| status.success()) {
        missing(Need::Mounts, "`unshare -rm` cannot mount here");
        return;
    }
    let folder = Folder::new();
    ply::write(&folder.path("long.ply"), &scene(&SampleOptions::new(LONG, 0))).unwrap();
    folder.run(&[
        "compress",
        "long.ply",
        "--layout",
        "f16",
        "--atoms",
        "8",
        "--sample",
        "2000",
        "--max-nonzeros",
        "1",
    ]);
    let before = folder.names();
    let mut stopped = 0;
    for _ in 0..5 {
        let child = in_namespace()
            .current_dir(folder.0.path())
            .args([PROGRAM, "decompress", "long.lexi", "-o", OUTPUT])
            .spawn()
            .unwrap();
        let clock = Instant::now();
        while folder.names() == before && clock.elapsed() < PATIENCE {}
        assert!(folder.names().iter().any(|name| name.ends_with(".part") || name == OUTPUT));
        send(&child, "TERM");
        let ended = child.wait_with_output().unwrap();
        if !ended.status.success() {
            stopped += 1;
            assert_eq!(code(ended.status), 143, "{}", String::from_utf8_lossy(&ended.stderr));
            assert_eq!(folder.names(), before);
            break;
        }
        std::fs::remove_file(folder.path(OUTPUT)).unwrap();
        assert_eq!(folder.names(), before);
    }
    assert!(stopped > 0, "every run was done before its signal");
}
