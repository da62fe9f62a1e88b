//! The program as a user runs it.

use crate::folder::{Folder, GAUSSIANS, lexisplat, read};
use lexisplat::{Extra, ExtraValues, ply};
use lexisplat_sample::{SampleOptions, scene};
use serde_json::Value;

#[test]
fn a_scene_goes_in_and_comes_back_within_the_promise() {
    let folder = Folder::new();
    for layout in ["f16", "f32", "paper"] {
        let report = folder.json(&[
            "compress",
            "scene.ply",
            "-o",
            "c.lexi",
            "--overwrite",
            "--layout",
            layout,
            "--tol",
            "0.08",
        ]);
        assert_eq!(report["gaussians"], GAUSSIANS);
        assert_eq!((&report["over_tolerance"], &report["layout"]), (&Value::from(0), &Value::from(layout)));
        assert!(report["max_residual"].as_f64().unwrap() <= 0.08);
        let on_disk = folder.path("c.lexi").metadata().unwrap().len();
        assert_eq!(report["file_bytes"], on_disk);
        let listed: u64 =
            report["attribute_bytes"].as_object().unwrap().values().map(|v| v.as_u64().unwrap()).sum();
        assert_eq!(listed, on_disk);
        let ratio = 45.0 / report["mean_nonzeros"].as_f64().unwrap();
        assert!((report["coefficient_ratio"].as_f64().unwrap() - ratio).abs() < 1e-9);
        for key in ["ply_bytes", "sh_bytes", "rms_residual", "learn_seconds", "code_seconds"] {
            assert!(report[key].is_number(), "{key}");
        }

        folder.run(&["decompress", "c.lexi", "-o", "back.ply", "--overwrite"]);
        let (original, back) = (read(&folder.path("scene.ply")), read(&folder.path("back.ply")));
        assert_eq!(original.geometry, back.geometry);
        assert_eq!(original.meta, back.meta);
        for i in 0..GAUSSIANS {
            let squares = original.rest(i).iter().zip(back.rest(i));
            let error = squares.map(|(x, y)| (f64::from(*x) - f64::from(*y)).powi(2)).sum::<f64>().sqrt();
            assert!(error <= 0.08, "Gaussian {i}: {error}");
        }
    }
}

#[test]
fn codes_draw_as_the_decompressed_scene_does() {
    let folder = Folder::few();
    folder.run(&["compress", "scene.ply", "--quiet"]);
    folder.run(&["decompress", "scene.lexi", "-o", "back.ply"]);
    let small = ["--orbit", "3", "--width", "120", "--views", "object"];
    let score = folder.json(&[&["compare", "back.ply", "scene.lexi"], &small[..]].concat());
    if score["identical"] != Value::Bool(true) {
        assert!(score["psnr"]["min"].as_f64().unwrap() >= 70.0, "{score}");
    }
    let score =
        folder.json(&[&["compare", "scene.ply", "scene.lexi", "--save-views", "seen"], &small[..]].concat());
    assert!(score["psnr"]["min"].as_f64().unwrap() > 35.0, "{score}");
    assert_eq!(score["views"].as_array().unwrap().len(), 3);
    for file in score["saved"].as_array().unwrap() {
        let picture = image::open(folder.path(file.as_str().unwrap())).unwrap();
        assert_eq!((picture.width(), picture.height()), (3 * 120 + 8, 80));
    }
    let same = folder.json(&[&["compare", "scene.ply", "scene.ply", "--8bit"], &small[..]].concat());
    assert_eq!(same["identical"], true);
    assert!(same["views"][0]["psnr"].is_null() && same["psnr"]["mean"].is_null());
    let text = folder.run(&[&["compare", "scene.ply", "scene.lexi"], &small[..]].concat());
    assert!(text.contains("minimum") && text.contains("orbit_002"), "{text}");
}

