//! The fields of a `transforms.json` that are used, in the form of the file.

use serde::de::MapAccess;

use crate::cameras_json::MAX_CAMERAS;
use crate::error::Result;
use crate::json::{self, Fields, List, Object, Short, required, set};

/// Largest number of rows of a matrix.
const MAX_ROWS: usize = 4;
/// Largest number of entries of a list of distortion parameters. No model of `OpenCV` has more.
const MAX_DISTORTION: usize = 14;
/// Camera models that are pinhole cameras if no distortion is given.
const PINHOLES: [&str; 3] = ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV"];
/// Names of the fields of distortion, in the order of [`Lens::bent`].
const BENT: [&str; 8] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];

/// Statements of a frame, or of the file for all frames, about the lens. Lengths are in pixels, angles in radians.
#[derive(Debug, Default)]
pub(super) struct Lens {
    model: Option<String>,
    fisheye: Option<bool>,
    fl: [Option<f64>; 2],
    angle: [Option<f64>; 2],
    pub(super) w: Option<f64>,
    pub(super) h: Option<f64>,
    pub(super) cx: Option<f64>,
    pub(super) cy: Option<f64>,
    bent: [Option<f64>; BENT.len()],
    distortion: Option<Short<f64, MAX_DISTORTION>>,
}

impl Lens {
    /// Reads the value of `key` if it is a field of a lens. Returns whether it is.
    fn read<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<bool, A::Error> {
        match key {
            "camera_model" => set(&mut self.model, map),
            "is_fisheye" => set(&mut self.fisheye, map),
            "distortion_params" => set(&mut self.distortion, map),
            "fl_x" => set(&mut self.fl[0], map),
            "fl_y" => set(&mut self.fl[1], map),
            "camera_angle_x" => set(&mut self.angle[0], map),
            "camera_angle_y" => set(&mut self.angle[1], map),
            "w" => set(&mut self.w, map),
            "h" => set(&mut self.h, map),
            "cx" => set(&mut self.cx, map),
            "cy" => set(&mut self.cy, map),
            _ => match BENT.iter().position(|name| *name == key) {
                Some(at) => set(&mut self.bent[at], map),
                None => Ok(false),
            },
        }
    }

    /// Returns the reason why the lens is not a pinhole; `None` if it is one.
    pub(super) fn distortion(&self) -> Option<String> {
        if let Some(model) = self.model.as_deref().filter(|model| !PINHOLES.contains(model)) {
            return Some(format!("camera_model {model} is not supported"));
        }
        if self.fisheye == Some(true) {
            return Some("fisheye lenses are not supported".into());
        }
        let bent = self.bent.iter().zip(BENT).find(|(value, _)| value.is_some_and(|v| v != 0.0));
        if let Some((Some(value), name)) = bent {
            let model = self.model.as_deref().unwrap_or("OPENCV");
            return Some(format!("camera_model {model} with distortion ({name} = {value}) is not supported"));
        }
        let listed = self.distortion.as_ref().is_some_and(|list| list.0.iter().any(|v| *v != 0.0));
        listed.then(|| "distortion (distortion_params) is not supported".into())
    }

    /// Returns the focal length along x (`axis` 0) or y (`axis` 1), for pictures of `side` pixels along this axis.
    pub(super) fn focal(&self, axis: usize, side: u32) -> Result<Option<f64>, String> {
        if self.fl[axis].is_some() {
            return Ok(self.fl[axis]);
        }
        let Some(angle) = self.angle[axis] else { return Ok(None) };
        if !(angle > 0.0 && angle < std::f64::consts::PI) {
            let name = ["camera_angle_x", "camera_angle_y"][axis];
            return Err(format!("field '{name}' is {angle}, expected radians between 0 and pi"));
        }
        Ok(Some(f64::from(side) / 2.0 / libm::tan(angle / 2.0)))
    }
}

/// A frame of the file: one photo.
#[derive(Debug)]
pub(super) struct Frame {
    pub(super) path: String,
    /// Rows of the camera-to-world matrix.
    pub(super) matrix: Vec<[f64; 4]>,
    pub(super) lens: Lens,
}

/// The contents of the file.
#[derive(Debug)]
pub(super) struct Transforms {
    pub(super) lens: Lens,
    pub(super) frames: Vec<Frame>,
    pub(super) train: Option<Vec<String>>,
    pub(super) val: Option<Vec<String>>,
    pub(super) test: Option<Vec<String>>,
}

impl Transforms {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, String> {
        let expected = "an object with 'frames' as a transforms.json has it".to_owned();
        json::parse(bytes, Object { about: String::new(), expected, fields: TransformsFields::default() })
    }
}

#[derive(Default)]
struct TransformsFields {
    lens: Lens,
    frames: Option<Vec<Frame>>,
    train: Option<Short<String, MAX_CAMERAS>>,
    val: Option<Short<String, MAX_CAMERAS>>,
    test: Option<Short<String, MAX_CAMERAS>>,
}

impl Fields for TransformsFields {
    type Value = Transforms;

    fn read<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<bool, A::Error> {
        match key {
            "frames" => {
                self.frames = Some(map.next_value_seed(List {
                    expected: "a list of frames".to_owned(),
                    most: MAX_CAMERAS,
                    what: "frames",
                    element: |index| Object::<FrameFields>::element("frame", index),
                })?);
                Ok(true)
            }
            "train_filenames" => set(&mut self.train, map),
            "val_filenames" => set(&mut self.val, map),
            "test_filenames" => set(&mut self.test, map),
            _ => self.lens.read(key, map),
        }
    }

    fn finish(self, _: &str) -> Result<Transforms, String> {
        let frames = self.frames.ok_or("field 'frames' is missing, so this is not a transforms.json")?;
        let [train, val, test] = [self.train, self.val, self.test].map(|names| names.map(|list| list.0));
        Ok(Transforms { lens: self.lens, frames, train, val, test })
    }
}

#[derive(Default)]
struct FrameFields {
    path: Option<String>,
    matrix: Option<Short<[f64; 4], MAX_ROWS>>,
    lens: Lens,
}

impl Fields for FrameFields {
    type Value = Frame;

    fn read<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<bool, A::Error> {
        match key {
            "file_path" => set(self.path.get_or_insert_default(), map),
            "transform_matrix" => set(self.matrix.get_or_insert_default(), map),
            _ => self.lens.read(key, map),
        }
    }

    fn finish(self, about: &str) -> Result<Frame, String> {
        Ok(Frame {
            path: required(self.path, "file_path", about)?,
            matrix: required(self.matrix, "transform_matrix", about)?.0,
            lens: self.lens,
        })
    }
}
