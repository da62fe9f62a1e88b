//! Packed files as a user makes and reads them.

use crate::folder::{FEW, Folder, LEAST, lexisplat, read};
use serde_json::Value;

/// Few views, small: enough to tell qualities apart.
const SMALL: [&str; 6] = ["--views", "object", "--orbit", "4", "--width", "160"];
/// Packs the scene of [`Folder::few`] by its cameras.
const BY_CAMERAS: [&str; 4] = ["compress", "scene.ply", "--cameras", "cameras.json"];
/// An orbit as README's table has it.
const AROUND: [&str; 6] = ["--views", "object", "--orbit", "12", "--width", "480"];

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn mean_psnr(folder: &Folder, file: &str) -> f64 {
    let score = folder.json(&[&["compare", "scene.ply", file], &SMALL[..]].concat());
    number(&score["psnr"]["mean"])
}

#[test]
fn presets_are_ordered_and_the_default_is_balanced() {
    let folder = Folder::least();
    let (mut last_bytes, mut last_psnr) = (0, 0.0);
    for preset in ["small", "balanced", "high", "archive"] {
        let file = format!("{preset}.lexi");
        let report = folder.json(&["compress", "scene.ply", "-o", &file, "--preset", preset]);
        assert_eq!(report["layout"], "packed");
        let on_disk = folder.path(&file).metadata().unwrap().len();
        assert_eq!(report["file_bytes"], on_disk);
        let listed: f64 = report["attribute_bytes"].as_object().unwrap().values().map(number).sum();
        assert!((listed - on_disk as f64).abs() < 8.0, "{listed} {on_disk}");
        let psnr = mean_psnr(&folder, &file);
        assert!(on_disk > last_bytes && psnr > last_psnr + 2.0, "{preset}: {on_disk} bytes, {psnr} dB");
        (last_bytes, last_psnr) = (on_disk, psnr);
    }
    let default = folder.json(&["compress", "scene.ply"]);
    assert!(default["target"].is_null() && default["tol"].is_null());
    let file = |name: &str| std::fs::read(folder.path(name)).unwrap();
    assert!(file("scene.lexi") == file("balanced.lexi"));
    folder.json(&["compress", "scene.ply", "-o", "exact.lexi", "--layout", "f16"]);
    assert!(file("scene.lexi").len() * 4 < file("exact.lexi").len());
}

#[test]
fn a_quality_is_reached_and_recorded() {
    let folder = Folder::of(LEAST);
    for (option, asked, key) in [("--psnr", 38.0, "judged_psnr"), ("--min-psnr", 40.0, "min_psnr")] {
        let text = &asked.to_string();
        let report = folder.json(&["compress", "scene.ply", "--no-cameras", option, text, "--overwrite"]);
        let target = &report["target"];
        assert_eq!((&target["kind"], &target["asked"]), (&option[2..].into(), &asked.into()));
        let reached = &report["reached"];
        assert!((asked..asked + 0.6).contains(&number(&reached[key])), "{report}");
        // Generated views are judged by the worst quarter of them.
        assert!(number(&reached["judged_psnr"]) < number(&reached["mean_psnr"]), "{report}");
        for key in ["mean_psnr", "min_psnr", "views", "cameras"] {
            assert_eq!(target[key], reached[key], "{key}");
        }
        assert_eq!(target["cameras"], false);
        let info = folder.json(&["info", "scene.lexi"]);
        assert_eq!(&info["lexi"]["target"], target);
        assert_eq!(&info["lexi"]["reached"], reached);
        assert!(folder.run(&["info", "scene.lexi"]).contains("dB at worst"));
    }
    let error = folder.fail(&["compress", "scene.ply", "--psnr=-3", "--overwrite"], 5);
    assert!(error.contains("psnr"), "{error}");
    let error = folder.fail(&["compress", "scene.ply", "--psnr", "400", "--overwrite"], 5);
    assert!(error.contains("at most") && error.contains("dB"), "{error}");
}

