//! Reads `transforms.json`, as written by nerfstudio, instant-ngp and the `NeRF` synthetic scenes.
//!
//! `transform_matrix` is camera to world with the camera's y up and z back (OpenGL), in the frame of the file. Models
//! have this frame if they are trained by tools that use the file unchanged, such as the 3DGS authors' loader
//! (`gaussian-splatting/scene/dataset_readers.py`, `readCamerasFromTransforms`). **nerfstudio is different**: it centres
//! and scales the scene, and `ns-export` leaves the model in that frame. The frame is recorded in
//! `dataparser_transforms.json`, which is not read here. Such a model and its `transforms.json` do not fit together.
//! `applied_transform` is not undone either.
//!
//! Formats: nerfstudio's documentation, "Data conventions"; `nerfstudio_dataparser.py`.

mod file;
#[cfg(test)]
mod tests;

use std::collections::HashSet;

use crate::camera::{Camera, Split};
use crate::cameras_json::{MAX_NAME, whole};
use crate::error::{Error, Result};
use crate::view_files::ViewFiles;
use crate::view_set::{PrincipalPoints, SizeOf, ViewSet};
use file::{Frame, Lens, Transforms};

/// Files of a `NeRF` synthetic folder, each with its split. As in the 3DGS authors' loader, `transforms_val.json`
/// is not used.
const NERF_FILES: [(&str, Split); 2] =
    [("transforms_train.json", Split::Train), ("transforms_test.json", Split::Test)];
/// Largest difference of the last row of a matrix from (0, 0, 0, 1), in each entry.
const LAST_ROW_TOLERANCE: f64 = 1e-6;

/// Advice for a lens that the rasteriser cannot draw.
const UNDISTORT: &str = "only pinhole cameras can be drawn from; undistort the photos (`colmap image_undistorter`) and use the cameras of that";

/// Returns whether `files` are those of a `NeRF` synthetic folder.
pub(crate) fn is_nerf<F: ViewFiles + ?Sized>(files: &F) -> bool {
    files.has(NERF_FILES[0].0)
}

/// Reads `transforms_train.json` and, if it exists, `transforms_test.json` of a `NeRF` synthetic folder. Every camera is
/// marked with its split. These files state no size of pictures, so `size_of` must know it.
///
/// # Errors
/// [`lexisplat::Error::Io`] if a file cannot be read; otherwise as [`read_transforms_bytes`].
pub(crate) fn read_nerf_files<F: ViewFiles + ?Sized>(files: &F, size_of: SizeOf<'_>) -> Result<ViewSet> {
    let mut all = ViewSet::default();
    for (index, (file, split)) in NERF_FILES.into_iter().enumerate() {
        if index > 0 && !files.has(file) {
            continue;
        }
        let (name, bytes) = files.open(file)?.read_limited()?;
        let set = read_transforms_bytes(&name, &bytes, size_of)?;
        all.positions.extend(set.positions);
        all.cameras.extend(set.cameras.into_iter().map(|camera| Camera { split: Some(split), ..camera }));
        all.warnings.extend(set.warnings.into_iter().map(|warning| format!("{file}: {warning}")));
    }
    Ok(all)
}

/// Returns the cameras in `bytes`, in order. Their names are their `file_path` as written. Errors call the bytes `file`.
///
/// Focal lengths are `fl_x` and `fl_y`, or follow from `camera_angle_x` and `camera_angle_y`. Focal lengths of a frame take
/// precedence over those of the file. If only x has a focal length, it holds for both axes. If `w` or `h` is missing,
/// `size_of` is asked with the `file_path`. The principal point is ignored, see [`ViewSet::warnings`]. `train_filenames`
/// and `test_filenames` set the split. If there are no `test_filenames`, `val_filenames` count as test, as in
/// nerfstudio's own evaluation.
///
/// # Errors
/// [`lexisplat::Error::Format`] naming the frame and the field, if the text is no such object, a value is out of range, a
/// size is not known, the lens is not a pinhole's, or the bytes or the frames are over [`crate::MAX_CAMERAS_BYTES`] or
/// [`crate::MAX_CAMERAS`].
pub fn read_transforms_bytes(file: &str, bytes: &[u8], size_of: SizeOf<'_>) -> Result<ViewSet> {
    let transforms = Transforms::parse(bytes).map_err(|problem| Error::format(file, problem))?;
    let splits = Splits::new(&transforms).map_err(|problem| Error::format(file, problem))?;
    let mut points = PrincipalPoints::default();
    let mut cameras = Vec::with_capacity(transforms.frames.len());
    for (index, frame) in transforms.frames.iter().enumerate() {
        let split = splits.of(&frame.path);
        let camera = camera(frame, &transforms.lens, split, size_of, &mut points);
        let about = |problem| Error::format(file, format!("frame {index} ('{}'): {problem}", frame.path));
        cameras.push(camera.map_err(about)?);
    }
    let mut warnings = splits.warnings(&transforms.frames);
    warnings.extend(points.warning());
    Ok(ViewSet::new(cameras, warnings))
}

