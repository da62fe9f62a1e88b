//! `convert`, and the other commands with files of other programs' formats.

use lexisplat::{FLAT_SCALE, ply};
use serde_json::Value;

use crate::folder::{Folder, GAUSSIANS, read};

/// Outputs of `convert`, and the format that `info` names.
const OUTPUTS: [(&str, &str); 6] = [
    ("a.spz", "spz"),
    ("a.sog", "sog"),
    ("a.compressed.ply", "compressed.ply"),
    ("a.splat", "splat"),
    ("a.glb", "glb"),
    ("a.lexi", "lexi"),
];
/// The same pictures, in dB; SPZ's SH of 4 bits are far from it.
const ALIKE: f64 = 50.0;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn every_format_is_written_and_every_command_reads_it() {
    let folder = Folder::new();
    for (output, format) in OUTPUTS {
        let report = folder.json(&["convert", "scene.ply", output]);
        assert_eq!(report["format"], format);
        assert_eq!(number(&report["gaussians"]), GAUSSIANS as f64);
        assert_eq!(report["bytes"], std::fs::read(folder.path(output)).unwrap().len());
        let info = folder.json(&["info", output]);
        assert_eq!(number(&info["gaussians"]), GAUSSIANS as f64, "{output}");
        // Nothing but the content tells what it is.
        std::fs::copy(folder.path(output), folder.path("unnamed")).unwrap();
        folder.run(&["convert", "unnamed", "back.ply", "--overwrite"]);
        assert_eq!(read(&folder.path("back.ply")).len(), GAUSSIANS);
        if format == "lexi" {
            continue;
        }
        let draw = ["--orbit", "1", "--width", "48", "--device", "cpu", "--quiet"];
        folder.run(&[&["compare", "scene.ply", output][..], &draw].concat());
        folder.run(&[&["render", output, "-o", &format!("{format}-views")][..], &draw].concat());
        let packed = format!("{format}.lexi");
        folder.run(&["compress", output, "--guess", "--quiet", "-o", &packed]);
        assert_eq!(number(&folder.json(&["info", &packed])["gaussians"]), GAUSSIANS as f64);
    }
}

/// 2D Gaussians have a third size of zero, and go wherever others go.
#[test]
fn flat_scenes_go_everywhere() {
    let folder = Folder::new();
    let mut splats = read(&folder.path("scene.ply"));
    splats.geometry.scales.iter_mut().for_each(|scales| scales[2] = f32::NEG_INFINITY);
    ply::write(&folder.path("flat.ply"), &splats).unwrap();
    let view = ["--orbit", "1", "--width", "96", "--device", "cpu"];
    for (output, least) in [
        ("a.ply", 100.0),
        ("a.glb", 60.0),
        ("a.splat", 20.0),
        ("a.sog", 30.0),
        ("a.compressed.ply", 30.0),
        ("a.spz", 30.0),
    ] {
        folder.run(&["convert", "flat.ply", output]);
        let report = folder.json(&[&["compare", "flat.ply", output][..], &view].concat());
        let psnr = &report["psnr"]["mean"];
        assert!(psnr.is_null() || number(psnr) > least, "{output}: {psnr}");
    }
    folder.run(&["compress", "flat.ply", "--layout", "f32", "-o", "exact.lexi"]);
    folder.run(&["decompress", "exact.lexi", "-o", "exact.ply"]);
    assert!(read(&folder.path("exact.ply")).geometry.scales.iter().all(|scales| scales[2] == FLAT_SCALE));
    folder.run(&["compress", "flat.ply", "--guess", "-o", "packed.lexi"]);
    let report = folder.json(&[&["compare", "flat.ply", "packed.lexi"][..], &view].concat());
    assert!(number(&report["psnr"]["mean"]) > 25.0, "{report}");
}

#[test]
fn what_is_lost_is_printed() {
    let folder = Folder::new();
    let text = folder.run(&["convert", "scene.ply", "a.splat"]);
    for part in ["wrote a.splat: .splat, 1,500 Gaussians", "lost  ", "SH", "8 bits"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let report = folder.json(&["convert", "scene.ply", "b.splat", "--psnr"]);
    assert_eq!(report["lost"]["sh_degree"], serde_json::json!([3, 0]));
    let [splat, glb] =
        [&report["psnr"]["mean"], &folder.json(&["convert", "scene.ply", "a.glb", "--psnr"])["psnr"]["mean"]]
            .map(number);
    assert!(glb > ALIKE && splat < glb, "{splat} {glb}");
    assert_eq!(
        folder.json(&["convert", "scene.ply", "copy.ply"])["lost"]["precision"],
        serde_json::json!([])
    );
    assert_eq!(read(&folder.path("copy.ply")), read(&folder.path("scene.ply")));
}

#[test]
fn scenes_are_cut_moved_and_merged() {
    let folder = Folder::new();
    let original = read(&folder.path("scene.ply"));
    folder.run(&["convert", "scene.ply", "moved.ply", "--translate=100,0,-5", "--degree", "1"]);
    let moved = read(&folder.path("moved.ply"));
    assert_eq!(moved.degree.get(), 1);
    let [x, y, z] = original.geometry.positions[7];
    assert_eq!(moved.geometry.positions[7], [x + 100.0, y, z - 5.0]);
    let report = folder.json(&["convert", "scene.ply", "moved.ply", "two.ply"]);
    assert_eq!(number(&report["gaussians"]), 2.0 * GAUSSIANS as f64);
    // The degree is the highest; the others have zeros above theirs.
    let two = read(&folder.path("two.ply"));
    assert_eq!((two.degree, two.len()), (original.degree, 2 * GAUSSIANS));
    folder.run(&["convert", "two.ply", "first.ply", "--crop-box=-50,-50,-50,50,50,50"]);
    assert_eq!(read(&folder.path("first.ply")), original);
    folder.run(&["convert", "two.ply", "second.ply", "--crop-sphere=100,0,-5,50"]);
    assert_eq!(read(&folder.path("second.ply")).len(), GAUSSIANS);
    folder.run(&["convert", "scene.ply", "turned.ply", "--rotate", "0,0,180", "--scale", "2"]);
    let turned = read(&folder.path("turned.ply")).geometry.positions[7];
    assert!((turned[0] + 2.0 * x).abs() < 1e-5 && (turned[2] - 2.0 * z).abs() < 1e-5, "{turned:?}");
}

#[test]
fn wrong_outputs_and_damaged_files_are_refused() {
    let folder = Folder::new();
    let before = folder.names();
    for (output, part) in [("a.ksplat", ".ksplat is not written"), ("a.gltf", ".glb"), ("a.jpg", "no format")]
    {
        let error = folder.fail(&["convert", "scene.ply", output], 5);
        assert!(error.contains(part), "{error}");
    }
    let error = folder.fail(&["convert", "scene.ply", "scene.ply", "--overwrite"], 5);
    assert!(error.contains("scene.ply"), "{error}");
    assert_eq!(folder.names(), before);
    folder.run(&["convert", "scene.ply", "any", "--to", "spz"]);
    let bytes = std::fs::read(folder.path("any")).unwrap();
    std::fs::write(folder.path("cut.spz"), &bytes[..bytes.len() / 2]).unwrap();
    let error = folder.fail(&["convert", "cut.spz", "cut.ply"], 4);
    assert!(error.contains("cut.spz"), "{error}");
    folder.fail(&["convert", "any", "few.ply", "--limit", "gaussians=10"], 6);
    assert!(!folder.path("cut.ply").exists() && !folder.path("few.ply").exists());
}