#[test]
fn comparing_without_cameras_looks_from_where_compress_judged() {
    let folder = Folder::of(FEW);
    let report = folder.json(&["compress", "scene.ply"]);
    let views = report["reached"]["views"].to_string();
    let score = folder.json(&["compare", "scene.ply", "scene.lexi", "--orbit", &views, "--device", "cpu"]);
    assert_eq!(score["recorded"], report["reached"]);
    assert_eq!(score["found_views"], true);
    let text = folder.run(&["compare", "scene.ply", "scene.lexi", "--orbit", "3", "--device", "cpu"]);
    assert!(text.contains("about ") && text.contains("says the second file"), "{text}");
    let around = folder.json(&[&["compare", "scene.ply", "scene.lexi"], &SMALL[..]].concat());
    assert_ne!(around["psnr"]["mean"], score["psnr"]["mean"]);
    assert_eq!(around["found_views"], false);
}

#[test]
fn the_kind_of_scene_can_be_given() {
    let folder = Folder::least();
    let file = |kind: &[&str]| {
        folder.json(&[&["compress", "scene.ply", "--overwrite"], kind].concat());
        std::fs::read(folder.path("scene.lexi")).unwrap()
    };
    let auto = file(&["--no-cameras"]);
    assert!(auto == file(&["--views", "auto"]));
    assert!(auto != file(&["--views", "room"]));
    folder.fail(&["compress", "scene.ply", "--views", "room", "--cameras", "cameras.json"], 2);
    folder.fail(&["compress", "scene.ply", "--views", "room", "--guess"], 2);
}

#[test]
fn cameras_that_lie_beside_a_scene_are_used() {
    let folder = Folder::few();
    let compress = |more: &[&str]| {
        let arguments = [&["compress", "scene.ply", "--json", "--overwrite"], more].concat();
        let output = lexisplat().current_dir(folder.0.path()).args(arguments).output().unwrap();
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        (report["reached"]["cameras"].clone(), String::from_utf8(output.stderr).unwrap())
    };
    let file = || std::fs::read(folder.path("scene.lexi")).unwrap();
    let (used, said) = compress(&[]);
    assert!(used == true && said.contains("by the 12 cameras of cameras.json; --no-cameras"), "{said}");
    let found = file();
    let compare = |more: &[&str]| {
        let arguments = [&["compare", "scene.ply", "scene.lexi", "--json", "--device", "cpu"], more].concat();
        let output = lexisplat().current_dir(folder.0.path()).args(arguments).output().unwrap();
        let score: Value = serde_json::from_slice(&output.stdout).unwrap();
        (score, String::from_utf8(output.stderr).unwrap())
    };
    let (by_beside, said) = compare(&["--width", "64"]);
    assert!(said.contains("from 12 of the 12 cameras of cameras.json; --no-cameras"), "{said}");
    let (given, said) = compare(&["--width", "64", "--cameras", "cameras.json"]);
    assert!(given["psnr"] == by_beside["psnr"] && !said.contains("note:"), "{said}");
    for other in [["--no-cameras", "--width=64"], ["--orbit=8", "--width=64"]] {
        let (score, said) = compare(&other);
        assert!(score["found_views"] == true && !said.contains("note:"), "{said}");
    }
    let (used, said) = compress(&["--cameras", "cameras.json"]);
    assert!(used == true && !said.contains("note:"), "{said}");
    assert!(file() == found);
    // Cameras of the scene in other units do not belong to it.
    let mut cameras: Value =
        serde_json::from_slice(&std::fs::read(folder.path("cameras.json")).unwrap()).unwrap();
    for camera in cameras.as_array_mut().unwrap() {
        for k in 0..3 {
            camera["position"][k] = (20.0 * number(&camera["position"][k])).into();
        }
    }
    std::fs::write(folder.path("cameras.json"), cameras.to_string()).unwrap();
    let (used, said) = compress(&[]);
    assert!(used == false && said.contains("do not seem to belong"), "{said}");
    let (score, said) = compare(&["--width", "64"]);
    assert!(score["found_views"] == true && said.contains("do not seem to belong"), "{said}");
    let alone = file();
    let (_, said) = compress(&["--no-cameras"]);
    assert!(file() == alone && !said.contains("note:"), "{said}");
}

