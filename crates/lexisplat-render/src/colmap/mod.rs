//! Reads COLMAP models: `cameras.bin` and `images.bin`, or the same files as text.
//!
//! The rasteriser can draw only from cameras of the models `PINHOLE` and `SIMPLE_PINHOLE`, which COLMAP's
//! `image_undistorter` makes. Points are never read. The principal point is ignored, as in the 3DGS authors' loader
//! (`gaussian-splatting/scene/dataset_readers.py`, `readColmapCameras`). Models trained with that loader are therefore
//! drawn as they were trained; see [`ViewSet::warnings`].
//!
//! Formats: COLMAP's documentation, "Output Format", and `src/colmap/scene/reconstruction_io.cc`.

mod binary;
mod binary_reader;
mod intrinsics;
mod lines;
mod pose;
#[cfg(test)]
mod tests;
mod text;

use std::io::Read;

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::view_files::{ViewFile, ViewFiles, within};
use crate::view_set::{PrincipalPoints, ViewSet};
use binary_reader::BinaryReader;
use intrinsics::Cameras;
use lines::Lines;
use pose::Posed;

/// Largest file read, in bytes. `images.bin` holds every keypoint: 24 bytes each, and about 10,000 for each photo.
pub const MAX_COLMAP_BYTES: u64 = 4 << 30;
/// Folders of a model in the given folder: the folder itself, COLMAP's own layout, the layout of INRIA's `convert.py`, and
/// nerfstudio's layout.
const FOLDERS: [&str; 4] = ["", "sparse/0/", "sparse/", "colmap/sparse/0/"];

/// The names of the two files of a model.
pub(crate) struct ModelFiles {
    binary: bool,
    cameras: String,
    images: String,
}

/// Finds the model among `files`: the model in the first of the [`FOLDERS`] that has one. A folder with both kinds gives
/// the binary model.
pub(crate) fn find<F: ViewFiles + ?Sized>(files: &F) -> Option<ModelFiles> {
    FOLDERS.iter().find_map(|folder| {
        [(true, "bin"), (false, "txt")].into_iter().find_map(|(binary, end)| {
            let [cameras, images] = ["cameras", "images"].map(|name| format!("{folder}{name}.{end}"));
            (files.has(&cameras) && files.has(&images)).then_some(ModelFiles { binary, cameras, images })
        })
    })
}

/// Reads a model among `files`. Cameras are in the order of their names. These are the names of the photos as written,
/// with folders and extension. No split is set.
///
/// # Errors
/// [`lexisplat::Error::Io`] if a file cannot be read; [`lexisplat::Error::Limit`] if a file is over [`MAX_COLMAP_BYTES`];
/// otherwise as [`read_colmap_binary`].
pub(crate) fn read<F: ViewFiles + ?Sized>(files: &F, model: &ModelFiles) -> Result<ViewSet> {
    let open = |file: &str| {
        let file = files.open(file)?;
        if file.len > MAX_COLMAP_BYTES {
            let what = format!("{}: bytes", file.name);
            return Err(Error::limit(what, file.len, MAX_COLMAP_BYTES));
        }
        Ok(file)
    };
    join(model.binary, open(&model.cameras)?, open(&model.images)?)
}

/// Returns the views in the bytes of a `cameras.bin` and an `images.bin`. Errors call their folder `name`.
///
/// # Errors
/// [`lexisplat::Error::Format`] naming the file, the image or camera and the value, for: bytes that are cut off, a count
/// that the bytes cannot hold, a model other than `PINHOLE` and `SIMPLE_PINHOLE`, an image whose camera is missing, and
/// numbers that are not a pose. [`lexisplat::Error::Limit`] for more than [`crate::MAX_CAMERAS`] cameras.
pub fn read_colmap_binary(name: &str, cameras: &[u8], images: &[u8]) -> Result<ViewSet> {
    let file = |file, bytes| ViewFile::from_bytes(within(name, file), bytes);
    join(true, file("cameras.bin", cameras), file("images.bin", images))
}

/// Returns the views in the bytes of a `cameras.txt` and an `images.txt`, like [`read_colmap_binary`].
///
/// # Errors
/// As [`read_colmap_binary`]. A text that ends early is an error only if a line is cut.
pub fn read_colmap_text(name: &str, cameras: &[u8], images: &[u8]) -> Result<ViewSet> {
    let file = |file, bytes| ViewFile::from_bytes(within(name, file), bytes);
    join(false, file("cameras.txt", cameras), file("images.txt", images))
}

/// Reads both files, and gives every image its camera.
fn join(is_binary: bool, cameras_file: ViewFile<'_>, images_file: ViewFile<'_>) -> Result<ViewSet> {
    let (cameras_name, images_name) = (cameras_file.name, images_file.name);
    let (cameras, posed, mut warnings): (Cameras, Vec<Posed>, Vec<String>) = if is_binary {
        let cameras = BinaryReader::new(&cameras_name, cameras_file.reader, cameras_file.len);
        let images = BinaryReader::new(&images_name, images_file.reader, images_file.len);
        (binary::cameras(cameras)?, binary::images(images)?, Vec::new())
    } else {
        let cameras = Lines::new(&cameras_name, cameras_file.reader.take(cameras_file.len));
        let images = Lines::new(&images_name, images_file.reader.take(images_file.len));
        let cameras = text::cameras(cameras)?;
        let (posed, warnings) = text::images(images)?;
        (cameras, posed, warnings)
    };
    let mut points = PrincipalPoints::default();
    let mut views = Vec::with_capacity(posed.len());
    for image in posed {
        let about = |problem| Error::format(&images_name, format!("image '{}': {problem}", image.name));
        let intrinsics = cameras.get(&image.camera).ok_or_else(|| {
            about(format!(
                "its camera {} is not in {cameras_name}; the two files do not belong together",
                image.camera
            ))
        })?;
        points.see(intrinsics.centre, intrinsics.width, intrinsics.height);
        views.push(image.camera(intrinsics).map_err(about)?);
    }
    views.sort_by(|a: &(Camera, [f64; 3]), b| a.0.name.cmp(&b.0.name));
    warnings.extend(points.warning());
    Ok(ViewSet::new(views, warnings))
}
