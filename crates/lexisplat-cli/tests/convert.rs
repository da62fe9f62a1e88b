//! `convert`, and the other commands with files of other programs' formats.

use lexisplat::{FLAT_SCALE, Offset, ply};
use serde_json::Value;

use crate::folder::{FEW, Folder, GAUSSIANS, read};

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
    let folder = Folder::of(FEW);
    for (output, format) in OUTPUTS {
        let report = folder.json(&["convert", "scene.ply", output]);
        assert_eq!(report["format"], format);
        assert_eq!(number(&report["gaussians"]), FEW as f64);
        assert_eq!(report["bytes"], std::fs::read(folder.path(output)).unwrap().len());
        let info = folder.json(&["info", output]);
        assert_eq!(number(&info["gaussians"]), FEW as f64, "{output}");
        // Nothing but the content tells what it is.
        std::fs::copy(folder.path(output), folder.path("unnamed")).unwrap();
        folder.run(&["convert", "unnamed", "back.ply", "--overwrite"]);
        assert_eq!(read(&folder.path("back.ply")).len(), FEW);
        if format == "lexi" {
            continue;
        }
        let draw = ["--orbit", "1", "--width", "48", "--device", "cpu", "--quiet"];
        folder.run(&[&["compare", "scene.ply", output][..], &draw].concat());
        folder.run(&[&["render", output, "-o", &format!("{format}-views")][..], &draw].concat());
        let packed = format!("{format}.lexi");
        folder.run(&["compress", output, "--guess", "--quiet", "-o", &packed]);
        assert_eq!(number(&folder.json(&["info", &packed])["gaussians"]), FEW as f64);
    }
}

/// 2D Gaussians have a third size of zero, and go wherever others go.
#[test]
fn flat_scenes_go_everywhere() {
    let folder = Folder::of(FEW);
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

/// Largest rounding of the test scene in single precision, relative to an offset; without one it is 0.25.
const EXACT: f64 = 8e-6;
/// The same with what packing rounds by.
const PACKED: f64 = 0.2;
/// Where the scene of the next tests is: coordinates of a survey.
const FAR: [f64; 3] = [500_000.123, 4_649_776.456, 100.789];

/// Bytes of a PLY of `splats` at [`FAR`] whose positions are doubles, and the positions.
fn surveyed(splats: &lexisplat::Splats) -> (Vec<u8>, Vec<[f64; 3]>) {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, splats).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let mut header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    for axis in ["x", "y", "z"] {
        header = header.replace(&format!("property float {axis}\n"), &format!("property double {axis}\n"));
    }
    let width = (bytes.len() - end) / splats.len();
    let (mut out, mut places) = (header.into_bytes(), Vec::new());
    for (row, position) in bytes[end..].chunks_exact(width).zip(&splats.geometry.positions) {
        let place = [0, 1, 2].map(|k| f64::from(position[k]) + FAR[k]);
        place.iter().for_each(|v| out.extend(v.to_le_bytes()));
        out.extend(&row[3 * size_of::<f32>()..]);
        places.push(place);
    }
    (out, places)
}

fn worst(path: &std::path::Path, places: &[[f64; 3]]) -> f64 {
    let splats = read(path);
    let offset = Offset::numbers(splats.meta.offset);
    let far = |(p, place): (&[f32; 3], &[f64; 3])| {
        (0..3).map(|k| (f64::from(p[k]) + offset[k] - place[k]).abs()).fold(0.0, f64::max)
    };
    assert_eq!(splats.len(), places.len());
    splats.geometry.positions.iter().zip(places).map(far).fold(0.0, f64::max)
}

