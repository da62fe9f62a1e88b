//! The view from which viewers show a scene first.

use crate::folder::Folder;

/// A view of the test scene, as a viewer's link has it.
const VIEW: &str = "0.5:-1:-4:0:0:0:1:4:1.25";

fn stated(folder: &Folder, file: &str) -> Option<String> {
    folder.json(&["info", file])["view"].as_str().map(str::to_owned)
}

#[test]
fn a_file_states_the_best_view_or_the_one_that_is_given() {
    let folder = Folder::least();
    folder.run(&["compress", "scene.ply", "-o", "best.lexi", "--preset", "small", "--quiet"]);
    let best = stated(&folder, "best.lexi").unwrap();
    // It is the view of one of the cameras beside the scene.
    let cameras: Vec<serde_json::Value> =
        serde_json::from_slice(&std::fs::read(folder.path("cameras.json")).unwrap()).unwrap();
    let position = |text: &str| -> Vec<f64> { text.split(':').take(3).map(|v| v.parse().unwrap()).collect() };
    let near = |camera: &serde_json::Value| {
        (0..3).all(|k| (camera["position"][k].as_f64().unwrap() - position(&best)[k]).abs() < 1e-5)
    };
    assert!(cameras.iter().any(near), "{best}");

    folder.run(&["compress", "scene.ply", "-o", "exact.lexi", "--tol", "0.2", "--quiet"]);
    assert!(stated(&folder, "exact.lexi").is_some());
    for layout in ["packed", "f16"] {
        let given =
            ["compress", "scene.ply", "-o", "given.lexi", "--layout", layout, "--overwrite", "--quiet"];
        folder.run(&[&given[..], &["--view", &format!("https://a.b/#view={VIEW}&mode=first")]].concat());
        assert_eq!(stated(&folder, "given.lexi").as_deref(), Some(VIEW));
        folder.run(&[&given[..], &["--view", "none"]].concat());
        assert_eq!(stated(&folder, "given.lexi"), None);
    }
    folder.run(&["compress", "scene.ply", "-o", "guessed.lexi", "--guess", "--quiet"]);
    assert_eq!(stated(&folder, "guessed.lexi"), None);
    let error = folder.fail(&["compress", "scene.ply", "--view", "1:2:3"], 2);
    assert!(error.contains("after view="), "{error}");
}

#[test]
fn another_view_changes_nothing_else() {
    let folder = Folder::least();
    for layout in ["packed", "f16"] {
        folder.run(&["compress", "scene.ply", "-o", "a.lexi", "--layout", layout, "--overwrite", "--quiet"]);
        folder.run(&["convert", "a.lexi", "b.lexi", "--view", VIEW, "--overwrite", "--quiet"]);
        assert_eq!(stated(&folder, "b.lexi").as_deref(), Some(VIEW));
        let [a, b] = ["a.lexi", "b.lexi"].map(|file| {
            folder.run(&["decompress", file, "-o", "back.ply", "--overwrite", "--quiet"]);
            std::fs::read(folder.path("back.ply")).unwrap()
        });
        assert!(a == b, "{layout}");
        let own = stated(&folder, "a.lexi").unwrap();
        folder.run(&["convert", "b.lexi", "c.lexi", "--view", &own, "--overwrite", "--quiet"]);
        let [a, c] = ["a.lexi", "c.lexi"].map(|file| std::fs::read(folder.path(file)).unwrap());
        assert!(a == c, "{layout}");
    }
    // A scene that is moved is seen from elsewhere.
    folder.run(&["convert", "b.lexi", "moved.lexi", "--translate", "9,0,0", "--quiet"]);
    assert_ne!(stated(&folder, "moved.lexi").as_deref(), Some(VIEW));
}

#[test]
fn posters_and_pages_begin_with_the_view() {
    let folder = Folder::few();
    folder.run(&["compress", "scene.ply", "--layout", "f16", "--view", VIEW, "--quiet"]);
    folder.run(&["html", "scene.lexi", "--no-poster", "--quiet"]);
    let page = std::fs::read_to_string(folder.path("scene.html")).unwrap();
    assert!(page.contains(&format!("data-words=\"view={VIEW}\"")));
    let draw = ["render", "scene.lexi", "--device", "cpu", "--width", "160"];
    let report = folder.json(&[&draw[..], &["--poster", "a.png"]].concat());
    assert_eq!((&report["view"], &report["stated"]), (&VIEW.into(), &true.into()));
    folder.run(&[&draw[..], &["--poster", "b.jpg", "--quiet"]].concat());
    for file in ["a.png", "b.jpg"] {
        let picture = image::open(folder.path(file)).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (160, 90), "{file}");
        assert!(picture.pixels().any(|pixel| pixel.0 != [0; 3]), "{file} shows the scene");
    }
    folder.fail(&[&draw[..], &["--poster", "a.png"]].concat(), 7);
    let report =
        folder.json(&["render", "scene.ply", "--device", "cpu", "--width", "16", "--poster", "c.png"]);
    assert_eq!(report["stated"], false);
}
