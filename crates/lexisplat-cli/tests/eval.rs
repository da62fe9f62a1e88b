//! `eval` and `sweep` as a user runs them.

use std::time::{Duration, Instant};

use crate::folder::{FEW, Folder, lexisplat, read};
use assert_cmd::cargo::cargo_bin;
use lexisplat::ply;
use serde_json::{Value, json};

/// How long a point of a small sweep may take on a slow machine.
const PATIENCE: Duration = Duration::from_secs(300);

/// Returns a folder with photos and their nine cameras, as a `cameras.json` and as a COLMAP model. Two of the cameras are
/// test views, by the order of their names.
fn with_photos() -> Folder {
    let folder = Folder::of(FEW);
    let mut cameras = Vec::new();
    let mut images = String::from("# made up\n");
    for i in 0..9_u8 {
        let (name, x) = (format!("view {i}"), f32::from(i) * 0.1 - 0.4);
        cameras.push(json!({
            "id": i, "img_name": name, "width": 64, "height": 48, "fx": 60.0, "fy": 60.0,
            "position": [x, -0.5, -4.0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        }));
        // World to camera: no turn, moved by minus the position.
        images += &format!("{} 1 0 0 0 {} 0.5 4 1 view_{i}.png\n\n", i + 1, -x);
    }
    std::fs::write(folder.path("cameras.json"), Value::from(cameras).to_string()).unwrap();
    let sparse = folder.path("scene/sparse/0");
    std::fs::create_dir_all(&sparse).unwrap();
    std::fs::write(sparse.join("cameras.txt"), "1 PINHOLE 128 96 120 120 64 48\n").unwrap();
    std::fs::write(sparse.join("images.txt"), images).unwrap();
    let report =
        folder.json(&["render", "scene.ply", "--cameras", "cameras.json", "-o", "drawn", "--device", "cpu"]);
    for at in ["photos", "named"] {
        std::fs::create_dir(folder.path(at)).unwrap();
    }
    for (i, view) in report["views"].as_array().unwrap().iter().enumerate() {
        let drawn = folder.path(view["file"].as_str().unwrap());
        std::fs::copy(&drawn, folder.path(&format!("photos/view {i}.png"))).unwrap();
        std::fs::copy(&drawn, folder.path(&format!("named/view_{i}.PNG"))).unwrap();
    }
    folder
}

#[test]
fn models_are_scored_against_photos_and_their_original() {
    let folder = with_photos();
    folder.run(&["compress", "scene.ply", "--tol", "0.1", "--quiet"]);
    let photos = ["--cameras", "cameras.json", "--images", "photos", "--device", "cpu"];
    let all = ["eval", "scene.ply", "scene.lexi", "--original", "scene.ply", "--csv", "scores.csv"];
    let report = folder.json(&[&all[..], &photos, &["--save-views", "seen"]].concat());
    assert_eq!((&report["views"], &report["eight_bit"]), (&json!(2), &json!(false)));
    let [original, compressed] = &report["models"].as_array().unwrap()[..] else { panic!("two models") };
    // The photos are the original's pictures, rounded: 1/255 / sqrt(12) is 58.9 dB.
    let psnr = |model: &Value, against: &str| model[against]["psnr"]["mean"].as_f64();
    assert!((58.0..60.5).contains(&psnr(original, "to_photos").unwrap()), "{report}");
    assert_eq!(original["to_original"]["identical"], true);
    assert!((35.0..58.0).contains(&psnr(compressed, "to_original").unwrap()), "{report}");
    let apart = psnr(compressed, "to_original").unwrap() - psnr(compressed, "to_photos").unwrap();
    assert!(apart.abs() < 1.0, "{report}");
    assert!(compressed["to_original"]["flip"]["mean"].as_f64().unwrap() > 0.0);
    assert_eq!(compressed["to_photos"]["views"][1]["name"], "view 8");
    let csv = std::fs::read_to_string(folder.path("scores.csv")).unwrap();
    // Two views by three metrics by two models against two.
    assert_eq!(csv.lines().count(), 1 + 2 * 3 * 2 * 2, "{csv}");
    assert!(csv.contains("scene.lexi,photos,view 0,64,48,psnr,"), "{csv}");
    assert_eq!(image::image_dimensions(folder.path("seen/scene.lexi/000_view_0.png")).unwrap(), (200, 48));

    let rounded = folder.json(&[&["eval", "scene.ply", "--8bit"][..], &photos].concat());
    assert_eq!(rounded["models"][0]["to_photos"]["identical"], true, "{rounded}");
    let every = folder.json(&[&["eval", "scene.ply", "--split", "all", "--no-flip"][..], &photos].concat());
    assert_eq!(every["views"], 9);
    assert!(every["models"][0]["to_photos"]["flip"].is_null());
    let text = folder.run(&[&["eval", "scene.lexi"][..], &photos].concat());
    assert!(
        text.contains("against photos") && text.contains("minimum") && text.contains("not rounded"),
        "{text}"
    );
}

#[test]
fn colmap_cameras_follow_the_photos_size() {
    let folder = with_photos();
    let report = folder.json(&[
        "eval",
        "scene.ply",
        "--sparse",
        "scene",
        "--images",
        "named",
        "--8bit",
        "--device",
        "cpu",
    ]);
    assert_eq!(report["views"], 2);
    let psnr = &report["models"][0]["to_photos"];
    assert!(psnr["identical"] == true || psnr["psnr"]["min"].as_f64().unwrap() > 60.0, "{report}");
}

#[test]
fn mistakes_in_evaluating_are_named() {
    let folder = with_photos();
    let error = folder.fail(&["eval", "scene.ply"], 5);
    assert!(error.contains("--images") && error.contains("--original"), "{error}");
    let given = ["eval", "scene.ply", "--cameras", "cameras.json", "--images"];
    folder.fail(&[&given[..], &["nowhere"]].concat(), 3);
    std::fs::create_dir(folder.path("empty")).unwrap();
    let error = folder.fail(&[&given[..], &["empty"]].concat(), 5);
    assert!(error.contains("empty"), "{error}");
    std::fs::write(folder.path("e.pkl"), [0x80, 4, 0x95, 0]).unwrap();
    let error = folder.fail(&["eval", "e.pkl", "--original", "scene.ply"], 4);
    assert!(error.contains("pickle") && error.contains("save_ply"), "{error}");
    folder.fail(&["eval", "scene.ply", "--original", "scene.ply", "--lpips", "scene.ply"], 4);
    std::fs::write(folder.path("scene/sparse/0/cameras.txt"), "1 OPENCV 8 8 1 1 1 1 0 0 0 0\n").unwrap();
    let error = folder.fail(&["render", "scene.ply", "--cameras", "scene/sparse/0"], 4);
    assert!(error.contains("OPENCV") && error.contains("image_undistorter"), "{error}");
}

#[test]
fn cameras_of_another_scene_are_told() {
    let folder = with_photos();
    let photos = ["--cameras", "cameras.json", "--images", "photos", "--device", "cpu", "--no-flip"];
    let report = folder.json(&[&["eval", "scene.ply"][..], &photos].concat());
    assert_eq!(report["warnings"], json!([]));
    let mut elsewhere = read(&folder.path("scene.ply"));
    elsewhere.geometry.positions.iter_mut().for_each(|p| p[0] += 1000.0);
    ply::write(&folder.path("other.ply"), &elsewhere).unwrap();
    let report = folder.json(&[&["eval", "other.ply"][..], &photos].concat());
    let warnings: Vec<&str> =
        report["warnings"].as_array().unwrap().iter().map(|w| w.as_str().unwrap()).collect();
    let [nothing, far] = warnings[..] else { panic!("{warnings:?}") };
    assert!(nothing.starts_with("2 of 2 views show almost nothing of other.ply"), "{nothing}");
    assert!(far.contains("dB against the photos") && far.contains("one scene"), "{far}");
    let quiet = [&["eval", "other.ply", "--quiet"][..], &photos].concat();
    let output = lexisplat().current_dir(folder.0.path()).args(quiet).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.starts_with("warning: views: 2 of 2 views"), "{error}");
}

