//! The demo, as a newcomer runs it, on a smaller scene.

use crate::folder::Folder;

/// Largest page, in bytes.
const MOST_BYTES: usize = 4_000_000;

#[test]
fn the_page_is_small_and_the_packed_file_leads() {
    let folder = Folder::new();
    let done = folder.json(&["demo", "--gaussians", "4000", "-q"]);
    let page = std::fs::read_to_string(folder.path("lexisplat-demo/report.html")).unwrap();
    assert!(page.len() <= MOST_BYTES, "{} bytes", page.len());
    assert_eq!(page.matches("data:image/jpeg").count(), 18, "three pictures of each of six views, once");

    let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}"));
    let ratio = |file: &str| {
        let bytes = std::fs::metadata(folder.path("lexisplat-demo").join(file)).unwrap().len();
        assert_eq!(done[if file == "scene.lexi" { "packed" } else { "exact" }]["bytes"], bytes);
        done["ply_bytes"].as_f64().unwrap() / bytes as f64
    };
    let (packed, exact) = (ratio("scene.lexi"), ratio("scene-exact.lexi"));
    assert!(packed > 2.0 * exact, "{packed} and {exact}");
    assert!(
        at(&format!("{packed:.2}\u{d7}")) < at("<main>"),
        "the summary at the top is about the packed file"
    );
    assert!(
        at(&format!("{exact:.2}\u{d7}")) > at("data:image/jpeg"),
        "the exact file comes after the pictures"
    );
    assert!(done["packed"]["psnr"]["mean"].as_f64().unwrap() > 30.0, "{done}");

    let text = folder.run(&["demo", "--gaussians", "100", "-o", "other"]);
    assert!(text.find("scene.lexi").unwrap() < text.find("scene-exact.lexi").unwrap(), "{text}");
}