#[test]
fn a_size_is_never_exceeded() {
    let folder = Folder::few();
    for (option, most) in [("8kB", 8_000), ("14000", 14_000)] {
        let report = folder.json(&[&BY_CAMERAS[..], &["--size", option, "--overwrite"]].concat());
        let bytes = folder.path("scene.lexi").metadata().unwrap().len();
        assert_eq!(report["file_bytes"], bytes);
        assert!(bytes <= most && bytes > most * 9 / 10, "{bytes} of {most}");
        assert!(number(&report["target"]["mean_psnr"]) > 20.0);
    }
    let ply = folder.path("scene.ply").metadata().unwrap().len();
    folder.run(&[&BY_CAMERAS[..], &["--ratio", "12", "--overwrite"]].concat());
    assert!(folder.path("scene.lexi").metadata().unwrap().len() <= ply / 12);
    let before = std::fs::read(folder.path("scene.lexi")).unwrap();
    let error = folder.fail(&[&BY_CAMERAS[..], &["--size", "300", "--overwrite"]].concat(), 5);
    assert!(error.contains("nothing smaller can be made"), "{error}");
    let error = folder.fail(&[&BY_CAMERAS[..], &["--ratio", "1000", "--overwrite"]].concat(), 5);
    assert!(
        error.contains("ratio = 1000: at most") && !error.contains("bytes"),
        "a ratio for a ratio: {error}"
    );
    assert!(before == std::fs::read(folder.path("scene.lexi")).unwrap(), "the old file stays");
}

#[test]
fn given_cameras_are_searched_with() {
    let folder = Folder::of(FEW);
    let cameras: Vec<Value> = (0..12)
        .map(|i| {
            let x = 0.2 * f64::from(i) - 1.0;
            serde_json::json!({
                "id": i, "img_name": format!("c{i}"), "width": 120, "height": 80, "fx": 100.0, "fy": 100.0,
                "position": [x, -0.5, -4.0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            })
        })
        .collect();
    std::fs::write(folder.path("cameras.json"), Value::from(cameras).to_string()).unwrap();
    let report = folder.json(&["compress", "scene.ply", "--psnr", "40", "--cameras", "cameras.json"]);
    assert_eq!(report["target"]["cameras"], true);
    let score = folder.json(&["compare", "scene.ply", "scene.lexi", "--cameras", "cameras.json"]);
    let mean = number(&score["psnr"]["mean"]);
    assert!((39.0..41.5).contains(&mean), "{mean}");
}

#[test]
fn the_tolerance_holds_in_packed_files() {
    let folder = Folder::few();
    for tol in ["0.05", "0.2"] {
        let report = folder.json(&[
            "compress",
            "scene.ply",
            "--layout",
            "packed",
            "--tol",
            tol,
            "--keep-order",
            "--overwrite",
        ]);
        assert_eq!((&report["layout"], &report["over_tolerance"]), (&"packed".into(), &0.into()));
        folder.run(&["decompress", "scene.lexi", "-o", "back.ply", "--overwrite"]);
        let (original, back) = (read(&folder.path("scene.ply")), read(&folder.path("back.ply")));
        let tol: f64 = tol.parse().unwrap();
        for i in 0..original.len() {
            let pairs = original.rest(i).iter().zip(back.rest(i));
            let error = pairs.map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2)).sum::<f64>().sqrt();
            assert!(error <= tol, "Gaussian {i}: {error}");
        }
    }
}

