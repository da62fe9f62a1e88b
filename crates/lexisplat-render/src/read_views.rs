//! Reads cameras of any format. The format is recognised by content.

#[cfg(not(target_family = "wasm"))]
use std::path::Path;

#[cfg(not(target_family = "wasm"))]
use crate::camera::Camera;
#[cfg(not(target_family = "wasm"))]
use crate::cameras_json::read_cameras_bytes;
use crate::cameras_json::read_placed;
use crate::colmap;
use crate::error::{Error, Result};
use crate::transforms::{self, read_transforms_bytes};
use crate::view_files::ViewFiles;
use crate::view_set::{SizeOf, ViewSet};

/// Files of a COLMAP model. Each of them stands for its folder.
#[cfg(not(target_family = "wasm"))]
const COLMAP_FILES: [&str; 4] = ["cameras.bin", "images.bin", "cameras.txt", "images.txt"];
/// Names of files of cameras in a folder, in the order of the search.
const JSON_FILES: [&str; 2] = ["transforms.json", "cameras.json"];

/// Reads the cameras of a folder. The first found of these is read: a COLMAP model, in the folder or in `sparse/0`,
/// `sparse` or `colmap/sparse/0`; `transforms_train.json` with `transforms_test.json`; `transforms.json`; `cameras.json`.
///
/// # Errors
/// [`lexisplat::Error::Format`] if none of these exists, or a file is damaged; [`lexisplat::Error::Limit`] if a file has
/// too much of something; [`lexisplat::Error::Io`] if a file cannot be read.
pub fn read_view_files<F: ViewFiles + ?Sized>(files: &F, size_of: SizeOf<'_>) -> Result<ViewSet> {
    if let Some(model) = colmap::find(files) {
        return colmap::read(files, &model);
    }
    if transforms::is_nerf(files) {
        return transforms::read_nerf_files(files, size_of);
    }
    if let Some(file) = JSON_FILES.into_iter().find(|file| files.has(file)) {
        let (name, bytes) = files.open(file)?.read_limited()?;
        return read_views_bytes(&name, &bytes, size_of);
    }
    Err(Error::format(
        files.name(),
        "no cameras here: looked for a COLMAP model (cameras and images, .bin or .txt, here, in sparse/0, sparse or colmap/sparse/0), transforms_train.json, transforms.json and cameras.json",
    ))
}

/// Reads the cameras in `bytes`: a JSON list like [`crate::read_cameras_bytes`], and a JSON object like
/// [`read_transforms_bytes`]. Errors call the bytes `file`.
///
/// # Errors
/// [`lexisplat::Error::Format`] if the bytes are neither; otherwise as these two functions.
pub fn read_views_bytes(file: &str, bytes: &[u8], size_of: SizeOf<'_>) -> Result<ViewSet> {
    let bytes = lexisplat::without_byte_order_mark(bytes);
    match bytes.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(b'[') => Ok(ViewSet::new(read_placed(file, bytes)?, Vec::new())),
        Some(b'{') => read_transforms_bytes(file, bytes, size_of),
        _ => Err(Error::format(
            file,
            "neither a JSON list (cameras.json) nor a JSON object (transforms.json); a COLMAP model is given by its folder",
        )),
    }
}

/// Reads the cameras of `path`, in any format:
///
/// - a folder is read like [`read_view_files`];
/// - a file of a COLMAP model is read with its folder, like [`read_colmap`];
/// - another file is read like [`read_views_bytes`].
///
/// # Errors
/// As these three functions.
#[cfg(not(target_family = "wasm"))]
pub fn read_views(path: impl AsRef<Path>, size_of: SizeOf<'_>) -> Result<ViewSet> {
    let path = path.as_ref();
    let metadata = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
    if metadata.is_dir() {
        return read_view_files(path, size_of);
    }
    if path.file_name().is_some_and(|name| COLMAP_FILES.iter().any(|known| name == *known)) {
        let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        return read_colmap(folder.unwrap_or(Path::new(".")));
    }
    let (file, bytes) = crate::view_files::open(path)?.read_limited()?;
    read_views_bytes(&file, &bytes, size_of)
}

/// Reads a `cameras.json`. See [`read_cameras_bytes`].
///
/// # Errors
/// [`lexisplat::Error::Io`] if the file cannot be read; otherwise as [`read_cameras_bytes`].
#[cfg(not(target_family = "wasm"))]
pub fn read_cameras(path: impl AsRef<Path>) -> Result<Vec<Camera>> {
    let (file, bytes) = crate::view_files::open(path.as_ref())?.read_limited()?;
    read_cameras_bytes(&file, &bytes)
}

/// Reads the COLMAP model of `folder`, or of its `sparse/0`, `sparse` or `colmap/sparse/0`. The binary files are read if
/// both exist, otherwise the text files. See [`crate::read_colmap_binary`].
///
/// # Errors
/// [`lexisplat::Error::Io`] if a file cannot be read; [`lexisplat::Error::Format`] if there is no model, or as
/// [`crate::read_colmap_binary`]; [`lexisplat::Error::Limit`] if a file is over [`crate::MAX_COLMAP_BYTES`].
#[cfg(not(target_family = "wasm"))]
pub fn read_colmap(folder: impl AsRef<Path>) -> Result<ViewSet> {
    let folder = folder.as_ref();
    let Some(model) = colmap::find(folder) else {
        std::fs::metadata(folder).map_err(|e| Error::io(folder, e))?;
        let problem = "no COLMAP model: neither cameras.bin with images.bin nor cameras.txt with images.txt is here or in sparse/0, sparse or colmap/sparse/0";
        return Err(Error::format(folder.display().to_string(), problem));
    };
    colmap::read(folder, &model)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn files_in_memory_are_read_as_those_on_disk() {
        let list = r#"[{"img_name": "a", "width": 8, "height": 8, "fx": 8, "fy": 8,
            "position": [0, 0, 0], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}]"#;
        let mut files = BTreeMap::new();
        let read = |files: &BTreeMap<String, Vec<u8>>| read_view_files(files, &mut |_| None);
        assert!(matches!(read(&files), Err(Error::Codec(lexisplat::Error::Format { .. }))));
        files.insert("cameras.json".to_owned(), list.as_bytes().to_vec());
        assert_eq!(read(&files).unwrap().cameras[0].name, "a");
        let model =
            [("cameras.txt", "1 PINHOLE 64 48 60 60 32 24\n"), ("images.txt", "1 1 0 0 0 0 0 2 1 b\n\n")];
        files.extend(model.map(|(name, text)| (format!("sparse/0/{name}"), text.as_bytes().to_vec())));
        assert_eq!(read(&files).unwrap().cameras[0].name, "b");
        assert!(matches!(files.open("images.bin"), Err(Error::Codec(lexisplat::Error::Io { .. }))));
    }
}