#[test]
fn surveys_keep_their_places() {
    let folder = Folder::new();
    let near = read(&folder.path("scene.ply"));
    let (bytes, places) = surveyed(&near);
    std::fs::write(folder.path("far.ply"), bytes).unwrap();
    let info = folder.json(&["info", "far.ply"]);
    assert!((number(&info["offset"][1]) - FAR[1]).abs() < 10.0, "{}", info["offset"]);
    folder.run(&["compress", "far.ply", "--layout", "f32", "-o", "exact.lexi"]);
    folder.run(&["decompress", "exact.lexi", "-o", "back.ply"]);
    let header = std::fs::read(folder.path("back.ply")).unwrap();
    assert!(String::from_utf8_lossy(&header[..400]).contains("property double x\n"));
    assert!(worst(&folder.path("back.ply"), &places) < EXACT);
    folder.run(&["compress", "far.ply", "--guess", "--keep-order", "--keep-all", "-o", "packed.lexi"]);
    assert_eq!(folder.json(&["info", "packed.lexi"])["offset"], info["offset"]);
    folder.run(&["decompress", "packed.lexi", "-o", "packed.ply"]);
    assert!(worst(&folder.path("packed.ply"), &places) < PACKED);
    folder.run(&["convert", "packed.lexi", "a.glb"]);
    folder.run(&["convert", "a.glb", "glb.ply"]);
    assert!(worst(&folder.path("glb.ply"), &places) < PACKED);
    let lost = folder.json(&["convert", "far.ply", "a.spz"]);
    assert_eq!(lost["lost"]["offset"], info["offset"]);
    // The opposite of where it is brings it to the origin, in single precision.
    let by = format!("--translate={},{},{}", -FAR[0], -FAR[1], -FAR[2]);
    folder.run(&["convert", "far.ply", "moved.ply", &by]);
    let moved = read(&folder.path("moved.ply"));
    assert_eq!(moved.meta.offset, None);
    let pairs = moved.geometry.positions.iter().zip(&near.geometry.positions);
    assert!(pairs.flat_map(|(a, b)| [0, 1, 2].map(|k| (a[k] - b[k]).abs())).all(|d| f64::from(d) < EXACT));
    // A scene of single precision that goes there gets an offset; a tile beside it shares one with it.
    let there = format!("--translate={},{},{}", FAR[0], FAR[1] + 8.0, FAR[2]);
    folder.run(&["convert", "scene.ply", "tile.ply", &there]);
    let tile: Vec<[f64; 3]> = places.iter().map(|[x, y, z]| [*x, y + 8.0, *z]).collect();
    assert!(worst(&folder.path("tile.ply"), &tile) < EXACT);
    folder.run(&["convert", "far.ply", "tile.ply", "both.ply"]);
    let both = [places, tile].concat();
    assert!(worst(&folder.path("both.ply"), &both) < EXACT);
    folder.run(&["compress", "far.ply", "tile.ply", "--layout", "f32", "-o", "both.lexi"]);
    folder.run(&["decompress", "both.lexi", "-o", "both-back.ply"]);
    assert!(worst(&folder.path("both-back.ply"), &both) < EXACT);
}

/// Cameras are in the world of the source, and pictures are those of the scene at the origin.
#[test]
fn cameras_of_surveys_are_in_their_world() {
    let folder = Folder::of(FEW);
    let near = read(&folder.path("scene.ply"));
    std::fs::write(folder.path("far.ply"), surveyed(&near).0).unwrap();
    for (name, far) in [("near.json", [0.0; 3]), ("far.json", FAR)] {
        let one = |k: usize, x: f64| {
            format!(
                r#"{{"id": {k}, "img_name": "{k}", "width": 48, "height": 32, "fx": 40, "fy": 40,
                    "position": [{}, {}, {}], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}"#,
                far[0] + x,
                far[1],
                far[2] - 6.0
            )
        };
        let list = format!("[{}, {}]", one(0, 0.3), one(1, -0.3));
        std::fs::write(folder.path(name), list).unwrap();
    }
    // A picture that shows nothing has far fewer bytes.
    let draw = |scene: &str, cameras: &str, out: &str| {
        folder.run(&["render", scene, "--cameras", cameras, "-o", out, "--device", "cpu", "--quiet"]);
        std::fs::read(folder.path(&format!("{out}/000_0.png"))).unwrap().len() as f64
    };
    let pictures = [draw("scene.ply", "near.json", "a"), draw("far.ply", "far.json", "b")];
    assert!((pictures[0] / pictures[1] - 1.0).abs() < 0.05, "{pictures:?}");
    let compared = |a: &str, b: &str, cameras: &str| {
        let all = folder.json(&["compare", a, b, "--cameras", cameras, "--device", "cpu"]);
        number(&all["psnr"]["min"])
    };
    folder.run(&["compress", "far.ply", "--cameras", "far.json", "-o", "far.lexi", "--quiet"]);
    folder.run(&["convert", "far.ply", "far.spz", "--sh-bits", "8,8"]);
    folder.run(&["compress", "scene.ply", "--cameras", "near.json", "-o", "near.lexi", "--quiet"]);
    let [far, near] = [("far.ply", "far.lexi", "far.json"), ("scene.ply", "near.lexi", "near.json")]
        .map(|(a, b, c)| compared(a, b, c));
    assert!((far - near).abs() < 1.0 && far > 30.0, "{far} {near}");
    // A file that could not keep the offset lies beside it all the same.
    assert!(compared("far.ply", "far.spz", "far.json") > 30.0);
    let scores = folder.json(&[
        "eval",
        "far.lexi",
        "--original",
        "far.ply",
        "--cameras",
        "far.json",
        "--device",
        "cpu",
        "--no-flip",
    ]);
    assert!(number(&scores["models"][0]["to_original"]["psnr"]["min"]) > 30.0);
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
