//! Parts of packed files: their first bytes, fewer parts of SH, and what `info` says about layers.

use crate::folder::{Files, Folder, GAUSSIANS, read};
use lexisplat_sample::{SampleOptions, scene};
use serde_json::Value;

/// Gaussians of a scene that has two layers.
const LAYERED: usize = 9000;

/// A folder with a packed file of two layers.
fn layered() -> Folder {
    static FILES: Files = Files::new();
    Folder::with(&FILES, || {
        let folder = Folder::new();
        lexisplat::ply::write(&folder.path("large.ply"), &scene(&SampleOptions::new(LAYERED, 1))).unwrap();
        folder.run(&["compress", "large.ply", "--guess", "--quiet"]);
        folder
    })
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn a_first_part_is_decompressed_and_drawn() {
    let folder = layered();
    let info = folder.json(&["info", "large.lexi"]);
    let whole = number(&info["gaussians"]);
    let first = number(&info["lexi"]["first_layer"]["share"]);
    let share = format!("{:.1}%", 100.0 * first + 0.1);
    let report = folder.json(&["decompress", "large.lexi", "--first", &share, "-o", "first.ply"]);
    assert_eq!(report["gaussians"], info["lexi"]["layers"][0]["gaussians"]);
    assert_eq!(number(&report["gaussians_in_file"]), whole);
    assert_eq!(read(&folder.path("first.ply")).len() as f64, number(&report["gaussians"]));
    // As what came of a file whose transfer ended.
    let bytes = std::fs::read(folder.path("large.lexi")).unwrap();
    let some = bytes.len() / 3;
    std::fs::write(folder.path("came.lexi"), &bytes[..some]).unwrap();
    folder.fail(&["decompress", "came.lexi"], 4);
    folder.run(&["decompress", "came.lexi", "--first", "100%", "-o", "came.ply"]);
    let text = folder.run(&["decompress", "large.lexi", "--first", &some.to_string(), "-o", "third.ply"]);
    assert!(text.contains(" of "), "{text}");
    let [came, third] = ["came.ply", "third.ply"].map(|name| std::fs::read(folder.path(name)).unwrap());
    assert!(came == third);
    // All of it is the whole scene.
    folder.run(&["decompress", "large.lexi", "--first", "1GB", "-o", "all.ply"]);
    folder.run(&["decompress", "large.lexi", "-o", "whole.ply"]);
    let [all, whole] = ["all.ply", "whole.ply"].map(|name| std::fs::read(folder.path(name)).unwrap());
    assert!(all == whole);

    let draw = ["render", "large.lexi", "--orbit", "2", "--width", "64", "--device", "cpu"];
    let mut pictures = Vec::new();
    for (folder_name, more) in [("a", &["--first", &*share][..]), ("b", &["--first=100%"]), ("c", &[])] {
        folder.run(&[&draw[..], more, &["-o", folder_name]].concat());
        let files = folder.files().into_iter().filter(|(name, _)| name.starts_with(folder_name));
        pictures
            .push(files.filter(|(name, _)| name.ends_with(".png")).map(|file| file.1).collect::<Vec<_>>());
    }
    assert_eq!(pictures[0].len(), 2);
    assert!(pictures[0] != pictures[1] && pictures[1] == pictures[2]);
}

#[test]
fn parts_that_hold_nothing_or_cannot_be_read_are_refused() {
    let folder = layered();
    let error = folder.fail(&["decompress", "large.lexi", "--first", "100", "-o", "x.ply"], 4);
    assert!(error.contains("truncated"), "{error}");
    // The advice is followed.
    let layers = folder.json(&["info", "large.lexi"]);
    let complete = layers["lexi"]["first_layer"]["bytes"].as_u64().unwrap();
    let base = layers["lexi"]["layers"][0]["bytes"]["base"].as_u64().unwrap();
    let before = (complete - base).to_string();
    let error = folder.fail(&["decompress", "large.lexi", "--first", &before, "-o", "x.ply"], 5);
    let advice = error.split("--first ").nth(1).unwrap().split_whitespace().next().unwrap().to_owned();
    folder.run(&["decompress", "large.lexi", "--first", &advice, "-o", "least.ply"]);
    for bad in ["0%", "101%", "much", "-1"] {
        folder.fail(&["decompress", "large.lexi", "--first", bad, "-o", "x.ply"], 2);
    }
    folder.run(&["compress", "scene.ply", "--layout", "f16", "-o", "exact.lexi"]);
    let error = folder.fail(&["decompress", "exact.lexi", "--first", "50%"], 4);
    assert!(error.contains("only read whole"), "{error}");
    folder.fail(&["decompress", "exact.lexi", "--sh-parts", "0"], 5);
    folder.fail(&["render", "scene.ply", "--first", "50%"], 4);
    folder.fail(&["info", "exact.lexi", "--verify"], 5);
    folder.fail(&["info", "scene.ply", "--verify"], 5);
}

#[test]
fn parts_of_sh_are_left_out() {
    let folder = layered();
    let nonzero = |name: &str| read(&folder.path(name)).sh_rest.iter().filter(|&&x| x != 0.0).count();
    let parts = folder.json(&["info", "large.lexi"])["lexi"]["layers"][0]["bytes"]["sh_parts"].clone();
    let parts = parts.as_array().unwrap().len();
    let mut before = usize::MAX;
    for n in (0..=parts).rev() {
        folder.run(&["decompress", "large.lexi", "--sh-parts", &n.to_string(), "-o", "n.ply", "--overwrite"]);
        assert!(nonzero("n.ply") < before, "{n}");
        before = nonzero("n.ply");
    }
    assert_eq!(before, 0);
    folder.run(&[
        "render",
        "large.lexi",
        "--sh-parts",
        "0",
        "--orbit",
        "1",
        "--width",
        "32",
        "--device",
        "cpu",
    ]);
}

#[test]
fn info_lists_layers_and_verifies_integers() {
    let folder = layered();
    let info = folder.json(&["info", "large.lexi"]);
    let lexi = &info["lexi"];
    let layers = lexi["layers"].as_array().unwrap();
    assert_eq!((layers.len(), &lexi["version"]), (2, &3.into()));
    let sum = |name: &str| layers.iter().map(|layer| number(&layer[name])).sum::<f64>();
    assert_eq!(sum("gaussians"), number(&info["gaussians"]));
    let of = |layer: &Value| {
        let bytes = &layer["bytes"];
        let sh: f64 = bytes["sh_parts"].as_array().unwrap().iter().map(number).sum();
        number(&bytes["base"]) + number(&bytes["refinements"]) + sh + number(&bytes["interim"])
    };
    let data: f64 = layers.iter().map(of).sum();
    assert!(data < number(&info["file_bytes"]) && data > 0.8 * number(&info["file_bytes"]));
    let share = number(&lexi["first_layer"]["bytes"]) / number(&info["file_bytes"]);
    assert_eq!(number(&lexi["first_layer"]["share"]), share);
    assert_eq!((&lexi["checksums"], &lexi["integer_checksums"]), (&"ok".into(), &Value::Null));
    assert_eq!(folder.json(&["info", "large.lexi", "--verify"])["lexi"]["integer_checksums"], "ok");
    let text = folder.run(&["info", "large.lexi", "--verify", "--all"]);
    for part in ["SH part 3", "interim", "the first layer is complete", "also those of integers"] {
        assert!(text.contains(part), "{part} in {text}");
    }
    // A file of one layer has one line.
    folder.run(&["compress", "scene.ply", "--guess", "-q"]);
    let info = folder.json(&["info", "scene.lexi", "--verify"]);
    assert_eq!(info["lexi"]["layers"][0]["gaussians"], GAUSSIANS);
    folder.run(&["compress", "scene.ply", "--layout", "f16", "-o", "exact.lexi"]);
    assert_eq!(folder.json(&["info", "exact.lexi"])["lexi"]["version"], 1);
    assert!(!folder.run(&["info", "exact.lexi", "--all"]).contains("layers"));
}
