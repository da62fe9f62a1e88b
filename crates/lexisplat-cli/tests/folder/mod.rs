//! A folder with a scene in it, and the program run in it.
#![allow(clippy::unwrap_used, dead_code, reason = "a test may panic, and need not use everything")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use assert_cmd::Command;
use lexisplat::ply::{self, ReadOptions};
use lexisplat_sample::{SampleOptions, scene};
use serde_json::Value;

/// Gaussians of the test scene: enough to learn from, quick to draw.
pub(crate) const GAUSSIANS: usize = 1500;
/// Gaussians of the scene of tests that pack it again and again.
pub(crate) const FEW: usize = 400;
/// Gaussians of the scene of tests that ask nothing of its size.
pub(crate) const LEAST: usize = 100;

/// The files of a folder without folders in it, by their names.
pub(crate) type Files = OnceLock<BTreeMap<String, Vec<u8>>>;

pub(crate) fn lexisplat() -> Command {
    Command::cargo_bin("lexisplat").unwrap()
}

/// A folder with a scene in it.
pub(crate) struct Folder(pub(crate) tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self::of(GAUSSIANS)
    }

    /// A folder with a scene of [`FEW`] Gaussians, and `cameras.json`: a few small views of it. A scene is packed by them much
    /// sooner than by views that are looked for.
    pub(crate) fn few() -> Self {
        Self::with_cameras(FEW)
    }

    /// The same with [`LEAST`] Gaussians.
    pub(crate) fn least() -> Self {
        Self::with_cameras(LEAST)
    }

    fn with_cameras(gaussians: usize) -> Self {
        let folder = Self::of(gaussians);
        let splats = read(&folder.path("scene.ply"));
        std::fs::write(folder.path("cameras.json"), cameras(&splats, 12)).unwrap();
        folder
    }

    /// A folder with the scene of [`Self::new`], and `scene.lexi`: it packed with `--guess`.
    pub(crate) fn guessed() -> Self {
        static FILES: Files = Files::new();
        Self::with(&FILES, || {
            let folder = Self::new();
            folder.run(&["compress", "scene.ply", "--guess", "--quiet"]);
            folder
        })
    }

    /// A folder with the files of the one that `make` returns. It is made once for all tests.
    pub(crate) fn with(files: &Files, make: impl FnOnce() -> Self) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for (name, bytes) in files.get_or_init(|| make().files()) {
            std::fs::write(folder.path(name), bytes).unwrap();
        }
        folder
    }

    pub(crate) fn of(gaussians: usize) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        ply::write(&folder.path("scene.ply"), &scene(&SampleOptions::new(gaussians, 0))).unwrap();
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs in the folder; asserts success; standard output.
    pub(crate) fn run(&self, arguments: &[&str]) -> String {
        let output = lexisplat().current_dir(self.0.path()).args(arguments).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{arguments:?}: {error}");
        String::from_utf8(output.stdout).unwrap()
    }

    pub(crate) fn json(&self, arguments: &[&str]) -> Value {
        let mut all = arguments.to_vec();
        all.push("--json");
        serde_json::from_str(&self.run(&all)).unwrap()
    }

    /// Runs in the folder; asserts the exit code; standard error.
    pub(crate) fn fail(&self, arguments: &[&str], code: i32) -> String {
        let output = lexisplat().current_dir(self.0.path()).args(arguments).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {error}");
        assert!(!error.contains("panicked"), "{error}");
        error
    }

    pub(crate) fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Every file, those in folders below too, by its path from here.
    pub(crate) fn files(&self) -> BTreeMap<String, Vec<u8>> {
        let mut found = BTreeMap::new();
        let mut folders = vec![self.0.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for path in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
                if path.is_dir() {
                    folders.push(path);
                } else if path.is_file() {
                    let name = path.strip_prefix(self.0.path()).unwrap().display().to_string();
                    found.insert(name, std::fs::read(&path).unwrap());
                }
            }
        }
        found
    }
}

/// The text of a `cameras.json` with `views` views of 160 x 120 pixels around `splats`.
pub(crate) fn cameras(splats: &lexisplat::Splats, views: usize) -> String {
    let views = lexisplat_render::orbit(&splats.geometry, views, 160, 120).into_iter().map(|camera| {
        serde_json::json!({
            "img_name": camera.name, "width": camera.width, "height": camera.height,
            "fx": camera.fx, "fy": camera.fy, "position": camera.position, "rotation": camera.rotation,
        })
    });
    Value::from(views.collect::<Vec<_>>()).to_string()
}

pub(crate) fn read(path: &Path) -> lexisplat::Splats {
    ply::read(path, &ReadOptions::default()).unwrap().splats
}