#[test]
fn pictures_sort_as_the_cameras_do() {
    let folder = Folder::new();
    let camera = |name: &str, x: f32, split: &str| {
        serde_json::json!({
            "id": 0, "img_name": name, "width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "split": split,
            "position": [x, -0.5, -4.0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        })
    };
    let cameras = Value::from(vec![
        camera("z", 0.0, "test"),
        camera("a/b.jpg", 0.3, "train"),
        camera("m", 0.5, "test"),
    ]);
    std::fs::write(folder.path("cameras.json"), cameras.to_string()).unwrap();
    let report = folder.json(&["render", "scene.ply", "--cameras", "cameras.json", "-o", "out"]);
    let files: Vec<&str> =
        report["views"].as_array().unwrap().iter().map(|v| v["file"].as_str().unwrap()).collect();
    assert_eq!(files.len(), 3);
    assert!(files.is_sorted(), "{files:?}");
    // Not `a_b.jpg.png`.
    assert!(files.iter().any(|file| file.ends_with("_a_b.png")), "{files:?}");
    let picture = image::open(folder.path(files[0])).unwrap();
    assert_eq!((picture.width(), picture.height()), (64, 48));
    assert!(picture.to_rgb8().pixels().any(|p| p.0 != [0, 0, 0]), "something is drawn");
    folder.fail(&["render", "scene.ply", "--cameras", "cameras.json", "-o", "out"], 7);
    let test = folder.json(&[
        "render",
        "scene.ply",
        "--cameras",
        "cameras.json",
        "--split",
        "test",
        "-o",
        "t",
        "--width",
        "32",
    ]);
    assert_eq!(test["views"].as_array().unwrap().len(), 2);
    assert_eq!(
        (&test["views"][0]["width"], &test["views"][0]["height"]),
        (&Value::from(32), &Value::from(24))
    );
}

#[test]
fn pipes_carry_scenes() {
    let folder = Folder::least();
    let scene = std::fs::read(folder.path("scene.ply")).unwrap();
    // A pipe has no folder in which cameras could lie.
    let cameras = folder.path("cameras.json");
    let small = lexisplat()
        .args(["compress", "-", "-o", "-", "--cameras"])
        .arg(&cameras)
        .write_stdin(scene)
        .output()
        .unwrap();
    assert!(small.status.success());
    folder.run(&["compress", "scene.ply", "-q"]);
    assert!(small.stdout == std::fs::read(folder.path("scene.lexi")).unwrap(), "a pipe gives the same bytes");
    let back = lexisplat().args(["decompress", "-"]).write_stdin(small.stdout.clone()).output().unwrap();
    folder.run(&["decompress", "scene.lexi", "-o", "back.ply"]);
    assert!(back.stdout == std::fs::read(folder.path("back.ply")).unwrap());
    let info = lexisplat().args(["info", "-", "--json"]).write_stdin(small.stdout).output().unwrap();
    let info: Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!((&info["kind"], &info["lexi"]["checksums"]), (&Value::from("lexi"), &Value::from("ok")));
    folder.fail(&["compress", "scene.ply", "-o", "-", "--json"], 5);
}

#[test]
fn threads_do_not_change_the_file() {
    let folder = Folder::least();
    for threads in ["1", "2"] {
        folder.run(&["compress", "scene.ply", "-o", &format!("{threads}.lexi"), "--threads", threads]);
    }
    let file = |name: &str| std::fs::read(folder.path(name)).unwrap();
    assert!(file("1.lexi") == file("2.lexi"));
}

#[test]
fn a_dictionary_serves_another_scene() {
    let folder = Folder::new();
    ply::write(&folder.path("other.ply"), &scene(&SampleOptions::new(GAUSSIANS, 9))).unwrap();
    folder.run(&["compress", "scene.ply", "--save-dictionary", "d.lexi", "-q"]);
    let own = folder.json(&["compress", "scene.ply", "-o", "own.lexi", "--dictionary", "d.lexi"]);
    let first = std::fs::read(folder.path("scene.lexi")).unwrap();
    assert!(
        first == std::fs::read(folder.path("own.lexi")).unwrap(),
        "the same dictionary gives the same file"
    );
    assert!(own["learn_rounds"].is_null());
    let other = folder.json(&["compress", "other.ply", "--dictionary", "scene.lexi"]);
    assert!(other["max_residual"].as_f64().unwrap() <= 0.1);
}

#[test]
fn info_lints() {
    let folder = Folder::new();
    let mut splats = scene(&SampleOptions::new(50, 0));
    splats.geometry.rotations[3] = [0.0; 4];
    ply::write(&folder.path("odd.ply"), &splats).unwrap();
    let info = folder.json(&["info", "odd.ply"]);
    assert_eq!((&info["kind"], &info["gaussians"]), (&Value::from("ply"), &Value::from(50)));
    assert_eq!(info["statistics"]["zero_quaternions"], 1);
    let brief = folder.run(&["info", "scene.ply"]);
    assert!(brief.contains("centres from ") && !brief.contains("opacity"), "{brief}");
    let text = folder.run(&["info", "scene.ply", "--all"]);
    assert!(text.starts_with(&brief), "{text}");
    assert!(text.contains("opacity") && text.contains("norm of a Gaussian's SH"), "{text}");
    let brief = folder.run(&["compress", "scene.ply", "--tol", "0.1"]);
    assert_eq!(brief.lines().count(), 3, "{brief}");
    assert!(brief.lines().nth(2).unwrap().starts_with("SH error: maximum 0."), "{brief}");
    let text = folder.run(&["info", "scene.lexi"]);
    assert!(text.contains("\nSH error: maximum") && text.lines().count() == 3, "{text}");
    assert!(!text.lines().any(|line| line.starts_with("error")), "the file is healthy: {text}");
}

#[test]
fn outputs_in_the_way_are_kept() {
    let folder = Folder::new();
    std::fs::write(folder.path("scene.lexi"), b"precious").unwrap();
    let error = folder.fail(&["compress", "scene.ply"], 7);
    assert!(error.contains("scene.lexi exists") && error.contains("help: give --overwrite"), "{error}");
    assert_eq!(std::fs::read(folder.path("scene.lexi")).unwrap(), b"precious");
    folder.fail(&["compress", "scene.ply", "-o", "scene.ply", "--overwrite"], 5);
    folder.fail(&["compress", "scene.ply", "-o", ".", "--overwrite"], 5);
    folder.run(&["compress", "scene.ply", "--guess", "--overwrite"]);
    assert_eq!(folder.names(), ["scene.lexi", "scene.ply"], "nothing temporary is left");
}

#[test]
fn each_blame_has_its_exit_code() {
    let folder = Folder::new();
    folder.fail(&["compress"], 2);
    folder.fail(&["compress", "scene.ply", "--pursuit", "magic"], 2);
    let error = folder.fail(&["compress", "missing.ply"], 3);
    assert!(error.contains("missing.ply"), "{error}");
    assert_eq!(error.matches("(os error 2)").count(), 1, "said once: {error}");
    folder.fail(&["compress", "scene.ply", "-o", "no/such/folder/x.lexi"], 3);
    std::fs::write(folder.path("text.ply"), "hello").unwrap();
    folder.fail(&["compress", "text.ply"], 4);
    folder.fail(&["compress", "scene.ply", "--tol", "0"], 5);
    folder.fail(&["compress", "scene.ply", "--atoms", "2000"], 5);
    folder.run(&["compress", "scene.ply", "--guess", "-q"]);
    let mut bytes = std::fs::read(folder.path("scene.lexi")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(folder.path("bad.lexi"), bytes).unwrap();
    let error = folder.fail(&["decompress", "bad.lexi"], 4);
    assert!(
        error.contains("checksum") && error.contains("bad.lexi") && error.lines().count() <= 2,
        "{error}"
    );
    assert!(!folder.path("bad.ply").exists());
}

#[test]
fn invalid_gaussians_are_refused_or_dropped() {
    let folder = Folder::new();
    let mut splats = scene(&SampleOptions::new(60, 0));
    splats.geometry.opacities[7] = f32::NAN;
    splats.sh_rest[45 * 20] = f32::INFINITY;
    ply::write(&folder.path("nan.ply"), &splats).unwrap();
    let error = folder.fail(&["compress", "nan.ply"], 4);
    assert!(
        error.contains("2 Gaussians") && error.contains("number 7") && error.contains("--drop-invalid"),
        "{error}"
    );
    let report = folder.json(&["compress", "nan.ply", "--drop-invalid"]);
    assert_eq!(report["gaussians"], 58);
    assert!(report["warnings"].to_string().contains('2'), "{report}");
}

#[test]
fn a_run_that_leaves_nothing_is_an_error() {
    let folder = Folder::new();
    let mut splats = scene(&SampleOptions::new(60, 0));
    splats.geometry.opacities.fill(f32::NAN);
    ply::write(&folder.path("nan.ply"), &splats).unwrap();
    splats.retain(&[false; 60]);
    ply::write(&folder.path("empty.ply"), &splats).unwrap();
    let before = folder.names();
    for (input, options) in [("nan.ply", &["--drop-invalid"][..]), ("empty.ply", &[])] {
        for command in [
            &["compress", input, "-o", "a.lexi"][..],
            &["compress", input, "-o", "a.lexi", "--layout", "f16"],
            &["compress", input, "-o", "a.lexi", "--guess"],
            &["convert", input, "a.ply"],
            &["convert", input, "a.spz"],
            &["convert", input, "a.lexi"],
        ] {
            let error = folder.fail(&[command, options].concat(), 4);
            assert!(error.contains(&format!("error: {input}: no Gaussian is left")), "{error}");
        }
    }
    let error = folder.fail(&["convert", "scene.ply", "a.spz", "--crop-sphere=900,0,0,1"], 5);
    assert!(error.contains("crop = sphere") && error.contains("leaves none"), "{error}");
    assert_eq!(folder.names(), before);
}

#[test]
fn values_of_a_scene_are_not_the_fault_of_an_option() {
    let folder = Folder::new();
    let mut splats = scene(&SampleOptions::new(60, 0));
    for (i, position) in splats.geometry.positions.iter_mut().enumerate() {
        *position = [f32::MAX * if i % 2 == 0 { 1.0 } else { -1.0 }, 0.0, 0.0];
    }
    ply::write(&folder.path("wide.ply"), &splats).unwrap();
    for options in [&["--guess"][..], &[]] {
        let error = folder.fail(&[&["compress", "wide.ply"][..], options].concat(), 4);
        assert!(error.contains("not of an option"), "{error}");
    }
}

#[test]
fn files_of_no_format_are_named_where_that_can_be() {
    let folder = Folder::new();
    let of_zip = |member: &str| {
        let name = u16::try_from(member.len()).unwrap().to_le_bytes();
        // A member of no bytes: its header, its entry in the directory, and the end of that.
        let fields = [&[20, 0, 0, 0, 0, 0, 0, 0, 0, 0][..], &[0; 12], &name, &[0; 2]].concat();
        let local = [&b"PK\x03\x04"[..], &fields[..], member.as_bytes()].concat();
        let central = [&b"PK\x01\x02\x14\x00"[..], &fields[..], &[0; 14], member.as_bytes()].concat();
        let [size, at] = [&central, &local].map(|part| u32::try_from(part.len()).unwrap().to_le_bytes());
        let end = [&b"PK\x05\x06"[..], &[0, 0, 0, 0, 1, 0, 1, 0], &size, &at, &[0; 2]].concat();
        [local, central, end].concat()
    };
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 100\n";
    std::fs::create_dir(folder.path("folder")).unwrap();
    for (name, bytes, said) in [
        ("pointer.ply", pointer.into(), "a pointer of Git LFS"),
        ("page.ply", b"\n<!DOCTYPE html><title>404</title>".to_vec(), "a page of HTML"),
        ("scene.zip", of_zip("a/point_cloud.ply"), "a zip archive with 'a/point_cloud.ply' in it"),
        ("deep.zip", of_zip("scene/meta.json"), "there is 'scene/meta.json'"),
        ("other.zip", of_zip("a.txt"), "so it is no SOG"),
        ("unknown", b"nothing that is known".to_vec(), "these are read: PLY"),
    ] {
        std::fs::write(folder.path(name), bytes).unwrap();
        for command in [&["info", name][..], &["compress", name, "-o", "a.lexi"], &["convert", name, "a.spz"]]
        {
            let error = folder.fail(command, 4);
            assert!(error.contains(said) && error.contains(name), "{command:?}: {error}");
        }
    }
    let error = folder.fail(&["info", "folder"], 3);
    assert!(error.contains("folder: this is a folder"), "{error}");
}

#[test]
fn extra_properties_are_kept_or_dropped() {
    let folder = Folder::new();
    let mut splats = scene(&SampleOptions::new(60, 0));
    let values = ExtraValues::U32((0..60).collect());
    splats.geometry.extras = vec![Extra { name: "label".into(), values }];
    ply::write(&folder.path("labelled.ply"), &splats).unwrap();
    let properties = |options: &[&str]| {
        let report =
            folder.json(&[&["compress", "labelled.ply", "-o", "l.lexi", "--overwrite"], options].concat());
        folder.run(&["decompress", "l.lexi", "-o", "l.ply", "--overwrite"]);
        let header = std::fs::read(folder.path("l.ply")).unwrap();
        let kept = String::from_utf8_lossy(&header).contains("property uint label");
        (kept, report["warnings"].to_string())
    };
    for layout in ["packed", "f16"] {
        let (kept, said) = properties(&["--layout", layout]);
        assert!(kept && said.contains("extra properties kept: label"), "{said}");
        let (kept, said) = properties(&["--layout", layout, "--drop-extras"]);
        assert!(!kept && said.contains("extra properties dropped: label"), "{said}");
    }
}

#[test]
fn a_cap_on_nonzeros_lifts_the_promise() {
    let folder = Folder::new();
    let report = folder.json(&["compress", "scene.ply", "--max-nonzeros", "2"]);
    assert!(report["tol"].is_null() && report["mean_nonzeros"].as_f64().unwrap() <= 2.0);
    let report =
        folder.json(&["compress", "scene.ply", "--max-nonzeros", "2", "--tol", "0.05", "--overwrite"]);
    assert!(report["over_tolerance"].as_u64().unwrap() > 0);
}

#[test]
fn quiet_is_silent_and_completions_are_not() {
    let folder = Folder::least();
    let output =
        lexisplat().current_dir(folder.0.path()).args(["compress", "scene.ply", "--quiet"]).output().unwrap();
    assert!(output.status.success() && output.stdout.is_empty() && output.stderr.is_empty());
    for shell in ["bash", "zsh", "fish"] {
        assert!(folder.run(&["completions", shell]).contains("lexisplat"), "{shell}");
    }
}

#[test]
fn the_program_and_each_command_have_a_manual_page() {
    let folder = Folder::least();
    let program = folder.run(&["man"]);
    // Roff writes a hyphen as \\-.
    assert!(program.contains(".TH lexisplat 1") && program.contains(r"lexisplat\-compress(1)"), "{program}");
    let page = folder.run(&["man", "compress"]);
    assert!(page.contains(".TH lexisplat-compress 1") && page.contains(r"\-\-psnr"), "{page}");
    let error = folder.fail(&["man", "knit"], 5);
    assert!(error.contains("command = knit") && error.contains("decompress"), "{error}");
}