const SMALL: [&str; 8] = ["--tol", "0.1,0.3", "--presets", "small", "--max-nonzeros", "1", "--device", "cpu"];

#[test]
fn a_sweep_leaves_tables_figures_and_a_page() {
    let folder = with_photos();
    let photos = ["--cameras", "cameras.json", "--images", "photos", "--method", "mcmc", "-o", "out"];
    let report = folder.json(&[&["sweep", "scene.ply", "--date", "today"][..], &SMALL, &photos].concat());
    assert_eq!((&report["parts_made"], &report["parts_reused"]), (&json!(5), &json!(0)));
    let scene = &report["results"]["scenes"][0];
    assert_eq!((&scene["method"], &scene["views"]), (&json!("mcmc"), &json!(2)));
    let points = scene["points"].as_array().unwrap();
    assert!(points.iter().all(|p| p["fps"]["dense"]["mean"].as_f64().unwrap() > 0.0), "{report}");
    for file in report["files"].as_array().unwrap() {
        assert!(folder.path(file.as_str().unwrap()).metadata().unwrap().len() > 0, "{file}");
    }
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(page.contains("today") && page.contains("data:image/png") && page.contains("lexisplat sweep"));
    let survey =
        std::fs::read_dir(folder.path("out/survey/results")).unwrap().next().unwrap().unwrap().path();
    let csv = std::fs::read_to_string(survey.join("scene.csv")).unwrap();
    assert!(csv.starts_with("Submethod,PSNR,SSIM,LPIPS,Size [Bytes],#Gaussians"), "{csv}");
    for file in ["all.csv", "tables/means.tex", "tables/scenes.tex", "figures/psnr-ratio.pdf"] {
        assert!(folder.path(&format!("out/{file}")).exists(), "{file}");
    }

    let again = folder.run(&[&["sweep", "scene.ply"][..], &SMALL, &photos].concat());
    assert!(again.contains("0 parts made, 5 kept"), "{again}");
}

