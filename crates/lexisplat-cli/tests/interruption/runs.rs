//! Runs of the program that are ended from outside.

use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use lexisplat::{ShDegree, ply};
use lexisplat_sample::{SampleOptions, scene};

use crate::folder::{FEW, Files, Folder, LEAST};

/// The output of coding or decoding the scene.
pub(crate) const OUTPUT: &str = "made";
/// The content of the output before a run.
pub(crate) const OLD: &[u8] = b"what was there before";
/// A program that does not come so far hangs.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);
/// Every way to write a small scene: exact, packed, packed as if it were larger than memory, and back. [`IN_PARTS`] writes a large
/// one.
pub(crate) const JOBS: [&[&str]; 4] = [
    &["compress", "scene.ply", "--layout", "f16", "-o", OUTPUT],
    &["compress", "scene.ply", "--cameras", "cameras.json", "-o", OUTPUT],
    &["compress", "scene.ply", "--memory", "100kB", "-o", OUTPUT],
    &["decompress", "kept.lexi", "-o", OUTPUT],
];

/// A scene that is packed in parts, which [`in_parts`] adds.
pub(crate) const IN_PARTS: [&str; 5] = ["compress", "large.ply", "--guess", "-o", OUTPUT];
/// Gaussians of that scene: more than one bucket.
const LARGE: usize = 270_000;

/// Adds a scene to `folder` that is packed in parts.
pub(crate) fn in_parts(folder: &Folder) {
    let splats = scene(&SampleOptions::new(LARGE, 3)).with_degree_cut(ShDegree::ZERO);
    ply::write(&folder.path("large.ply"), &splats).unwrap();
}

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_lexisplat");

/// Whether whoever started the tests has hang-ups ignored, as `nohup` does, which the program would keep to.
fn hang_ups_are_ignored() -> bool {
    has_signal("self", "SigIgn:", 1)
}

/// Whether a process, as `/proc` calls it, has the signal in this of its masks.
fn has_signal(process: &str, mask: &str, signal: i32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let bits = status.lines().find_map(|line| line.strip_prefix(mask)).unwrap_or("0").trim();
    u64::from_str_radix(bits, 16).unwrap() >> (signal - 1) & 1 == 1
}

/// The program in `folder`.
pub(crate) fn program(folder: &Folder, arguments: &[&str]) -> Command {
    let mut command = if hang_ups_are_ignored() {
        let mut command = Command::new("env");
        command.args(["--default-signal=HUP", PROGRAM]);
        command
    } else {
        Command::new(PROGRAM)
    };
    command.current_dir(folder.0.path()).args(arguments);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// Two small views: what shows is found in an instant.
const CAMERAS: &str = r#"[
{"id": 0, "img_name": "a", "width": 64, "height": 48, "fx": 60, "fy": 60,
 "position": [0, 0, -3], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
{"id": 1, "img_name": "b", "width": 64, "height": 48, "fx": 60, "fy": 60,
 "position": [0.5, 0, -3], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
]"#;

/// A folder with all that the jobs read: a scene of [`LEAST`] Gaussians.
pub(crate) fn ready() -> Folder {
    static FILES: Files = Files::new();
    ready_of(LEAST, &FILES)
}

/// The same with [`FEW`] Gaussians, of which every job makes more than 4096 bytes.
pub(crate) fn ready_of_few() -> Folder {
    static FILES: Files = Files::new();
    ready_of(FEW, &FILES)
}

fn ready_of(gaussians: usize, files: &Files) -> Folder {
    Folder::with(files, || {
        let folder = Folder::of(gaussians);
        std::fs::write(folder.path("cameras.json"), CAMERAS).unwrap();
        folder.run(&["compress", "scene.ply", "--guess", "-o", "kept.lexi", "--quiet"]);
        folder
    })
}

/// Returns the output of a job that nobody disturbs, and its time.
pub(crate) fn undisturbed(folder: &Folder, job: &[&str]) -> (Vec<u8>, Duration) {
    let clock = Instant::now();
    folder.run(job);
    let seconds = clock.elapsed();
    let path = folder.path(OUTPUT);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    (bytes, seconds)
}

/// Returns the standard error of a program, without the lines that it prints every ten seconds where a machine is slow.
pub(crate) fn said(error: Vec<u8>) -> String {
    let text = String::from_utf8(error).unwrap();
    let is_progress = |line: &str| line.starts_with("progress: ") && line.ends_with(" s since the start\n");
    text.split_inclusive('\n').filter(|line| !is_progress(line)).collect()
}

/// Sends a signal, named as `kill` names it.
pub(crate) fn send(child: &Child, signal: &str) {
    let sent =
        Command::new("kill").args(["-s", signal, &child.id().to_string()]).stderr(Stdio::null()).status();
    // One that has ended cannot be sent any.
    sent.unwrap();
}

/// Waits until the program watches for signals.
pub(crate) fn wait_until_watching(child: &Child, signal: i32) {
    let clock = Instant::now();
    let process = child.id().to_string();
    while !has_signal(&process, "SigCgt:", signal) {
        assert!(clock.elapsed() < PATIENCE, "signal {signal} is never watched for");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Returns the exit code by which a shell calls the end of a program.
pub(crate) fn code(status: ExitStatus) -> i32 {
    status.code().or_else(|| status.signal().map(|signal| 128 + signal)).unwrap()
}

/// Asserts that the output is as before or `whole`, and that there is nothing else than `before` and it.
/// Whether it is whole.
pub(crate) fn assert_old_or_new(
    folder: &Folder,
    before: &[String],
    old: Option<&[u8]>,
    whole: &[u8],
) -> bool {
    let found = std::fs::read(folder.path(OUTPUT)).ok();
    let is_new = found.as_deref() == Some(whole);
    assert!(is_new || found.as_deref() == old, "a half output of {:?} bytes", found.map(|f| f.len()));
    let mut names = folder.names();
    names.retain(|name| name != OUTPUT);
    assert_eq!(names, before);
    is_new
}
