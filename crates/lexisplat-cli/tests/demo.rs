//! The demo, as a newcomer runs it, on a smaller scene.

use crate::folder::Folder;

/// Largest page, in bytes.
const MOST_BYTES: usize = 4_000_000;

#[test]
fn the_page_is_small_and_the_packed_file_leads() {
    let folder = Folder::new();
    let text = folder.run(&["demo", "--gaussians", "2000"]);
    assert!(text.find("scene.lexi").unwrap() < text.find("scene-exact.lexi").unwrap(), "{text}");

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
