//! `scenes.toml`: the models of a sweep with their cameras and photos.

use std::collections::HashSet;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};

use lexisplat::inside;
use serde::Deserialize;

use super::results::Method;
use lexisplat_compress::views::SplitFilter;
use lexisplat_compress::{Error, Result};

/// Largest size of a manifest, in bytes: 40 times the size for the paper's 13 scenes by five methods.
const MAX_BYTES: u64 = 1 << 20;

/// A model of a sweep.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Entry {
    /// Name of the data set, such as `Mip-NeRF 360`; may be empty.
    #[serde(default)]
    pub dataset: String,
    /// Name of the scene, such as `bonsai`.
    pub name: String,
    /// Method that trained the model.
    pub method: Method,
    /// The model, a PLY.
    pub model: PathBuf,
    /// Path of the cameras: a `cameras.json`, a `transforms.json`, or a COLMAP folder. Without cameras views are
    /// generated.
    pub cameras: Option<PathBuf>,
    /// Folder of photos. Without photos models are only scored against the original.
    pub images: Option<PathBuf>,
    /// Divisor of the photos' size: 1, 2, 4 or 8, as in [`lexisplat_compress::views::ViewOptions`].
    pub resolution: Option<u32>,
    /// Distance of the near plane, as in [`lexisplat_compress::views::ViewOptions`].
    pub near: Option<f32>,
    /// Cameras to use. The default is the test split.
    #[serde(default = "test_split")]
    pub split: SplitFilter,
    /// A file that is shipped instead of the model. Its size is counted, but the file is not read.
    pub shipped: Option<PathBuf>,
}

fn test_split() -> SplitFilter {
    SplitFilter::Test
}

impl Entry {
    /// Returns all paths.
    fn paths(&self) -> impl Iterator<Item = &Path> {
        let others = [&self.cameras, &self.images, &self.shipped].into_iter().flatten();
        others.chain([&self.model]).map(PathBuf::as_path)
    }

    /// Returns the entry of a single model. The name of the scene is taken from the path, and the method is
    /// [`Method::Other`].
    #[must_use]
    pub fn of_model(model: &Path) -> Self {
        Self {
            dataset: String::new(),
            name: name_of(model),
            method: Method::Other,
            model: model.to_owned(),
            cameras: None,
            images: None,
            resolution: None,
            near: None,
            split: SplitFilter::Test,
            shipped: None,
        }
    }
}

/// Returns the name of the scene: the name of the file, or of the folder above
/// `point_cloud/iteration_30000/point_cloud.ply`.
fn name_of(model: &Path) -> String {
    let text = |part: &std::ffi::OsStr| part.to_string_lossy().into_owned();
    let stem = model.file_stem().map(text).unwrap_or_default();
    if stem != "point_cloud" {
        return stem;
    }
    let folders: Vec<String> = model
        .parent()
        .into_iter()
        .flat_map(Path::components)
        .filter_map(|part| if let Component::Normal(name) = part { Some(text(name)) } else { None })
        .filter(|name| name != "point_cloud" && !name.starts_with("iteration_"))
        .collect();
    folders.last().cloned().unwrap_or(stem)
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default)]
    scene: Vec<Entry>,
}

/// Reads a manifest. Relative paths in it start at `root`, or else at the folder of the manifest, and must stay inside
/// this folder. Absolute paths may lead anywhere.
///
/// # Errors
/// [`Error::Io`] if the manifest cannot be read. [`Error::Format`] with line and field if it is not a manifest, if two
/// entries have the same data set, name and method, or if a relative path leads out of its folder.
pub fn read_manifest(path: &Path, root: Option<&Path>) -> Result<Vec<Entry>> {
    let mut text = String::new();
    // A device may have no size and no end, so the number of bytes read is limited.
    let read = std::fs::File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_string(&mut text));
    read.map_err(|e| Error::io(path, e))?;
    if text.len() as u64 > MAX_BYTES {
        return Err(Error::format(path, format!("a manifest has at most {MAX_BYTES} bytes")));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let root = root.unwrap_or(folder);
    let entries = parse_manifest(path, &text, root)?;
    for named in entries.iter().flat_map(Entry::paths) {
        match named.strip_prefix(root).map(|named| inside(root, named)) {
            // A file that does not exist is reported later, where it is needed, with its scene.
            Err(_) | Ok(Ok(_) | Err(lexisplat::Error::Io { .. })) => {}
            Ok(Err(error)) => return Err(error.into()),
        }
    }
    Ok(entries)
}

