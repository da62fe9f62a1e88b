//! `scenes.toml`: which models to evaluate, from where to look at them, and their photos.

use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::results::Method;
use lexisplat_eval::views::SplitFilter;
use lexisplat_eval::{Error, Result};

/// Largest manifest, in bytes: 40 times that of the paper's 13 scenes by five methods.
const MAX_BYTES: u64 = 1 << 20;

/// One model of a sweep.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Entry {
    /// Data set, such as `Mip-NeRF 360`; may be empty.
    pub dataset: String,
    /// Scene, such as `bonsai`.
    pub name: String,
    /// Who trained it.
    pub method: Method,
    /// The model, a PLY.
    pub model: PathBuf,
    /// Cameras: a `cameras.json`, a `transforms.json`, or a COLMAP folder. Without, views are generated.
    pub cameras: Option<PathBuf>,
    /// Folder of photos. Without, models are scored against the original alone.
    pub images: Option<PathBuf>,
    /// Divisor of the photos' size: 1, 2, 4 or 8; as [`lexisplat_eval::views::ViewOptions`] has it.
    pub resolution: Option<u32>,
    /// Which of the cameras to use. The test split, unless said.
    pub split: SplitFilter,
    /// File that would be shipped in place of the model, to be counted, not read.
    pub shipped: Option<PathBuf>,
}

impl Entry {
    /// A model on its own: its scene's name is taken from its path, its method is [`Method::Other`].
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
            split: SplitFilter::Test,
            shipped: None,
        }
    }
}

/// The scene's name: a file's, or that of the folder above `point_cloud/iteration_30000/point_cloud.ply`.
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
    scene: Vec<Table>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    #[serde(default)]
    dataset: String,
    name: String,
    method: Method,
    model: PathBuf,
    cameras: Option<PathBuf>,
    images: Option<PathBuf>,
    resolution: Option<u32>,
    split: Option<Split>,
    shipped: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Split {
    All,
    Train,
    Test,
}

/// Reads a manifest. Relative paths in it start at `root`, or else at the manifest's folder.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Format`] naming line and field if it is no manifest, or two
/// of its entries have the same data set, name and method.
pub fn read_manifest(path: &Path, root: Option<&Path>) -> Result<Vec<Entry>> {
    let size = std::fs::metadata(path).map_err(|e| Error::io(path, e))?.len();
    if size > MAX_BYTES {
        return Err(Error::format(path, format!("{size} bytes: a manifest has at most {MAX_BYTES}")));
    }
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    parse_manifest(path, &text, root.unwrap_or(folder))
}

/// The entries of the manifest `text`; `file` names it in errors. Relative paths start at `root`.
///
/// # Errors
/// As [`read_manifest`].
pub fn parse_manifest(file: &Path, text: &str, root: &Path) -> Result<Vec<Entry>> {
    let document: Document = toml::from_str(text).map_err(|e| Error::format(file, e.to_string().trim()))?;
    let mut entries: Vec<Entry> = Vec::with_capacity(document.scene.len());
    for table in document.scene {
        if table.name.trim().is_empty() {
            return Err(Error::format(file, "a scene's `name` is empty"));
        }
        let same =
            |e: &&Entry| (&e.dataset, &e.name, e.method) == (&table.dataset, &table.name, table.method);
        if entries.iter().any(|e| same(&e)) {
            let problem = format!(
                "scene '{}' by '{}' is there twice: two entries differ in dataset, name or method",
                table.name, table.method
            );
            return Err(Error::format(file, problem));
        }
        let at = |path: PathBuf| root.join(path);
        entries.push(Entry {
            dataset: table.dataset,
            name: table.name,
            method: table.method,
            model: at(table.model),
            cameras: table.cameras.map(at),
            images: table.images.map(at),
            resolution: table.resolution,
            split: match table.split {
                None | Some(Split::Test) => SplitFilter::Test,
                Some(Split::Train) => SplitFilter::Train,
                Some(Split::All) => SplitFilter::All,
            },
            shipped: table.shipped.map(at),
        });
    }
    if entries.is_empty() {
        return Err(Error::format(file, "no [[scene]] in it"));
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
