//! Pages with a viewer and a scene.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;

use crate::folder::Folder;

/// The bytes that a page holds between the end of `mark` and the next tag.
fn held(page: &str, mark: &str) -> Vec<u8> {
    let (_, after) = page.split_once(mark).unwrap_or_else(|| panic!("{mark}"));
    BASE64.decode(after.split(['<', '"']).next().unwrap()).unwrap()
}

fn compressed() -> Folder {
    let folder = Folder::new();
    folder.run(&["compress", "scene.ply", "--guess", "--quiet"]);
    folder
}

#[test]
fn a_page_holds_the_scene_and_a_picture_of_it() {
    let folder = compressed();
    let report = folder.json(&["html", "scene.lexi"]);
    let page = std::fs::read_to_string(folder.path("scene.html")).unwrap();
    assert_eq!(report["bytes"], page.len());
    assert!(page.contains("<title>scene</title>"), "the scene's name");
    assert_eq!(
        held(&page, "id=\"scene\" data-name=\"scene.lexi\">"),
        std::fs::read(folder.path("scene.lexi")).unwrap()
    );
    let poster = held(&page, "data-poster=\"data:image/jpeg;base64,");
    let poster = image::load_from_memory(&poster).unwrap();
    assert_eq!(poster.width(), 640);
    assert!(poster.to_rgb8().pixels().any(|p| p.0 != [0; 3]), "there is something to see");
    folder.fail(&["html", "scene.lexi"], 7);
    folder.run(&["html", "scene.lexi", "--overwrite", "--quiet"]);
    assert_eq!(std::fs::read_to_string(folder.path("scene.html")).unwrap(), page, "the same bytes again");
}

#[test]
fn two_scenes_are_compared_and_options_are_kept() {
    let folder = compressed();
    let args = ["html", "scene.ply", "scene.lexi", "-o", "both.html", "--title", "a & b", "--no-poster"];
    folder.run(&[&args[..], &["--actions", "mode=wipe,split=0.25"]].concat());
    let page = std::fs::read_to_string(folder.path("both.html")).unwrap();
    assert!(
        page.contains("<title>a &amp; b</title>") && page.contains("data-words=\"mode=wipe,split=0.25\"")
    );
    assert!(page.contains("data-poster=\"\""));
    assert_eq!(
        held(&page, "id=\"scene\" data-name=\"scene.ply\">"),
        std::fs::read(folder.path("scene.ply")).unwrap()
    );
    assert_eq!(
        held(&page, "id=\"scene2\" data-name=\"scene.lexi\">"),
        std::fs::read(folder.path("scene.lexi")).unwrap()
    );
}

#[test]
fn a_page_without_a_scene_is_a_viewer_and_what_is_no_scene_is_refused() {
    let folder = compressed();
    folder.run(&["html", "--quiet"]);
    let viewer = std::fs::read(folder.path("viewer.html")).unwrap();
    assert_eq!(folder.run(&["html", "-o", "-"]).into_bytes(), viewer);
    std::fs::write(folder.path("no.lexi"), "nonsense").unwrap();
    folder.fail(&["html", "no.lexi"], 4);
    folder.fail(&["html", "scene.lexi", "no.lexi", "-o", "b.html"], 4);
    folder.fail(&["html", "scene.lexi", "--poster", "scene.ply", "-o", "b.html"], 4);
    folder.fail(&["html", "scene.lexi", "-o", "b.lexi"], 5);
    assert!(!folder.path("b.html").exists());
    #[cfg(feature = "view")]
    folder.fail(&["html", "scene.lexi", "--actions", "dance", "-o", "b.html"], 5);
}
