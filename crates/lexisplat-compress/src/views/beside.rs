//! Cameras in the places where trainers leave them.

use std::path::{Path, PathBuf};

use lexisplat_render::{ViewSet, read_views};

/// Names of files and folders with cameras, in the order of the search. A COLMAP folder has one of the files [`COLMAP`].
const NAMES: [&str; 5] =
    ["cameras.json", "transforms.json", "transforms_train.json", "sparse/0", "colmap/sparse/0"];
/// Files of a COLMAP model.
const COLMAP: [&str; 2] = ["images.bin", "images.txt"];
/// Number of folders to search: the folder of the scene, the folder above, and the folder in which INRIA's trainer leaves
/// cameras, two above that of `point_cloud/iteration_N/point_cloud.ply`.
const FOLDERS: usize = 3;

/// Returns the path of the cameras beside `scene`, without reading them. The folder of the scene is searched first, then
/// the folder above, then the folder two above if the one between is named `point_cloud`. Each is searched for
/// `cameras.json`, `transforms.json`, `transforms_train.json`, `sparse/0` and `colmap/sparse/0`, in this order.
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

/// Reads the cameras that [`cameras_beside`] finds, in the world of the scene. Returns their path and the cameras; `None`
/// if there are no cameras or they cannot be read.
#[must_use]
pub fn read_beside(scene: &Path) -> Option<(PathBuf, ViewSet)> {
    let path = cameras_beside(scene)?;
    let set = read_views(&path, &mut |_| None).ok()?;
    Some((path, set))
}

/// Returns the folder above `folder`; `None` above the root.
fn parent(folder: &Path) -> Option<PathBuf> {
    if folder.as_os_str().is_empty() {
        return Some(PathBuf::from(".."));
    }
    match folder.file_name() {
        Some(_) => folder.parent().map(Path::to_path_buf),
        // `.` and `..` do not name the folder above them.
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