#[test]
fn a_killed_sweep_is_finished_by_the_next() {
    let folder = Folder::of(FEW);
    let arguments =
        [&["sweep", "scene.ply", "--no-fps", "--orbit", "2", "--width", "64", "-o", "out"][..], &SMALL]
            .concat();
    let mut child = std::process::Command::new(cargo_bin("lexisplat"))
        .current_dir(folder.0.path())
        .args(&arguments)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let finished = || {
        let parts = std::fs::read_dir(folder.path("out/points")).into_iter().flatten();
        parts.filter(|part| part.as_ref().unwrap().path().extension().is_some_and(|e| e == "json")).count()
    };
    let clock = Instant::now();
    while finished() < 2 && clock.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(finished() >= 2, "two parts were finished");
    let report = folder.json(&arguments);
    assert!(report["parts_reused"].as_u64().unwrap() >= 2, "{report}");
    let other =
        [&["sweep", "scene.ply", "--no-fps", "--orbit", "2", "--width", "64", "-o", "whole"][..], &SMALL]
            .concat();
    let points = |report: &Value| -> Vec<Value> {
        let points = report["results"]["scenes"][0]["points"].as_array().unwrap();
        points.iter().map(|p| json!([p["file_bytes"], p["mean_nonzeros"], p["to_original"]])).collect()
    };
    assert_eq!(points(&report), points(&folder.json(&other)));
}

#[test]
fn models_given_by_path_can_be_named() {
    let folder = Folder::of(FEW);
    let rest = ["--tol", "0.2", "--no-fps", "--orbit", "2", "--width", "64", "--device", "cpu", "-o", "out"];
    std::fs::copy(folder.path("scene.ply"), folder.path("copy.ply")).unwrap();
    let named = ["sweep", "scene.ply", "copy.ply", "--name", "a\u{1b}[2Jb"];
    let output = lexisplat().current_dir(folder.0.path()).args(named).args(rest).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("a\\u001b[2Jb") && !text.contains('\u{1b}'), "{text}");
    let report = folder.json(&[&named[..], &["--name", "second"], &rest].concat());
    let names = report["results"]["scenes"].as_array().unwrap().iter().map(|scene| &scene["name"]);
    assert_eq!(names.collect::<Vec<_>>(), [&json!("a\u{1b}[2Jb"), &json!("second")]);
    folder.fail(&[&named[..], &["--name", "second", "--name", "third"], &rest].concat(), 5);
}

#[test]
fn a_manifest_skips_what_is_not_there() {
    let folder = Folder::of(FEW);
    let text = "[[scene]]\nname = \"a\"\nmethod = \"3dgs\"\nmodel = \"scene.ply\"\n\
                [[scene]]\nname = \"b\"\nmethod = \"pixelgs\"\nmodel = \"gone.ply\"\n";
    std::fs::write(folder.path("scenes.toml"), text).unwrap();
    let arguments =
        ["sweep", "--manifest", "scenes.toml", "--tol", "0.2", "--no-fps", "--orbit", "2", "--width", "64"];
    let report = folder.json(&[&arguments[..], &["--device", "cpu"]].concat());
    assert_eq!(report["results"]["skipped"][0]["name"], "b");
    let listed = std::fs::read_to_string(folder.path("lexisplat-sweep/report.html")).unwrap();
    assert!(listed.contains("gone.ply"), "{listed}");

    std::fs::create_dir(folder.path("mine")).unwrap();
    std::fs::write(folder.path("mine/precious"), "x").unwrap();
    folder.fail(&[&arguments[..], &["-o", "mine"]].concat(), 7);
    std::fs::write(folder.path("scenes.toml"), "[[scene]]\nname = 3").unwrap();
    folder.fail(&arguments, 4);
    folder.fail(&["sweep", "gone.ply", "--tol", "0.2"], 5);
    folder.fail(&["sweep", "scene.ply", "--tol=-1"], 5);
    let output = lexisplat().current_dir(folder.0.path()).arg("sweep").output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}
