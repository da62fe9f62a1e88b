//! The fields of a `transforms.json` that are used, as they are written.

use std::fmt;

use serde::de::{
    Deserialize, DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor,
};

use crate::cameras_json::MAX_CAMERAS;
use crate::error::Result;
use crate::view_files::MAX_CAMERAS_BYTES;

/// Most rows of a matrix.
const MAX_ROWS: usize = 4;
/// Most entries of a list of distortion parameters. `OpenCV` has no model with more.
const MAX_DISTORTION: usize = 14;
/// Camera models that are a pinhole where no distortion is given.
const PINHOLES: [&str; 3] = ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV"];
/// Names of the fields of distortion, in the order of [`Lens::bent`].
const BENT: [&str; 8] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];

/// What a frame, or the file for all frames, says about the lens. Lengths are in pixels, angles in radians.
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
    distortion: Option<List<f64, MAX_DISTORTION>>,
}

impl Lens {
    /// Reads the value of `key` if that is a field of a lens. Returns whether it is.
    fn read<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<bool, A::Error> {
        let slot = match key {
            "camera_model" => return map.next_value().map(|v| self.model = v).map(|()| true),
            "is_fisheye" => return map.next_value().map(|v| self.fisheye = v).map(|()| true),
            "distortion_params" => return map.next_value().map(|v| self.distortion = v).map(|()| true),
            "fl_x" => &mut self.fl[0],
            "fl_y" => &mut self.fl[1],
            "camera_angle_x" => &mut self.angle[0],
            "camera_angle_y" => &mut self.angle[1],
            "w" => &mut self.w,
            "h" => &mut self.h,
            "cx" => &mut self.cx,
            "cy" => &mut self.cy,
            _ => match BENT.iter().position(|name| *name == key) {
                Some(at) => &mut self.bent[at],
                None => return Ok(false),
            },
        };
        *slot = map.next_value()?;
        Ok(true)
    }

    /// Returns why this is not a pinhole; `None` if it is one.
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

    /// Focal length along x for pictures `width` pixels wide.
    pub(super) fn focal_x(&self, width: u32) -> Result<Option<f64>, String> {
        self.focal(0, width)
    }

    /// Focal length along y for pictures `height` pixels high.
    pub(super) fn focal_y(&self, height: u32) -> Result<Option<f64>, String> {
        self.focal(1, height)
    }

    fn focal(&self, axis: usize, side: u32) -> Result<Option<f64>, String> {
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

/// One photo.
#[derive(Debug)]
pub(super) struct Frame {
    pub(super) path: String,
    /// Rows of the camera-to-world matrix.
    pub(super) matrix: Vec<[f64; 4]>,
    pub(super) lens: Lens,
}

/// The file.
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
        if u64::try_from(bytes.len()).is_ok_and(|len| len > MAX_CAMERAS_BYTES) {
            return Err(format!("over the limit of {MAX_CAMERAS_BYTES} bytes"));
        }
        let mut json = serde_json::Deserializer::from_slice(bytes);
        let transforms = json.deserialize_map(TransformsVisitor).map_err(|e| e.to_string())?;
        json.end().map_err(|e| e.to_string())?;
        Ok(transforms)
    }
}

struct TransformsVisitor;

impl<'de> Visitor<'de> for TransformsVisitor {
    type Value = Transforms;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with 'frames' as a transforms.json has it")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Transforms, A::Error> {
        type Names = Option<List<String, MAX_CAMERAS>>;
        let mut lens = Lens::default();
        let mut frames: Option<Vec<Frame>> = None;
        let [mut train, mut val, mut test]: [Names; 3] = [None, None, None];
        while let Some(key) = map.next_key::<String>()? {
            let read = match key.as_str() {
                "frames" => map.next_value_seed(Frames).map(|v| frames = Some(v)),
                "train_filenames" => map.next_value().map(|v| train = v),
                "val_filenames" => map.next_value().map(|v| val = v),
                "test_filenames" => map.next_value().map(|v| test = v),
                _ => match lens.read(&key, &mut map) {
                    Ok(true) => Ok(()),
                    Ok(false) => map.next_value::<IgnoredAny>().map(|_| ()),
                    Err(e) => Err(e),
                },
            };
            read.map_err(|e| A::Error::custom(format!("field '{key}': {e}")))?;
        }
        let frames = frames
            .ok_or_else(|| A::Error::custom("field 'frames' is missing, so this is not a transforms.json"))?;
        let [train, val, test] = [train, val, test].map(|names| names.map(|list| list.0));
        Ok(Transforms { lens, frames, train, val, test })
    }
}

/// Reads the list of frames.
struct Frames;

impl<'de> DeserializeSeed<'de> for Frames {
    type Value = Vec<Frame>;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<Vec<Frame>, D::Error> {
        json.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Frames {
    type Value = Vec<Frame>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of frames")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<Frame>, A::Error> {
        let mut frames = Vec::new();
        while let Some(frame) = list.next_element_seed(FrameAt(frames.len()))? {
            if frames.len() == MAX_CAMERAS {
                return Err(A::Error::custom(format!("over the limit of {MAX_CAMERAS} frames")));
            }
            frames.push(frame);
        }
        Ok(frames)
    }
}

/// Reads the frame at this position of the list.
struct FrameAt(usize);

impl<'de> DeserializeSeed<'de> for FrameAt {
    type Value = Frame;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<Frame, D::Error> {
        json.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for FrameAt {
    type Value = Frame;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "frame {} as an object", self.0)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Frame, A::Error> {
        let index = self.0;
        let mut lens = Lens::default();
        let mut path: Option<String> = None;
        let mut matrix: Option<List<[f64; 4], MAX_ROWS>> = None;
        while let Some(key) = map.next_key::<String>()? {
            let read = match key.as_str() {
                "file_path" => map.next_value().map(|v| path = Some(v)),
                "transform_matrix" => map.next_value().map(|v| matrix = Some(v)),
                _ => match lens.read(&key, &mut map) {
                    Ok(true) => Ok(()),
                    Ok(false) => map.next_value::<IgnoredAny>().map(|_| ()),
                    Err(e) => Err(e),
                },
            };
            read.map_err(|e| A::Error::custom(format!("frame {index}: field '{key}': {e}")))?;
        }
        let missing = |field: &str| A::Error::custom(format!("frame {index}: field '{field}' is missing"));
        Ok(Frame {
            path: path.ok_or_else(|| missing("file_path"))?,
            matrix: matrix.ok_or_else(|| missing("transform_matrix"))?.0,
            lens,
        })
    }
}

/// A list of at most `N` values. A longer one is refused while it is read.
#[derive(Debug)]
struct List<T, const N: usize>(Vec<T>);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for List<T, N> {
    fn deserialize<D: Deserializer<'de>>(json: D) -> Result<Self, D::Error> {
        struct ListVisitor<T, const N: usize>(std::marker::PhantomData<T>);

        impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for ListVisitor<T, N> {
            type Value = List<T, N>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of at most {N}")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut values = Vec::new();
                while let Some(value) = list.next_element()? {
                    if values.len() == N {
                        return Err(A::Error::custom(format!("over the limit of {N} entries")));
                    }
                    values.push(value);
                }
                Ok(List(values))
            }
        }
        json.deserialize_seq(ListVisitor(std::marker::PhantomData))
    }
}