#[test]
fn info_says_what_a_packed_file_is_made_of() {
    let folder = Folder::of(LEAST);
    let text = folder.run(&["compress", "scene.ply", "--all"]);
    let lines: Vec<&str> = text.lines().collect();
    assert!(
        lines[0].starts_with("wrote scene.lexi: ") && lines[0].contains(" Gaussians, SH degree "),
        "{text}"
    );
    assert!(lines[1].contains("x smaller, in ") && lines[2].starts_with("pictures: about "), "{text}");
    assert!(lines[3].is_empty() && text.contains("\nbits each ") && text.contains("\nseconds "), "{text}");
    let info = folder.json(&["info", "scene.lexi"]);
    let lexi = &info["lexi"];
    assert_eq!(
        (&lexi["layout"], &lexi["version"], &lexi["order_kept"]),
        (&"packed".into(), &3.into(), &false.into())
    );
    let bits = lexi["stream_bits_per_gaussian"].as_object().unwrap();
    assert_eq!(bits.len(), 30);
    let listed: f64 = lexi["attribute_bytes"].as_object().unwrap().values().map(number).sum();
    assert!((listed - number(&info["file_bytes"])).abs() < 8.0);
    let histogram = lexi["nonzero_histogram"].as_array().unwrap();
    assert_eq!(histogram.iter().map(number).sum::<f64>(), number(&info["gaussians"]));
    let usage = lexi["atom_usage"].as_array().unwrap();
    assert_eq!(usage.iter().map(number).sum::<f64>(), number(&lexi["nonzeros"]));
    assert!(number(&lexi["resident_sh_bytes_per_gaussian"]) < 192.0);
    let brief = folder.run(&["info", "scene.lexi"]);
    assert!(brief.lines().count() == 3 && brief.contains("\npictures: about "), "{brief}");
    let text = folder.run(&["info", "scene.lexi", "--all"]);
    assert!(text.starts_with(&brief), "{text}");
    for part in ["bits a Gaussian", "beside 192 dense", "Gaussians by nonzeros", "atoms:", "Position0"] {
        assert!(text.contains(part), "{part} in {text}");
    }
}

#[test]
fn what_is_left_out_is_reported() {
    let folder = Folder::few();
    let report = folder.json(&[&BY_CAMERAS[..], &["--preset", "small"]].concat());
    let removed = number(&report["removed"]);
    assert!(removed > 0.0);
    assert_eq!(number(&report["gaussians"]) + removed, FEW as f64);
    assert_eq!(folder.json(&["info", "scene.lexi"])["lexi"]["removed"], report["removed"]);
    assert!(folder.run(&["info", "scene.lexi"]).contains("left out"));
    for keep in ["--keep-all", "--keep-order"] {
        let report = folder.json(&[&BY_CAMERAS[..], &["--preset", "small", keep, "--overwrite"]].concat());
        assert_eq!((number(&report["removed"]), number(&report["gaussians"])), (0.0, FEW as f64));
        assert!(!folder.run(&["info", "scene.lexi"]).contains("left out"));
    }
}

#[test]
fn a_limit_on_gaussians_is_kept() {
    let folder = Folder::least();
    let most = LEAST / 4;
    let limit = most.to_string();
    let limited = [&BY_CAMERAS[..], &["--preset", "small", "--max-gaussians", &limit]].concat();
    let report = folder.json(&limited);
    let gaussians = number(&report["gaussians"]);
    assert!(gaussians <= most as f64 && gaussians > 0.0, "{gaussians}");
    assert_eq!(gaussians + number(&report["removed"]), LEAST as f64);
    let first = std::fs::read(folder.path("scene.lexi")).unwrap();
    folder.run(&[&limited[..], &["--overwrite"]].concat());
    assert!(std::fs::read(folder.path("scene.lexi")).unwrap() == first);
    // The reached quality is beside the original, and no preset promises more than the limit lets it.
    assert!(number(&report["reached"]["mean_psnr"]) < 35.0);
    // A limit that is kept anyway changes nothing.
    let plain = [&BY_CAMERAS[..], &["--preset", "small", "-o", "plain.lexi"]].concat();
    folder.run(&plain);
    folder.run(&[&plain[..6], &["-o", "wide.lexi", "--max-gaussians", "1000000"]].concat());
    let [plain, wide] = ["plain.lexi", "wide.lexi"].map(|name| std::fs::read(folder.path(name)).unwrap());
    assert!(plain == wide);
    for (option, code) in [("--keep-all", 2), ("--keep-order", 2), ("--guess", 2), ("--layout=f16", 5)] {
        folder.fail(&["compress", "scene.ply", "--max-gaussians", "5", option, "-o", "x.lexi"], code);
    }
    folder.fail(&["compress", "scene.ply", "--max-gaussians", "0", "-o", "x.lexi"], 2);
    let error =
        folder.fail(&["compress", "scene.ply", "--max-gaussians", "5", "--psnr", "40", "-o", "x.lexi"], 5);
    assert!(error.contains("nothing better"), "{error}");
}