fn camera(
    frame: &Frame,
    global: &Lens,
    split: Option<Split>,
    size_of: SizeOf<'_>,
    points: &mut PrincipalPoints,
) -> Result<(Camera, [f64; 3]), String> {
    if frame.path.len() > MAX_NAME {
        return Err(format!("field 'file_path' is over the limit of {MAX_NAME} bytes"));
    }
    for lens in [&frame.lens, global] {
        if let Some(problem) = lens.distortion() {
            return Err(format!("{problem}; {UNDISTORT}"));
        }
    }
    let side = |name: &str, own: Option<f64>, all: Option<f64>| match own.or(all) {
        None => Ok(None),
        Some(value) => match whole(value) {
            Some(side) => Ok(Some(side)),
            None => Err(format!("field '{name}' is {value}, not a whole number of pixels")),
        },
    };
    let stated = (side("w", frame.lens.w, global.w)?, side("h", frame.lens.h, global.h)?);
    let (width, height) = match stated {
        (Some(width), Some(height)) => (width, height),
        _ => size_of(&frame.path).ok_or(
            "the file has no 'w' and 'h', and the photo that would tell the size is not known; name the folder of the photos",
        )?,
    };
    let (along_x, along_y) = (frame.lens.focal(0, width)?, frame.lens.focal(1, height)?);
    let (all_x, all_y) = (global.focal(0, width)?, global.focal(1, height)?);
    let fx = along_x
        .or(all_x)
        .ok_or("neither 'fl_x' nor 'camera_angle_x' is there, so its focal length is not known")?;
    // A frame's own focal length is not combined with the file's focal length for the other axis.
    let fy = along_y.or(if along_x.is_some() { None } else { all_y }).unwrap_or(fx);
    let [right, up, back, position] = frame.columns()?;
    let rotation = std::array::from_fn(|row| [right[row], -up[row], -back[row]]);
    let camera = Camera::rounded(frame.path.clone(), [width, height], [fx, fy], position, rotation);
    let camera = Camera { split, ..camera };
    camera.validate().map_err(|e| e.to_string())?;
    let centre = [(frame.lens.cx.or(global.cx), width), (frame.lens.cy.or(global.cy), height)];
    points.see(centre.map(|(at, side)| at.unwrap_or(f64::from(side) / 2.0)), width, height);
    Ok((camera, position))
}

impl Frame {
    /// Returns the columns of the matrix: right, up, back and position.
    fn columns(&self) -> Result<[[f64; 3]; 4], String> {
        if let [_, _, _, last] = self.matrix.as_slice() {
            let off = last.iter().zip([0.0, 0.0, 0.0, 1.0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if off > LAST_ROW_TOLERANCE {
                return Err(format!("field 'transform_matrix' ends in {last:?}, expected [0, 0, 0, 1]"));
            }
        }
        let [x, y, z, ..] = self.matrix.as_slice() else {
            let rows = self.matrix.len();
            return Err(format!("field 'transform_matrix' has {rows} rows, expected 4"));
        };
        Ok(std::array::from_fn(|column| [x[column], y[column], z[column]]))
    }
}

/// The names of the frames of each split, if the file lists them.
struct Splits<'a> {
    train: HashSet<&'a str>,
    test: HashSet<&'a str>,
}

impl<'a> Splits<'a> {
    fn new(transforms: &'a Transforms) -> Result<Self, String> {
        let set = |names: &'a [String]| names.iter().map(|name| plain(name)).collect::<HashSet<_>>();
        let held = transforms.test.as_ref().or(transforms.val.as_ref());
        let train = set(transforms.train.as_deref().unwrap_or_default());
        let test = set(held.map_or(&[], Vec::as_slice));
        match train.intersection(&test).min() {
            Some(both) => Err(format!("'{both}' is listed for training and for testing")),
            None => Ok(Self { train, test }),
        }
    }

    fn of(&self, path: &str) -> Option<Split> {
        let path = plain(path);
        let train = self.train.contains(path).then_some(Split::Train);
        train.or_else(|| self.test.contains(path).then_some(Split::Test))
    }

    fn warnings(&self, frames: &[Frame]) -> Vec<String> {
        let frames: HashSet<&str> = frames.iter().map(|frame| plain(&frame.path)).collect();
        let lost = |names: &HashSet<&'a str>| names.iter().filter(|name| !frames.contains(*name)).count();
        [("train", lost(&self.train)), ("test", lost(&self.test))]
            .into_iter()
            .filter(|(_, lost)| *lost > 0)
            .map(|(split, lost)| {
                format!("{lost} of the names listed for the {split} split belong to no frame")
            })
            .collect()
    }
}

/// Returns a path without the `./` that some writers put before it.
fn plain(path: &str) -> &str {
    path.strip_prefix("./").unwrap_or(path)
}
