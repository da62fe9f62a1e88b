//! Pages with a viewer and a scene.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;

use crate::folder::Folder;

/// The bytes that a page holds between the end of `mark` and the next tag.
fn held(page: &str, mark: &str) -> Vec<u8> {
    let (_, after) = page.split_once(mark).unwrap_or_else(|| panic!("{mark}"));
    BASE64.decode(after.split(['<', '"']).next().unwrap()).unwrap()
}

#[test]
fn a_page_holds_the_scene_and_a_picture_of_it() {
    let folder = Folder::guessed();
    let report = folder.json(&["html", "scene.lexi"]);
    let page = std::fs::read_to_string(folder.path("scene.html")).unwrap();
    assert_eq!(report["bytes"], page.len());
    assert!(page.contains("<title>scene</title>"), "the scene's name");
    assert!(page.contains("data-controls=\"bar\">"), "a small bar");
    assert!(page.contains("data-words=\"view="), "the view of the picture");
    assert!(page.contains("connect-src 'none'") && !page.contains("connect-src *"), "it loads nothing");
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
    let folder = Folder::guessed();
    let args = ["html", "scene.ply", "scene.lexi", "-o", "both.html", "--title", "a & b", "--no-poster"];
    folder.run(&[&args[..], &["--tools", "--still", "--actions", "mode=wipe,split=0.25"]].concat());
    let page = std::fs::read_to_string(folder.path("both.html")).unwrap();
    assert!(
        page.contains("<title>a &amp; b</title>") && page.contains("data-words=\"mode=wipe,split=0.25,view=")
    );
    assert!(page.contains("data-poster=\"\"") && page.contains("data-controls=\"all\" data-still=\"\""));
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
fn a_sog_of_several_files_is_bundled_and_its_bytes_are_counted() {
    let folder = Folder::new();
    folder.run(&["convert", "scene.ply", "scene.sog", "--quiet"]);
    let parts = stored(&std::fs::read(folder.path("scene.sog")).unwrap());
    std::fs::create_dir(folder.path("garden")).unwrap();
    for (name, bytes) in &parts {
        std::fs::write(folder.path("garden").join(name), bytes).unwrap();
    }
    let all: usize = parts.iter().map(|(_, bytes)| bytes.len()).sum();
    for (from, page) in [("garden/meta.json", "a.html"), ("garden", "b.html")] {
        let report = folder.json(&["html", from, "-o", page, "--no-poster"]);
        let page = std::fs::read_to_string(folder.path(page)).unwrap();
        let mut bundled = stored(&held(&page, "id=\"scene\" data-name=\"garden.sog\">"));
        let mut expected = parts.clone();
        bundled.sort();
        expected.sort();
        assert!(bundled == expected, "the very files");
        assert!(report["scene_bytes"].as_u64().unwrap() > all as u64);
    }
    let small = ["--orbit", "1", "--width", "32", "--device", "cpu"];
    let compared = folder.json(&[&["compare", "scene.sog", "garden/meta.json"][..], &small].concat());
    assert_eq!(compared["b"]["bytes"], all);
    assert_eq!(compared["identical"], true);
    std::fs::remove_file(folder.path("garden/quats.webp")).unwrap();
    folder.fail(&["html", "garden/meta.json", "-o", "c.html", "--no-poster"], 3);
}

/// The names and contents of the members of a zip archive that stores them.
fn stored(archive: &[u8]) -> Vec<(String, Vec<u8>)> {
    let number =
        |at: usize, bytes: usize| (0..bytes).rev().fold(0, |n, k| n << 8 | usize::from(archive[at + k]));
    let mut members = Vec::new();
    let mut at = 0;
    while archive[at..].starts_with(b"PK\x03\x04") {
        let (size, name, extra) = (number(at + 18, 4), number(at + 26, 2), number(at + 28, 2));
        let start = at + 30 + name + extra;
        let called = String::from_utf8(archive[at + 30..at + 30 + name].to_vec()).unwrap();
        members.push((called, archive[start..start + size].to_vec()));
        at = start + size;
    }
    members
}

#[test]
fn a_page_without_a_scene_is_a_viewer_and_what_is_no_scene_is_refused() {
    let folder = Folder::guessed();
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
