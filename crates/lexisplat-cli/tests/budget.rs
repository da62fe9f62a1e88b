//! Levels of detail, and drawing within a budget.

use crate::folder::{Files, Folder};
use lexisplat_sample::{SampleOptions, scene};

/// Gaussians of a scene that has two layers, and two chunks of the second.
const LAYERED: usize = 20_000;

fn layered() -> Folder {
    static FILES: Files = Files::new();
    Folder::with(&FILES, || {
        let folder = Folder::new();
        lexisplat::ply::write(&folder.path("large.ply"), &scene(&SampleOptions::new(LAYERED, 1))).unwrap();
        folder.run(&["compress", "large.ply", "--guess", "--lod", "--quiet"]);
        folder
    })
}

#[test]
fn views_are_drawn_within_a_budget() {
    let folder = layered();
    let draw = ["render", "large.lexi", "--orbit", "2", "--width", "64", "--device", "cpu", "--overwrite"];
    let pictures = |name: &str| -> Vec<Vec<u8>> {
        let files =
            folder.files().into_iter().filter(|(file, _)| file.starts_with(name) && file.ends_with(".png"));
        files.map(|(_, bytes)| bytes).collect()
    };
    folder.run(&[&draw[..], &["-o", "whole"]].concat());
    let large = folder.json(&[&draw[..], &["--budget", "1000000000", "-o", "large"]].concat());
    assert_eq!(large["views"][0]["gaussians"], folder.json(&["info", "large.lexi"])["gaussians"]);
    assert!(pictures("whole") == pictures("large") && pictures("whole").len() == 2);
    // The first look reads everything, so views read nothing.
    assert_eq!(large["views"][0]["bytes_read"], 0);

    let layers = folder.json(&["info", "large.lexi"])["lexi"]["layers"].clone();
    let first = layers[0]["gaussians"].as_u64().unwrap();
    let small = folder.json(&[&draw[..], &["--budget", "6000", "-o", "small"]].concat());
    for view in small["views"].as_array().unwrap() {
        assert_eq!(view["gaussians"].as_u64(), Some(first));
        assert!(view["bytes_held"].as_u64() < large["views"][0]["bytes_held"].as_u64());
    }
    assert!(pictures("small") != pictures("whole"));
    let bytes = ["--budget", "1000000", "--budget-bytes", "40kB", "-o", "bytes"];
    let few = folder.json(&[&draw[..], &bytes].concat());
    assert!(few["views"][0]["bytes_held"].as_u64().unwrap() < 60_000);
}

#[test]
fn budgets_that_cannot_be_kept_are_refused() {
    let folder = layered();
    let render = |file: &'static str, more: &[&'static str], code: i32| {
        folder.fail(&[&["render", file, "--orbit", "1", "--device", "cpu"][..], more].concat(), code)
    };
    assert!(render("large.lexi", &["--budget", "10"], 5).contains("budget"));
    render("large.lexi", &["--budget", "0"], 2);
    render("large.lexi", &["--budget-bytes", "1MB"], 2);
    render("large.lexi", &["--budget", "10", "--first", "50%"], 2);
    assert!(render("large.ply", &["--budget", "9000"], 4).contains("large.ply"));
    let bytes = std::fs::read(folder.path("large.lexi")).unwrap();
    std::fs::write(folder.path("cut.lexi"), &bytes[..bytes.len() / 2]).unwrap();
    assert!(render("cut.lexi", &["--budget", "1000000"], 4).contains("truncated"));
    folder.run(&["compress", "scene.ply", "--layout", "f16", "-o", "exact.lexi"]);
    assert!(render("exact.lexi", &["--budget", "9000"], 4).contains("packed"));
    folder.fail(&["compress", "scene.ply", "--layout", "f16", "--lod"], 5);
}
