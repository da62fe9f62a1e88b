//! The window, on a display of its own. Without Xvfb or an adapter these tests are skipped.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::folder::{Folder, LEAST, lexisplat};
use image::RgbImage;
use lexisplat_testing::{Need, missing};
use serde_json::Value;

/// Exit code where there is no display or adapter.
const NO_GRAPHICS: i32 = 8;
/// A window that is open for longer hangs.
const PATIENCE: Duration = Duration::from_secs(300);
/// Pictures that should be the same are at least so alike, in dB.
const SAME: f64 = 45.0;
/// Cameras that both `view` and `render` take: orbits fitted to two files would differ.
const CAMERAS: [&str; 4] = ["--cameras", "cameras.json", "--width", "240"];

/// An X server that nobody sees.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    fn open() -> Option<Self> {
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-screen", "0", "1000x700x24", "-nolisten", "tcp", "-noreset"]);
        let mut server = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().ok()?;
        let mut number = String::new();
        BufReader::new(server.stdout.take()?).read_line(&mut number).ok()?;
        Some(Self { server, name: format!(":{}", number.trim()) })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // Politely, so that it takes its lock and socket along.
        let asked = Command::new("kill").arg(self.server.id().to_string()).status();
        if !asked.is_ok_and(|status| status.success()) {
            let _ = self.server.kill();
        }
        let _ = self.server.wait();
    }
}

/// Runs `lexisplat view` on a display of its own. Returns its output; `None` where windows cannot be had.
fn view(folder: &Folder, arguments: &[&str]) -> Option<Output> {
    view_with(folder, arguments, &[], Need::Display)
}

/// The same with variables of the environment. `need` is what is missing if no window can be had with them.
fn view_with(folder: &Folder, arguments: &[&str], variables: &[(&str, &str)], need: Need) -> Option<Output> {
    // One after another: servers that start at once may choose the same number.
    static ONE: Mutex<()> = Mutex::new(());
    let _turn = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let display = Display::open();
    let output = display.as_ref().map(|display| {
        let mut command = lexisplat();
        command.current_dir(folder.0.path()).env("DISPLAY", &display.name).env_remove("WAYLAND_DISPLAY");
        command.envs(variables.iter().copied());
        command.arg("view").args(arguments).timeout(PATIENCE).output().unwrap()
    });
    match output {
        Some(output) if output.status.code() != Some(NO_GRAPHICS) => Some(output),
        found => {
            let why = found.map(|o| String::from_utf8_lossy(&o.stderr).into_owned());
            let why = why.unwrap_or_else(|| "no Xvfb".to_owned());
            missing(need, &format!("no window can be opened here: {why}"));
            None
        }
    }
}

/// The same; asserts success; standard output.
fn show(folder: &Folder, arguments: &[&str], actions: &str) -> Option<String> {
    let output = view(folder, &[arguments, &["--actions", actions]].concat())?;
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{actions}: {:?}: {error}", output.status);
    Some(String::from_utf8(output.stdout).unwrap())
}

/// Asserts the exit code; standard error.
fn refuse(folder: &Folder, arguments: &[&str], code: i32) -> Option<String> {
    let output = view(folder, arguments)?;
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {error}");
    assert!(!error.contains("panicked"), "{error}");
    Some(error)
}

fn picture(path: &Path) -> RgbImage {
    image::open(path).unwrap().into_rgb8()
}

/// PSNR of the part of two pictures for which `part` holds of the column, in dB.
fn psnr(a: &RgbImage, b: &RgbImage, part: impl Fn(u32) -> bool) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let (mut squares, mut count) = (0.0, 0.0);
    for ((x, _, p), q) in a.enumerate_pixels().zip(b.pixels()) {
        if part(x) {
            for (p, q) in p.0.iter().zip(q.0) {
                squares += (f64::from(*p) - f64::from(q)).powi(2);
                count += 1.0;
            }
        }
    }
    assert!(count > 0.0);
    10.0 * (255.0 * 255.0 * count / f64::max(squares, 1e-9)).log10()
}

