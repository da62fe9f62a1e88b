//! Reads COLMAP models: `cameras.bin` and `images.bin`, or the same as text.
//!
//! Only `PINHOLE` and `SIMPLE_PINHOLE` are cameras that the rasteriser can draw from; COLMAP's
//! `image_undistorter` makes such ones. Points are never read. The principal point is ignored as the
//! 3DGS authors' loader does (`gaussian-splatting/scene/dataset_readers.py`, `readColmapCameras`), so
//! that models trained with it are drawn as they were trained; see [`ViewSet::warnings`].
//!
//! Formats: COLMAP's documentation, "Output Format", and `src/colmap/scene/reconstruction_io.cc`.

mod binary;
mod intrinsics;
mod lines;
mod pose;
mod source;
#[cfg(test)]
mod tests;
mod text;

use std::fs::{self, File};
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::view_set::{PrincipalPoints, ViewSet};
use intrinsics::Cameras;
use lines::Lines;
use pose::Posed;
use source::Source;

/// Largest file read, in bytes. `images.bin` holds every keypoint: 24 bytes each, some 10,000 a photo.
pub const MAX_COLMAP_BYTES: u64 = 4 << 30;
/// Where a model may lie in the folder given: itself, COLMAP's own layout, that of INRIA's `convert.py`,
/// nerfstudio's.
const PLACES: [&str; 4] = ["", "sparse/0", "sparse", "colmap/sparse/0"];

/// The two files of a model.
struct Model {
    binary: bool,
    cameras: PathBuf,
    images: PathBuf,
}

/// The model in `folder`: the first place that has one, there the binary one first.
fn find(folder: &Path) -> Option<Model> {
    PLACES.iter().find_map(|place| {
        let place = if place.is_empty() { folder.to_path_buf() } else { folder.join(place) };
        [(true, "bin"), (false, "txt")].into_iter().find_map(|(binary, end)| {
            let [cameras, images] = ["cameras", "images"].map(|name| place.join(format!("{name}.{end}")));
            (cameras.is_file() && images.is_file()).then_some(Model { binary, cameras, images })
        })
    })
}

/// Whether `folder` holds a COLMAP model.
pub(crate) fn is_there(folder: &Path) -> bool {
    find(folder).is_some()
}

/// Reads the COLMAP model of `folder`, or of its `sparse/0`, `sparse` or `colmap/sparse/0`: the binary
/// files if both are there, else the text files. Cameras are in order of their names, which are the
/// photos' names as written, with folders and extension; no split is set.
///
/// # Errors
/// [`Error::Io`] if a file cannot be read; [`Error::Format`] if there is no model or as
/// [`read_colmap_binary`]; [`Error::Limit`] if a file is over [`MAX_COLMAP_BYTES`].
pub fn read_colmap(folder: impl AsRef<Path>) -> Result<ViewSet> {
    let folder = folder.as_ref();
    let Some(model) = find(folder) else {
        fs::metadata(folder).map_err(|e| Error::io(folder, e))?;
        let problem = "no COLMAP model: neither cameras.bin with images.bin nor cameras.txt with images.txt is here or in sparse/0, sparse or colmap/sparse/0";
        return Err(Error::format(folder.display().to_string(), problem));
    };
    let [(cameras, cameras_len, cameras_name), (images, images_len, images_name)] =
        [open(&model.cameras)?, open(&model.images)?];
    if model.binary {
        let cameras = binary::cameras(&mut Source::new(&cameras_name, cameras, cameras_len))?;
        let posed = binary::images(&mut Source::new(&images_name, images, images_len))?;
        join(&cameras_name, &cameras, &images_name, posed, Vec::new())
    } else {
        let cameras = text::cameras(&mut Lines::new(&cameras_name, cameras.take(cameras_len)))?;
        let (posed, warnings) = text::images(&mut Lines::new(&images_name, images.take(images_len)))?;
        join(&cameras_name, &cameras, &images_name, posed, warnings)
    }
}

/// The views of the bytes of a `cameras.bin` and an `images.bin`; `name` stands for their folder in errors.
///
/// # Errors
/// [`Error::Format`] naming the file, the image or camera and the value: what is cut off, a count that
/// the bytes cannot hold, a model other than `PINHOLE` and `SIMPLE_PINHOLE`, an image whose camera is
/// missing, a pose that is none; [`Error::Limit`] if there are over [`crate::MAX_CAMERAS`].
pub fn read_colmap_binary(name: &str, cameras: &[u8], images: &[u8]) -> Result<ViewSet> {
    let [cameras_name, images_name] = ["cameras.bin", "images.bin"].map(|file| within(name, file));
    let cameras = binary::cameras(&mut Source::new(&cameras_name, Cursor::new(cameras), length(cameras)))?;
    let posed = binary::images(&mut Source::new(&images_name, Cursor::new(images), length(images)))?;
    join(&cameras_name, &cameras, &images_name, posed, Vec::new())
}

/// [`read_colmap_binary`] for `cameras.txt` and `images.txt`.
///
/// # Errors
/// As [`read_colmap_binary`]; a text that ends early is an error only where a line is cut.
pub fn read_colmap_text(name: &str, cameras: &[u8], images: &[u8]) -> Result<ViewSet> {
    let [cameras_name, images_name] = ["cameras.txt", "images.txt"].map(|file| within(name, file));
    let cameras = text::cameras(&mut Lines::new(&cameras_name, cameras))?;
    let (posed, warnings) = text::images(&mut Lines::new(&images_name, images))?;
    join(&cameras_name, &cameras, &images_name, posed, warnings)
}

fn length(bytes: &[u8]) -> u64 {
    u64::try_from(bytes.len()).unwrap_or(u64::MAX)
}

fn within(folder: &str, file: &str) -> String {
    Path::new(folder).join(file).display().to_string()
}

/// A file, its length and its name for errors.
fn open(path: &Path) -> Result<(BufReader<File>, u64, String)> {
    let io = |e| Error::io(path, e);
    let file = File::open(path).map_err(io)?;
    let len = file.metadata().map_err(io)?.len();
    let name = path.display().to_string();
    if len > MAX_COLMAP_BYTES {
        return Err(Error::Limit { what: format!("{name}: bytes"), found: len, limit: MAX_COLMAP_BYTES });
    }
    Ok((BufReader::new(file), len, name))
}

/// Every image with its camera, in order of names.
fn join(
    cameras_file: &str,
    cameras: &Cameras,
    images_file: &str,
    posed: Vec<Posed>,
    mut warnings: Vec<String>,
) -> Result<ViewSet> {
    let mut points = PrincipalPoints::default();
    let mut views = Vec::with_capacity(posed.len());
    for image in posed {
        let about = |problem| Error::format(images_file, format!("image '{}': {problem}", image.name));
        let intrinsics = cameras.get(&image.camera).ok_or_else(|| {
            about(format!(
                "its camera {} is not in {cameras_file}; the two files do not belong together",
                image.camera
            ))
        })?;
        points.see(intrinsics.centre, intrinsics.width, intrinsics.height);
        views.push(image.camera(intrinsics).map_err(about)?);
    }
    views.sort_by(|a, b| a.name.cmp(&b.name));
    warnings.extend(points.warning());
    Ok(ViewSet { cameras: views, warnings })
}
