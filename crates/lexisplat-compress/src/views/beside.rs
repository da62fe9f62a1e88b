//! Cameras that lie where trainers leave them.

use std::path::{Path, PathBuf};

use lexisplat_render::{ViewSet, read_views};

/// Files and folders of cameras, in the order in which they are looked for. A folder of COLMAP has one of [`COLMAP`].
const NAMES: [&str; 5] =
    ["cameras.json", "transforms.json", "transforms_train.json", "sparse/0", "colmap/sparse/0"];
/// Files of a COLMAP model.
const COLMAP: [&str; 2] = ["images.bin", "images.txt"];
/// Folders above a scene that are looked in: its own, the one above, and the one that INRIA's trainer leaves cameras in, two
/// above `point_cloud/iteration_N/point_cloud.ply`.
const FOLDERS: usize = 3;

/// Returns the cameras that lie beside `scene`, one folder above it, or, if its folder is in one named `point_cloud`, two above:
/// the nearest file `cameras.json`, `transforms.json` or `transforms_train.json`, or COLMAP's `sparse/0`. They are not read.
#[must_use]
pub fn cameras_beside(scene: &Path) -> Option<PathBuf> {
    // A name without a folder has an empty parent, which is the current folder.
    let mut folder = scene.parent()?.to_path_buf();
    for above in 0..FOLDERS {
        if above == FOLDERS - 1 && folder.file_name().is_none_or(|name| name != "point_cloud") {
            return None;
        }
        if above > 0 {
            folder = parent(&folder)?;
        }
        let there = |path: &PathBuf| path.is_file() || COLMAP.iter().any(|file| path.join(file).is_file());
        if let Some(found) = NAMES.iter().map(|name| folder.join(name)).find(there) {
            return Some(found);
        }
    }
    None
}

/// Reads the cameras that [`cameras_beside`] finds, in the world of the scene. Returns where they are too; `None` if there are none
/// or they cannot be read.
#[must_use]
pub fn read_beside(scene: &Path) -> Option<(PathBuf, ViewSet)> {
    let path = cameras_beside(scene)?;
    let set = read_views(&path, &mut |_| None).ok()?;
    Some((path, set))
}

/// The folder above `folder`; `None` above the root.
fn parent(folder: &Path) -> Option<PathBuf> {
    if folder.as_os_str().is_empty() {
        return Some(PathBuf::from(".."));
    }
    match folder.file_name() {
        Some(_) => folder.parent().map(Path::to_path_buf),
        // `.` and `..` say nothing of what is above them.
        None if folder.has_root() => None,
        None => Some(folder.join("..")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_found_where_trainers_leave_them() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let own = root.join("out/point_cloud/iteration_7000");
        std::fs::create_dir_all(&own).unwrap();
        let scene = own.join("point_cloud.ply");
        let put = |name: &str| {
            let path = root.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, "[]").unwrap();
        };
        assert_eq!(cameras_beside(&scene), None);
        put("out/cameras.json");
        assert_eq!(cameras_beside(&scene), Some(root.join("out/cameras.json")));
        // Two above only in the trainer's folders.
        assert_eq!(cameras_beside(&root.join("out/a/b/scene.ply")), None);
        assert_eq!(cameras_beside(&root.join("out/a/scene.ply")), Some(root.join("out/cameras.json")));
        // Nearer ones first; a folder without a model is none.
        std::fs::create_dir_all(own.join("sparse/0")).unwrap();
        assert_eq!(cameras_beside(&scene), Some(root.join("out/cameras.json")));
        put("out/point_cloud/iteration_7000/sparse/0/images.bin");
        assert_eq!(cameras_beside(&scene), Some(own.join("sparse/0")));
        put("out/point_cloud/iteration_7000/transforms.json");
        assert_eq!(cameras_beside(&scene), Some(own.join("transforms.json")));
    }

    #[test]
    fn folders_have_folders_above() {
        let above = |folder: &str| parent(Path::new(folder));
        assert_eq!(above(""), Some(PathBuf::from("..")));
        assert_eq!(above("a"), Some(PathBuf::from("")));
        assert_eq!(above(".."), Some(PathBuf::from("../..")));
        assert_eq!(above("/"), None);
    }
}
