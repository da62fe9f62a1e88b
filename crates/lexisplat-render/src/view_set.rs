//! Cameras of any kind of source, told apart by content.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

use crate::camera::Camera;
use crate::cameras_json::{MAX_CAMERAS_BYTES, read_cameras_bytes};
use crate::colmap::{self, read_colmap};
use crate::error::{Error, Result};
use crate::transforms::{self, read_nerf, read_transforms_bytes};

/// A principal point farther than this from the picture's centre, in pixels on either axis, is worth a
/// warning: as much as rounding a picture's size moves it.
const CENTRE_SLACK: f64 = 0.5;
/// Files of a COLMAP model; any of them stands for its folder.
const COLMAP_FILES: [&str; 4] = ["cameras.bin", "images.bin", "cameras.txt", "images.txt"];
/// Names of a file of cameras in a folder, looked for in this order.
const FILES: [&str; 2] = ["transforms.json", "cameras.json"];

/// Cameras and what is odd about their source.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ViewSet {
    /// The cameras; every one passes [`Camera::validate`].
    pub cameras: Vec<Camera>,
    /// What was ignored or looks wrong, one sentence each.
    pub warnings: Vec<String>,
}

/// Width and height, in pixels, of the photo that a source names, for sources that do not say; `None`
/// if it is not known.
pub type SizeOf<'a> = &'a mut dyn FnMut(&str) -> Option<(u32, u32)>;

/// Reads the cameras of `path`, whichever kind it is:
///
/// - a file with a JSON list: INRIA's `cameras.json` ([`crate::read_cameras`]);
/// - a file with a JSON object: a `transforms.json` ([`crate::read_transforms_bytes`]);
/// - a folder, or a file of one: the first found of a COLMAP model ([`read_colmap`]),
///   `transforms_train.json` ([`read_nerf`]), `transforms.json` and `cameras.json`.
///
/// `size_of` is asked about photos only where the source does not say how large they are.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Format`] if it is none of these; what the readers say.
pub fn read_views(path: impl AsRef<Path>, size_of: SizeOf<'_>) -> Result<ViewSet> {
    let path = path.as_ref();
    let metadata = fs::metadata(path).map_err(|e| Error::io(path, e))?;
    if metadata.is_dir() {
        return read_folder(path, size_of);
    }
    if path.file_name().is_some_and(|name| COLMAP_FILES.iter().any(|known| name == *known)) {
        let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        return read_colmap(folder.unwrap_or(Path::new(".")));
    }
    let bytes = read_limited(path)?;
    let file = path.display().to_string();
    match bytes.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(b'[') => Ok(ViewSet { cameras: read_cameras_bytes(&file, &bytes)?, warnings: Vec::new() }),
        Some(b'{') => read_transforms_bytes(&file, &bytes, size_of),
        _ => Err(Error::format(
            file,
            "neither a JSON list (cameras.json) nor a JSON object (transforms.json); a COLMAP model is given by its folder",
        )),
    }
}

fn read_folder(folder: &Path, size_of: SizeOf<'_>) -> Result<ViewSet> {
    if colmap::is_there(folder) {
        return read_colmap(folder);
    }
    if transforms::is_nerf(folder) {
        return read_nerf(folder, size_of);
    }
    for name in FILES {
        let path = folder.join(name);
        if path.is_file() {
            return read_views(path, size_of);
        }
    }
    Err(Error::format(
        folder.display().to_string(),
        "no cameras here: looked for a COLMAP model (cameras and images, .bin or .txt, here, in sparse/0, sparse or colmap/sparse/0), transforms_train.json, transforms.json and cameras.json",
    ))
}

/// The bytes of a file, of which one over [`MAX_CAMERAS_BYTES`] is read no further than a byte more.
pub(crate) fn read_limited(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MAX_CAMERAS_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|source| Error::io(path, source))?;
    Ok(bytes)
}

/// Principal points seen, of which those off the centre are told once.
#[derive(Debug, Default)]
pub(crate) struct PrincipalPoints {
    off: usize,
    most: f64,
}

impl PrincipalPoints {
    /// Takes note of the principal point `centre` of a picture of `width * height` pixels.
    pub(crate) fn see(&mut self, centre: [f64; 2], width: u32, height: u32) {
        let [x, y] = centre;
        let (x, y) = ((x - f64::from(width) / 2.0).abs(), (y - f64::from(height) / 2.0).abs());
        let off = x.max(y);
        if off > CENTRE_SLACK {
            self.off += 1;
            self.most = self.most.max(off);
        }
    }

    /// What to say about them.
    pub(crate) fn warning(&self) -> Option<String> {
        (self.off > 0).then(|| {
            let cameras = if self.off == 1 { "camera" } else { "cameras" };
            format!(
                "principal point of {} {cameras} is up to {:.1} pixels off the centre; it is ignored, as the 3DGS authors' loader does",
                self.off, self.most
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_points_are_told_once() {
        let mut points = PrincipalPoints::default();
        points.see([399.5, 266.4], 799, 532);
        assert_eq!(points.warning(), None);
        points.see([387.2, 266.0], 799, 532);
        points.see([400.5, 270.0], 799, 532);
        let warning = points.warning().unwrap();
        assert!(warning.starts_with("principal point of 2 cameras is up to 12.3 pixels"), "{warning}");
    }
}
