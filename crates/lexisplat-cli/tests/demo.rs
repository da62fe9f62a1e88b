//! The demo, as a newcomer runs it, on a smaller scene.

use std::path::Path;

use lexisplat_testing::{real_data, repository_file};

use crate::folder::Folder;

/// Largest page, in bytes.
const MOST_BYTES: usize = 4_000_000;

#[test]
fn the_page_is_small_and_the_packed_file_leads() {
    let folder = Folder::new();
    let text = folder.run(&["demo", "--gaussians", "2000"]);
    assert!(text.find("scene.lexi").unwrap() < text.find("scene-exact.lexi").unwrap(), "{text}");

    if let Some(readme) = repository_file("README.md") {
        let readme = std::fs::read_to_string(readme).unwrap();
        let said =
            readme.split("demo --gaussians 2000` makes a file of ").nth(1).expect("a line on the demo");
        let said = &said[..said.find(" dB.").unwrap()];
        let number = |text: &str| text.replace(',', "").parse::<f64>().unwrap_or_else(|_| panic!("{said}"));
        let bytes = number(said.split(' ').next().unwrap());
        let [scene, file] = ["scene.ply", "scene.lexi"].map(|name| folder.path("lexisplat-demo").join(name));
        same_as_said("the demo", &folder, [&scene, &file], bytes, number(said.rsplit(' ').next().unwrap()));
    }

    let page = std::fs::read_to_string(folder.path("lexisplat-demo/report.html")).unwrap();
    assert!(page.len() <= MOST_BYTES, "{} bytes", page.len());
    assert_eq!(page.matches("data:image/jpeg").count(), 18, "three pictures of each of six views, once");

    let viewer = std::fs::read_to_string(folder.path("lexisplat-demo/scene.html")).unwrap();
    assert!(viewer.contains("<title>lexisplat demo</title>") && viewer.contains("data-name=\"scene.lexi\">"));

    let bytes = |file| std::fs::metadata(folder.path("lexisplat-demo").join(file)).unwrap().len() as f64;
    let ratio = |file| bytes("scene.ply") / bytes(file);
    let (packed, exact) = (ratio("scene.lexi"), ratio("scene-exact.lexi"));
    assert!(packed > 2.0 * exact, "{packed} and {exact}");
    let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}"));
    assert!(
        at(&format!("{packed:.2}\u{d7}")) < at("<main>"),
        "the summary at the top is about the packed file"
    );
    assert!(
        at(&format!("{exact:.2}\u{d7}")) > at("data:image/jpeg"),
        "the exact file comes after the pictures"
    );
}

/// Asserts that README's figures of a file are those of `file` within 3 % of the bytes and 0.2 dB. `benches/tables.py` makes
/// them anew.
fn same_as_said(name: &str, folder: &Folder, [scene, file]: [&Path; 2], bytes: f64, decibels: f64) {
    let views = ["--views", "object", "--orbit", "12", "--width", "480", "--device", "cpu"];
    let [a, b] = [scene, file].map(|path| path.to_str().unwrap());
    let score = folder.json(&[&["compare", a, b], &views[..]].concat());
    let found = (file.metadata().unwrap().len() as f64, score["psnr"]["mean"].as_f64().unwrap());
    assert!((found.0 / bytes - 1.0).abs() <= 0.03, "{name}: {found:?} where README says {bytes}");
    assert!((found.1 - decibels).abs() <= 0.2, "{name}: {found:?} where README says {decibels} dB");
}

#[test]
fn the_readme_states_what_models_give() {
    let folder = Folder::new();
    let Some(readme) = repository_file("README.md") else { return };
    let readme = std::fs::read_to_string(readme).unwrap();
    for model in ["fruit-drops", "pc-short", "train-first1000"] {
        let Some(scene) = real_data(&format!("{model}.ply")) else { return };
        folder.run(&["compress", scene.to_str().unwrap(), "-o", "model.lexi", "--overwrite"]);
        let row = readme.lines().find(|line| line.starts_with(&format!("| {model} |"))).unwrap();
        let said: Vec<&str> = row.split('|').nth(4).unwrap().trim().split(&['x', ',', ' '][..]).collect();
        let [ratio, decibels] = [said[0], said[3]].map(|text| text.parse::<f64>().unwrap());
        let bytes = scene.metadata().unwrap().len() as f64 / ratio;
        same_as_said(model, &folder, [&scene, &folder.path("model.lexi")], bytes, decibels);
    }
}
