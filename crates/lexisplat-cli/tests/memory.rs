//! Scenes that are said to be larger than memory, as a user packs them.

use crate::folder;
use crate::folder::{FEW, Folder, read};

/// Less than any scene takes.
const LITTLE: [&str; 2] = ["--memory", "100kB"];

#[test]
fn a_scene_larger_than_memory_is_packed_in_parts() {
    let folder = Folder::of(FEW);
    let report = folder.json(&[&["compress", "scene.ply", "--keep-order"], &LITTLE[..]].concat());
    assert_eq!((&report["sensitivity"], &report["layout"]), (&"views".into(), &"packed".into()));
    let bytes = std::fs::read(folder.path("scene.lexi")).unwrap();
    assert_eq!(report["file_bytes"], bytes.len());
    let listed = report["attribute_bytes"].as_object().unwrap().values().map(|v| v.as_f64().unwrap());
    let listed: f64 = listed.sum();
    assert!((listed - bytes.len() as f64).abs() < 8.0, "{listed}");
    folder.run(
        &[&["compress", "scene.ply", "--keep-order", "--overwrite", "--threads", "1"], &LITTLE[..]].concat(),
    );
    assert!(std::fs::read(folder.path("scene.lexi")).unwrap() == bytes, "threads show");
    let info = folder.json(&["info", "scene.lexi"]);
    assert_eq!(info["lexi"]["order_kept"], true);
    folder.run(&["decompress", "scene.lexi", "-o", "back.ply"]);
    let (before, after) = (read(&folder.path("scene.ply")), read(&folder.path("back.ply")));
    assert_eq!(after.len(), FEW);
    let far = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|k| (a[k] - b[k]).abs() > 0.1);
    assert!(!before.geometry.positions.iter().zip(&after.geometry.positions).any(far), "out of order");
    let text = folder
        .run(&[&["compress", "scene.ply", "--psnr", "25", "--overwrite", "--all"], &LITTLE[..]].concat());
    assert!(text.contains("part by part") && text.contains("left out"), "{text}");
    let info = folder.json(&["info", "scene.lexi"]);
    assert_eq!(info["gaussians"].as_u64().unwrap() + info["lexi"]["removed"].as_u64().unwrap(), FEW as u64);
    assert_eq!(folder.names(), ["back.ply", "scene.lexi", "scene.ply"]);
}

#[test]
fn what_shows_can_be_guessed_whatever_the_memory() {
    let folder = Folder::of(FEW);
    let report = folder.json(&["compress", "scene.ply", "--guess", "-o", "much.lexi"]);
    assert_eq!((&report["sensitivity"], &report["look_seconds"]), (&"guess".into(), &0.0.into()));
    let text =
        folder.run(&[&["compress", "scene.ply", "--guess", "-o", "little.lexi"], &LITTLE[..]].concat());
    assert!(text.contains("guessed"), "{text}");
    folder.run(&[&["compress", "scene.ply", "-o", "looked.lexi"], &LITTLE[..]].concat());
    let file = |name: &str| std::fs::read(folder.path(name)).unwrap();
    assert!(file("much.lexi") == file("little.lexi"));
    assert!(file("looked.lexi") != file("little.lexi"));
    let error = folder.fail(&["compress", "scene.ply", "--guess", "--psnr", "40"], 2);
    assert!(error.contains("--guess") && error.contains("--psnr"), "{error}");
}

#[test]
fn what_needs_the_whole_scene_is_refused_before_any_work() {
    let folder = Folder::new();
    for option in
        [&["--min-psnr", "40"][..], &["--size", "10kB"], &["--ratio", "12"], &["--max-gaussians", "9"]]
    {
        let error = folder.fail(&[&["compress", "scene.ply"], option, &LITTLE[..]].concat(), 5);
        assert!(error.contains(&option[0][2..]) && error.contains("memory = 100000"), "{error}");
    }
    assert_eq!(folder.names(), ["scene.ply"]);
}

#[test]
fn files_of_the_other_layouts_do_not_depend_on_memory() {
    let folder = Folder::new();
    folder.run(&["compress", "scene.ply", "--layout", "f16", "-o", "much.lexi"]);
    folder.run(&[&["compress", "scene.ply", "--layout", "f16", "-o", "little.lexi"], &LITTLE[..]].concat());
    let file = |name: &str| std::fs::read(folder.path(name)).unwrap();
    assert!(file("much.lexi") == file("little.lexi"));
    // The same through pipes.
    let piped = folder::lexisplat()
        .current_dir(folder.0.path())
        .args(["compress", "-", "--layout", "f16"])
        .write_stdin(file("scene.ply"))
        .output()
        .unwrap();
    assert!(piped.status.success() && piped.stdout == file("much.lexi"));
}
