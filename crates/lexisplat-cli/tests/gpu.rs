//! Drawing on a GPU, as a user asks for it. Without an adapter these tests are skipped.

use crate::folder;
use crate::folder::{Folder, lexisplat};
use lexisplat_testing::{Need, missing};
use serde_json::Value;

/// Pictures of the two renderers are at least so alike, in dB.
const SAME: f64 = 60.0;
/// Hides every Vulkan driver from the loader.
pub(crate) const NO_DRIVERS: [(&str, &str); 2] =
    [("VK_DRIVER_FILES", "/nowhere.json"), ("VK_ICD_FILENAMES", "/nowhere.json")];

/// Whether there is an adapter to test with. If not, the running test is skipped.
fn gpu(folder: &Folder) -> bool {
    let devices = folder.json(&["devices"]);
    let any = !devices["devices"].as_array().unwrap().is_empty();
    if !any {
        missing(Need::Gpu, "there is no GPU adapter here");
    }
    any
}

fn pictures(folder: &Folder, name: &str) -> Vec<image::RgbImage> {
    let mut files: Vec<_> =
        std::fs::read_dir(folder.path(name)).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| image::open(file).unwrap().into_rgb8()).collect()
}

fn psnr(a: &image::RgbImage, b: &image::RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let squares: f64 = a.iter().zip(b.iter()).map(|(p, q)| (f64::from(*p) - f64::from(*q)).powi(2)).sum();
    10.0 * (255.0_f64.powi(2) * a.len() as f64 / squares.max(1e-9)).log10()
}

#[test]
fn devices_are_listed_with_what_auto_leaves_out() {
    let folder = Folder::new();
    if !gpu(&folder) {
        return;
    }
    let text = folder.run(&["devices"]);
    let first = &folder.json(&["devices"])["devices"][0];
    assert!(text.starts_with("0 ") && text.contains(first["name"].as_str().unwrap()), "{text}");
    assert!(text.contains("cpu "), "{text}");
    assert!(first["max_binding_bytes"].as_u64().unwrap() >= 128 << 20);
}

#[test]
fn both_renderers_draw_the_same_pictures() {
    let folder = Folder::guessed();
    if !gpu(&folder) {
        return;
    }
    for file in ["scene.ply", "scene.lexi"] {
        for device in ["cpu", "gpu"] {
            let out = format!("{file}-{device}");
            let told = folder
                .json(&["render", file, "-o", &out, "--orbit", "3", "--width", "200", "--device", device]);
            assert_eq!(told["device"] == "cpu", device == "cpu", "{told}");
        }
        let (a, b) = (pictures(&folder, &format!("{file}-cpu")), pictures(&folder, &format!("{file}-gpu")));
        assert_eq!((a.len(), b.len()), (3, 3));
        for (a, b) in a.iter().zip(&b) {
            assert!(psnr(a, b) >= SAME, "{file}: {}", psnr(a, b));
            assert!(a.iter().any(|&v| v > 50), "an empty picture proves nothing");
        }
    }
    let compare = |device: &str| {
        folder.json(&[
            "compare",
            "scene.ply",
            "scene.lexi",
            "--orbit",
            "3",
            "--width",
            "200",
            "--device",
            device,
        ])
    };
    let (cpu, gpu) = (compare("cpu"), compare("gpu"));
    let mean = |told: &Value| told["psnr"]["mean"].as_f64().unwrap();
    assert!((mean(&cpu) - mean(&gpu)).abs() < 0.05, "{} {}", mean(&cpu), mean(&gpu));
    assert_ne!(cpu["device"], gpu["device"]);
}

#[test]
fn a_file_says_when_a_gpu_looked_at_the_scene() {
    let folder = Folder::least();
    if !gpu(&folder) {
        return;
    }
    let compress = |out: &str, device: &str| {
        let given = ["--cameras", "cameras.json"];
        folder.json(
            &[&["compress", "scene.ply", "-o", out, "--psnr", "38", "--device", device][..], &given].concat(),
        )
    };
    let told = compress("gpu.lexi", "gpu");
    let name = told["device"].as_str().unwrap().to_owned();
    assert_ne!(name, "cpu");
    assert_eq!(folder.json(&["info", "gpu.lexi"])["lexi"]["device"], name.as_str());
    assert!(folder.run(&["info", "gpu.lexi", "--all"]).contains(&name));
    assert!(told["target"]["mean_psnr"].as_f64().unwrap() >= 38.0);
    // The GPU and the processor see the same, so the files are of a size.
    let reference = compress("cpu.lexi", "cpu");
    assert_eq!(folder.json(&["info", "cpu.lexi"])["lexi"]["device"], "cpu");
    let ratio = told["file_bytes"].as_f64().unwrap() / reference["file_bytes"].as_f64().unwrap();
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    // The default is the processor, bit for bit.
    folder.run(&[
        "compress",
        "scene.ply",
        "-o",
        "default.lexi",
        "--psnr",
        "38",
        "--cameras",
        "cameras.json",
        "-q",
    ]);
    let bytes = |file: &str| std::fs::read(folder.path(file)).unwrap();
    assert_eq!(bytes("default.lexi"), bytes("cpu.lexi"));
}