/// Returns the entries of the manifest `text`. Errors name `file`. Relative paths start at `root`.
///
/// # Errors
/// As [`read_manifest`].
pub fn parse_manifest(file: &Path, text: &str, root: &Path) -> Result<Vec<Entry>> {
    let document: Document = toml::from_str(text).map_err(|e| Error::format(file, e.to_string().trim()))?;
    let mut entries = document.scene;
    if entries.is_empty() {
        return Err(Error::format(file, "no [[scene]] in it"));
    }
    let mut seen = HashSet::new();
    for entry in &entries {
        if entry.name.trim().is_empty() {
            return Err(Error::format(file, "a scene's `name` is empty"));
        }
        if !seen.insert((&entry.dataset, &entry.name, entry.method)) {
            let problem = format!(
                "scene '{}' by '{}' is there twice: two entries must differ in dataset, name or method",
                entry.name, entry.method
            );
            return Err(Error::format(file, problem));
        }
    }
    for entry in &mut entries {
        let paths = [&mut entry.cameras, &mut entry.images, &mut entry.shipped].into_iter().flatten();
        paths.chain([&mut entry.model]).for_each(|path| *path = root.join(&path));
    }
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"
        [[scene]]
        dataset = "Mip-NeRF 360"
        name = "bonsai"
        method = "3dgs"
        model = "3dgs/bonsai/point_cloud.ply"
        cameras = "360/bonsai/sparse/0"
        images = "/data/360/bonsai/images_2"

        [[scene]]
        dataset = "Mip-NeRF 360"
        name = "bonsai"
        method = "eagles-no-sq"
        model = "e.ply"
        split = "all"
        resolution = 2
        shipped = "point_cloud_compressed.pkl"
    "#;

    fn parse(text: &str) -> Result<Vec<Entry>> {
        parse_manifest(Path::new("scenes.toml"), text, Path::new("/root"))
    }

    #[test]
    fn entries_are_read_and_paths_start_at_the_root() {
        let entries = parse(GOOD).unwrap();
        assert_eq!(entries.len(), 2);
        assert_eq!(entries[0].model, Path::new("/root/3dgs/bonsai/point_cloud.ply"));
        assert_eq!(entries[0].images.as_deref(), Some(Path::new("/data/360/bonsai/images_2")));
        assert_eq!((entries[0].split, entries[1].split), (SplitFilter::Test, SplitFilter::All));
        assert_eq!((entries[1].method, entries[1].resolution), (Method::EaglesNoSq, Some(2)));
        assert_eq!(entries[1].shipped.as_deref(), Some(Path::new("/root/point_cloud_compressed.pkl")));
    }

    #[test]
    fn mistakes_are_named() {
        let twice = format!("{GOOD}\n{GOOD}");
        for (text, named) in [
            ("", "no [[scene]]"),
            ("[[scene]]\nname = \"a\"\nmethod = \"3dgs\"", "model"),
            ("[[scene]]\nname = \"a\"\nmethod = \"4dgs\"\nmodel = \"a.ply\"", "4dgs"),
            ("[[scene]]\nname = \" \"\nmethod = \"3dgs\"\nmodel = \"a.ply\"", "name"),
            ("[[scene]]\nname = \"a\"\nmethod = \"3dgs\"\nmodel = \"a.ply\"\ncamera = \"b\"", "camera"),
            ("[[scene]", "expected"),
            (&twice, "twice"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(message.contains("scenes.toml") && message.contains(named), "{message}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn relative_paths_stay_in_their_folder() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("root");
        std::fs::create_dir(&root).unwrap();
        for file in ["outside.ply", "root/a.ply"] {
            std::fs::write(folder.path().join(file), b"ply").unwrap();
        }
        std::os::unix::fs::symlink("../outside.ply", root.join("link.ply")).unwrap();
        let read = |model: &str| {
            let text = format!("[[scene]]\nname = \"a\"\nmethod = \"3dgs\"\nmodel = \"{model}\"");
            std::fs::write(root.join("scenes.toml"), text).unwrap();
            read_manifest(&root.join("scenes.toml"), None)
        };
        for good in ["a.ply", "missing.ply", "/elsewhere/a.ply"] {
            assert!(read(good).is_ok(), "{good}");
        }
        for bad in ["../outside.ply", "link.ply"] {
            let message = read(bad).unwrap_err().to_string();
            assert!(message.contains("leads out of the folder"), "{message}");
        }
    }

    #[test]
    fn models_name_their_scenes() {
        for (path, name) in [
            ("a/bonsai-3dgs.ply", "bonsai-3dgs"),
            ("out/bicycle/point_cloud/iteration_30000/point_cloud.ply", "bicycle"),
            ("point_cloud.ply", "point_cloud"),
        ] {
            assert_eq!(Entry::of_model(Path::new(path)).name, name);
        }
    }
}