#[test]
fn options_that_do_not_go_together_are_refused() {
    let folder = Folder::new();
    folder.fail(&["compress", "scene.ply", "--psnr", "40", "--size", "10kB"], 2);
    let error = folder.fail(&["compress", "scene.ply", "--layout", "f16", "--preset", "high"], 5);
    assert!(error.contains("--preset") && error.contains("packed"), "{error}");
    let error = folder.fail(&["compress", "scene.ply", "--psnr", "40", "--pursuit", "omp"], 5);
    assert!(error.contains("layout"), "{error}");
    assert_eq!(folder.names(), ["scene.ply"]);
}

#[test]
fn a_scene_in_other_units_is_packed_as_well() {
    let folder = Folder::new();
    let packed = |scene: &str, options: &[&str]| {
        let report =
            folder.json(&[&["compress", scene, "--overwrite", "-o", "scene.lexi"], options].concat());
        let score = folder.json(&[&["compare", scene, "scene.lexi"], &AROUND[..]].concat());
        (number(&report["file_bytes"]), number(&report["gaussians"]), number(&score["psnr"]["mean"]))
    };
    std::fs::write(folder.path("ring.ply"), include_bytes!("data/ring.ply")).unwrap();
    // As a whole, and as a scene is packed that is larger than memory.
    for options in [&[][..], &["--memory", "100kB"]] {
        let whole = packed("ring.ply", options);
        for scale in ["0.0001", "0.03", "10000"] {
            folder.run(&["convert", "ring.ply", "other.ply", "--scale", scale, "--overwrite"]);
            let other = packed("other.ply", options);
            assert!((other.0 / whole.0 - 1.0).abs() < 0.02, "{scale} {options:?}: {other:?}, {whole:?}");
            assert!((other.1 / whole.1 - 1.0).abs() < 0.01, "{scale} {options:?}: {other:?}, {whole:?}");
            assert!((other.2 - whole.2).abs() < 0.3, "{scale} {options:?}: {other:?}, {whole:?}");
        }
    }
}

#[test]
fn a_near_plane_that_hides_the_scene_is_told() {
    let folder = Folder::of(FEW);
    folder.run(&["convert", "scene.ply", "small.ply", "--scale", "0.01"]);
    let cameras: Vec<Value> = [-0.004, 0.0, 0.004]
        .map(|x| {
            serde_json::json!({
                "id": 0, "img_name": format!("c{x}"), "width": 90, "height": 60, "fx": 80.0, "fy": 80.0,
                "position": [x, -0.005, -0.04], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            })
        })
        .to_vec();
    std::fs::write(folder.path("cameras.json"), Value::from(cameras).to_string()).unwrap();
    let warned = |more: &[&str]| {
        let arguments =
            [&["compress", "small.ply", "--cameras", "cameras.json", "--overwrite"], more].concat();
        folder.json(&arguments)["warnings"].to_string()
    };
    assert!(warned(&[]).contains("the near plane, 0.2 units"), "{}", warned(&[]));
    assert!(!warned(&["--near", "0.002"]).contains("near plane"));
    folder.fail(&["compress", "small.ply", "--near", "0.002", "--overwrite"], 2);
}