#[test]
fn bench_measures_every_path_by_stage() {
    let folder = Folder::new();
    if !gpu(&folder) {
        return;
    }
    folder.run(&["compress", "scene.ply", "--tol", "0.1", "-q"]);
    let few = ["--orbit", "2", "--width", "100", "--repeat", "2", "--warmup", "1", "--cpu-repeat", "1"];
    let told = folder.json(&[&["bench", "scene.lexi", "--device", "gpu"][..], &few].concat());
    let paths = told["paths"].as_array().unwrap();
    let named = |name: &str| paths.iter().find(|p| p["path"] == name).unwrap();
    for name in ["dense-f32", "dense-f16", "sparse", "sparse-ordered", "sparse-table"] {
        let path = named(name);
        assert!(path["frame"]["median"].as_f64().unwrap() > 0.0, "{path}");
        assert_eq!(path["views"].as_object().unwrap().len(), 2, "{path}");
        assert!(path["visible"].as_f64().unwrap() > 100.0, "{path}");
        let bytes = |key: &str| path[key].as_f64().unwrap();
        assert!(bytes("geometry_bytes_per_frame") > 16.0 * folder::GAUSSIANS as f64, "{path}");
        assert!(bytes("shading_bytes_per_frame") > 32.0 * bytes("visible"), "{path}");
        assert!(told["radiance_model"][name]["predicted"].as_f64().unwrap() > 0.0, "{told}");
    }
    assert_eq!(named("dense-f32")["sh_bytes"], folder::GAUSSIANS * 192);
    assert!(named("sparse")["sh_bytes"].as_u64().unwrap() < folder::GAUSSIANS as u64 * 96);
    assert!(named("cpu-sparse")["fps"].as_f64().unwrap() > 0.0);
    assert!(told["copy_bytes_per_second"].as_f64().unwrap() > 0.0);
    let text =
        folder.run(&[&["bench", "scene.ply", "--device", "gpu", "--paths", "dense-f16"][..], &few].concat());
    assert!(
        text.contains("dense-f16") && text.contains("cpu-dense") && !text.contains("dense-f32"),
        "{text}"
    );
    folder.fail(&["bench", "scene.ply", "--device", "gpu", "--paths", "sparse"], 5);
    folder.fail(&["bench", "scene.ply", "--paths", "shiny"], 2);
}

#[test]
fn without_an_adapter_the_processor_draws_and_the_message_says_what_to_do() {
    let folder = Folder::new();
    let run = |arguments: &[&str]| {
        lexisplat().current_dir(folder.0.path()).envs(NO_DRIVERS).args(arguments).output().unwrap()
    };
    // Other systems find their GPUs elsewhere.
    let listed = run(&["devices", "--json"]);
    if !serde_json::from_slice::<Value>(&listed.stdout).unwrap()["devices"].as_array().unwrap().is_empty() {
        missing(Need::Drivers, "GPU drivers cannot be hidden here");
        return;
    }
    let text = String::from_utf8(run(&["devices"]).stdout).unwrap();
    assert!(text.contains("mesa-vulkan-drivers") && text.contains("libvulkan1"), "{text}");
    let few = ["--orbit", "1", "--width", "64"];
    let drawn = run(&[&["render", "scene.ply", "-o", "views"][..], &few].concat());
    assert!(drawn.status.success() && String::from_utf8(drawn.stdout).unwrap().contains("(cpu)"));
    for device in ["gpu", "0"] {
        let refused = run(&[&["render", "scene.ply", "-o", "other", "--device", device][..], &few].concat());
        let error = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(8), "{error}");
        assert!(error.contains("mesa-vulkan-drivers") && error.contains("--device cpu"), "{error}");
        assert!(!error.contains("panicked"), "{error}");
    }
    assert!(!folder.path("other").exists(), "nothing is made before the device is open");
    let timed =
        run(&[&["bench", "scene.ply", "--repeat", "1", "--cpu-repeat", "1", "--json"][..], &few].concat());
    let told: Value = serde_json::from_slice(&timed.stdout).unwrap();
    assert!(told["device"].is_null() && told["paths"].as_array().unwrap().len() == 1, "{told}");
}

#[test]
fn devices_that_do_not_exist_are_refused() {
    let folder = Folder::new();
    let error = folder.fail(&["render", "scene.ply", "--device", "fast"], 2);
    assert!(error.contains("auto, cpu, gpu"), "{error}");
    if gpu(&folder) {
        let error = folder.fail(&["render", "scene.ply", "--device", "77"], 5);
        assert!(error.contains("device = 77") && error.contains("lexisplat devices"), "{error}");
    }
}