#[test]
fn a_window_shows_what_render_draws() {
    let folder = Folder::new();
    let camera = |name: &str, x: f32| {
        serde_json::json!({
            "id": 0, "img_name": name, "width": 320, "height": 200, "fx": 300.0, "fy": 300.0,
            "position": [x, -0.6, -4.0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        })
    };
    let cameras = Value::from(vec![camera("left", -0.5), camera("middle", 0.0), camera("right", 0.5)]);
    std::fs::write(folder.path("cameras.json"), cameras.to_string()).unwrap();
    folder.run(&["compress", "scene.ply", "--preset", "small", "--quiet"]);
    for (file, views) in [("scene.ply", "a"), ("scene.lexi", "b")] {
        folder.run(&[&["render", file, "-o", views, "--quiet"], &CAMERAS[..]].concat());
    }
    let drawn = |views: &str, view: &str| picture(&folder.path(&format!("{views}/{view}.png")));
    assert!(
        psnr(&drawn("a", "002_right"), &drawn("b", "002_right"), |_| true) < SAME - 5.0,
        "the files must look different"
    );
    for device in ["cpu", "gpu"] {
        let actions = format!(
            "camera=1,mode=first,screenshot={device}-first.png,mode=second,screenshot={device}-second.png,\
             key=],mode=wipe,split=0.25,screenshot={device}-wipe.png,mode=side,screenshot={device}-side.png,\
             key=5,screenshot={device}-difference.png,report,quit"
        );
        let files = ["scene.ply", "scene.lexi", "--device", device];
        let Some(told) = show(&folder, &[&files[..], &CAMERAS[..]].concat(), &actions) else { return };
        let shot = |name: &str| picture(&folder.path(&format!("{device}-{name}.png")));
        let all = |_| true;
        for (name, views) in [("first", "a"), ("second", "b")] {
            let found = psnr(&shot(name), &drawn(views, "001_middle"), all);
            assert!(found >= SAME, "{device}, {name}: {found:.1} dB");
        }
        let (wipe, a, b) = (shot("wipe"), drawn("a", "002_right"), drawn("b", "002_right"));
        let line = wipe.width() / 4;
        let (left, right) = (psnr(&wipe, &a, |x| x < line), psnr(&wipe, &b, |x| x >= line));
        assert!(left >= SAME && right >= SAME, "{device}, wipe: {left:.1} and {right:.1} dB");
        let swapped = psnr(&wipe, &b, |x| x < line);
        assert!(swapped < left, "{device}, the first is on the left: {swapped:.1} dB");
        let side = shot("side");
        let half = |from| image::imageops::crop_imm(&side, from, 0, a.width(), a.height()).to_image();
        let (left, right) = (psnr(&half(0), &a, all), psnr(&half(a.width()), &b, all));
        assert!(left >= SAME && right >= SAME, "{device}, side by side: {left:.1} and {right:.1} dB");
        let mut expected = a.clone();
        for (e, q) in expected.pixels_mut().zip(b.pixels()) {
            for (e, q) in e.0.iter_mut().zip(q.0) {
                *e = e.abs_diff(q).saturating_mul(10);
            }
        }
        // Amplified, the rounding of both to 8 bits is up to 10 levels.
        let found = psnr(&shot("difference"), &expected, all);
        assert!(found >= 30.0, "{device}, difference: {found:.1} dB");
        let report: Value = serde_json::from_str(&told).unwrap();
        assert_eq!((&report["mode"], &report["camera"]), (&"difference".into(), &"right".into()));
        let score = report["psnr"].as_f64().unwrap();
        assert!((20.0..60.0).contains(&score), "{report}");
    }
}

/// Without any driver for the kernels the processor draws, and OpenGL shows its pictures.
#[test]
#[cfg(target_os = "linux")]
fn a_window_opens_without_any_gpu() {
    let folder = Folder::new();
    let draw = ["--orbit", "1", "--width", "160"];
    folder.run(&[&["render", "scene.ply", "--device", "cpu", "-o", "views", "--quiet"], &draw[..]].concat());
    let drawn = std::fs::read_dir(folder.path("views")).unwrap().next().unwrap().unwrap().path();
    let arguments = ["scene.ply", "--orbit", "1", "--width", "160"];
    let actions = ["--actions", "camera=0,screenshot=shot.png,report,quit"];
    let all = [&arguments[..], &actions].concat();
    let Some(output) = view_with(&folder, &all, &crate::gpu::NO_DRIVERS, Need::OpenGl) else { return };
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{:?}: {error}", output.status);
    let found = psnr(&picture(&folder.path("shot.png")), &picture(&drawn), |_| true);
    assert!(found >= SAME, "{found:.1} dB");
    // Without a GPU its actions are refused.
    let mut command = lexisplat();
    command.current_dir(folder.0.path()).envs(crate::gpu::NO_DRIVERS).env("DISPLAY", ":nowhere");
    let output = command.args(["view", "scene.ply", "--device", "gpu"]).output().unwrap();
    assert_eq!(output.status.code(), Some(NO_GRAPHICS));
}

/// Two files of other formats beside each other: both are shown as `render` draws them.
#[test]
fn files_of_other_formats_are_shown() {
    let folder = Folder::new();
    let draw = ["--orbit", "1", "--width", "160", "--quiet"];
    for file in ["a.spz", "a.glb"] {
        folder.run(&["convert", "scene.ply", file]);
        folder.run(&[&["render", file, "-o", &format!("{file}-views")][..], &draw].concat());
    }
    let actions = "camera=0,mode=first,screenshot=first.png,report,quit";
    let Some(told) = show(&folder, &["a.spz", "a.glb", "--width", "160"], actions) else { return };
    let report: Value = serde_json::from_str(&told).unwrap();
    assert_eq!(report["models"].as_array().unwrap().len(), 2, "{report}");
    assert!(report["psnr"].as_f64().unwrap() > 20.0, "{report}");
    let views = std::fs::read_dir(folder.path("a.spz-views")).unwrap().map(|entry| entry.unwrap().path());
    let drawn = views.into_iter().find(|path| path.extension().is_some_and(|e| e == "png")).unwrap();
    assert!(picture(&folder.path("first.png")).width() == picture(&drawn).width());
}

#[test]
fn the_window_compresses_as_the_command_does() {
    let folder = Folder::of(LEAST);
    folder.run(&["compress", "scene.ply", "--preset", "small", "-o", "small.lexi", "--quiet"]);
    folder.run(&["compress", "scene.ply", "--tol", "0.2", "-o", "tolerance.lexi", "--quiet"]);
    let actions = "compress=small,report,tolerance=0.2,report,quit";
    let Some(told) = show(&folder, &["scene.ply"], actions) else { return };
    let reports: Vec<Value> = told.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for (report, file) in reports.iter().zip(["small.lexi", "tolerance.lexi"]) {
        let bytes = folder.path(file).metadata().unwrap().len();
        assert_eq!(report["models"][1]["bytes"], bytes, "{file}");
        assert_eq!(report["mode"], "wipe", "the second model is shown");
        assert!(report["psnr"].as_f64().unwrap() > 20.0, "{report}");
    }
    assert_eq!(reports.len(), 2);
}

#[test]
fn files_are_dropped_and_screenshots_never_replaced() {
    let folder = Folder::new();
    folder.run(&["compress", "scene.ply", "--tol", "0.3", "--quiet"]);
    let actions =
        "camera=0,screenshot,screenshot,drop=scene.lexi,mode=second,degree=0,screenshot,report,quit";
    let small = ["scene.ply", "--width", "100"];
    let Some(told) = show(&folder, &small, actions) else { return };
    let report: Value = serde_json::from_str(&told).unwrap();
    assert_eq!(report["models"][1]["layout"], "f16", "one file that is dropped is the second");
    let names = folder.names();
    for name in ["scene_orbit_000.png", "scene_orbit_000-2.png", "scene_orbit_000-3.png"] {
        assert!(names.iter().any(|n| n == name), "{name} in {names:?}");
        assert_eq!(picture(&folder.path(name)).width(), 100);
    }
    let first = picture(&folder.path("scene_orbit_000.png"));
    let flat = picture(&folder.path("scene_orbit_000-3.png"));
    assert!(psnr(&first, &flat, |_| true) < SAME, "without SH it looks different");
    let one = ["scene.ply", "--actions", "screenshot=scene.lexi,quit"];
    let Some(error) = refuse(&folder, &one, 7) else { return };
    assert!(error.contains("--overwrite"), "{error}");
}

#[test]
fn what_cannot_be_shown_is_said() {
    let folder = Folder::new();
    std::fs::write(folder.path("bad.lexi"), "nonsense").unwrap();
    let error = folder.fail(&["view", "scene.ply", "--actions", "dance"], 5);
    assert!(error.contains("dance"), "{error}");
    folder.fail(&["view", "scene.ply", "--cameras", "none.json"], 3);
    if cfg!(target_os = "linux") {
        let mut command = lexisplat();
        for display in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            command.env_remove(display);
        }
        let output = command.current_dir(folder.0.path()).args(["view", "scene.ply"]).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(NO_GRAPHICS), "{error}");
        assert!(error.contains("display") && error.contains("lexisplat render"), "{error}");
    }
    let Some(error) = refuse(&folder, &["none.ply"], 3) else { return };
    assert!(error.contains("none.ply"), "{error}");
    refuse(&folder, &["bad.lexi"], 4);
    refuse(&folder, &["scene.ply", "--actions", "drop=bad.lexi,report"], 4);
    refuse(&folder, &["scene.ply", "--actions", "camera=99"], 5);
}
