//! Reads INRIA's `cameras.json`: a list of objects with `img_name`, `width`, `height`, `position`,
//! `rotation`, `fx` and `fy` (`gaussian-splatting/utils/camera_utils.py`, `camera_to_JSON`). A field
//! `split` of `"train"` or `"test"` is this project's addition; other fields are ignored.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::camera::{Camera, Split};
use crate::error::{Error, Result};
use crate::orbit::single;
use crate::view_files::MAX_CAMERAS_BYTES;

/// Most cameras in a file.
pub const MAX_CAMERAS: usize = 100_000;
/// Longest name of a camera, in bytes.
pub(crate) const MAX_NAME: usize = 1024;

/// Returns the cameras in `bytes`, in order. `file` names them in errors.
///
/// # Errors
/// [`Error::Format`] naming the camera, by its position from 0, and the field, if the text is not such
/// a list, a value is out of range, or it is over [`MAX_CAMERAS_BYTES`] or [`MAX_CAMERAS`].
pub fn read_cameras_bytes(file: &str, bytes: &[u8]) -> Result<Vec<Camera>> {
    if u64::try_from(bytes.len()).is_ok_and(|len| len > MAX_CAMERAS_BYTES) {
        return Err(Error::format(file, format!("over the limit of {MAX_CAMERAS_BYTES} bytes")));
    }
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let cameras = json.deserialize_seq(CameraList).map_err(|e| Error::format(file, e.to_string()))?;
    json.end().map_err(|e| Error::format(file, e.to_string()))?;
    Ok(cameras)
}

struct CameraList;

impl<'de> Visitor<'de> for CameraList {
    type Value = Vec<Camera>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of cameras as INRIA's cameras.json")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut cameras = Vec::new();
        while let Some(camera) = list.next_element_seed(CameraAt(cameras.len()))? {
            if cameras.len() == MAX_CAMERAS {
                return Err(A::Error::custom(format!("over the limit of {MAX_CAMERAS} cameras")));
            }
            cameras.push(camera);
        }
        Ok(cameras)
    }
}

/// The camera at a position of the list.
struct CameraAt(usize);

impl<'de> DeserializeSeed<'de> for CameraAt {
    type Value = Camera;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<Camera, D::Error> {
        json.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for CameraAt {
    type Value = Camera;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "camera {} as an object", self.0)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Camera, A::Error> {
        let index = self.0;
        let mut name: Option<String> = None;
        let (mut width, mut height): (Option<f64>, Option<f64>) = (None, None);
        let (mut fx, mut fy): (Option<f64>, Option<f64>) = (None, None);
        let mut position: Option<[f64; 3]> = None;
        let mut rotation: Option<[[f64; 3]; 3]> = None;
        let mut split: Option<Option<String>> = None;
        while let Some(key) = map.next_key::<String>()? {
            let read = match key.as_str() {
                "img_name" => map.next_value().map(|v| name = Some(v)),
                "width" => map.next_value().map(|v| width = Some(v)),
                "height" => map.next_value().map(|v| height = Some(v)),
                "fx" => map.next_value().map(|v| fx = Some(v)),
                "fy" => map.next_value().map(|v| fy = Some(v)),
                "position" => map.next_value().map(|v| position = Some(v)),
                "rotation" => map.next_value().map(|v| rotation = Some(v)),
                "split" => map.next_value().map(|v| split = Some(v)),
                _ => map.next_value::<IgnoredAny>().map(|_| ()),
            };
            read.map_err(|e| A::Error::custom(format!("camera {index}: field '{key}': {e}")))?;
        }
        let missing = |field: &str| A::Error::custom(format!("camera {index}: field '{field}' is missing"));
        let name = name.ok_or_else(|| missing("img_name"))?;
        if name.len() > MAX_NAME {
            let text = format!("camera {index}: field 'img_name' is over the limit of {MAX_NAME} bytes");
            return Err(A::Error::custom(text));
        }
        let side = |field: &str, value: Option<f64>| {
            let value = value.ok_or_else(|| missing(field))?;
            whole(value).ok_or_else(|| {
                let text =
                    format!("camera {index}: field '{field}' is {value}, not a whole number of pixels");
                A::Error::custom(text)
            })
        };
        let split = match split.flatten().as_deref() {
            None => None,
            Some("train") => Some(Split::Train),
            Some("test") => Some(Split::Test),
            Some(other) => {
                let text = format!("camera {index}: field 'split' is '{other}', expected 'train' or 'test'");
                return Err(A::Error::custom(text));
            }
        };
        let camera = Camera {
            width: side("width", width)?,
            height: side("height", height)?,
            fx: single(fx.ok_or_else(|| missing("fx"))?),
            fy: single(fy.ok_or_else(|| missing("fy"))?),
            position: position.ok_or_else(|| missing("position"))?.map(single),
            rotation: rotation.ok_or_else(|| missing("rotation"))?.map(|row| row.map(single)),
            name,
            split,
        };
        camera
            .validate()
            .map_err(|e| A::Error::custom(format!("camera {index} ('{}'): {e}", camera.name)))?;
        Ok(camera)
    }
}

/// Returns `value` as a whole number, if it is one. Some writers print `400.0`.
pub(crate) fn whole(value: f64) -> Option<u32> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "compared with the original")]
    let integer = value as u32;
    (f64::from(integer) == value).then_some(integer)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"{"id": 0, "img_name": "a.JPG", "width": 400, "height": 266.0,
        "position": [1, 2.5, -3], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fy": 410, "fx": 411.5,
        "extra": {"any": [1, null]}}"#;

    fn parse(text: &str) -> Result<Vec<Camera>> {
        read_cameras_bytes("cameras.json", text.as_bytes())
    }

    #[test]
    fn reads_what_inria_writes() {
        let test = GOOD.replace("\"id\": 0", "\"split\": \"test\"");
        let cameras = parse(&format!("[{GOOD}, {test}]")).unwrap();
        assert_eq!(cameras.len(), 2);
        let camera = &cameras[0];
        assert_eq!((camera.name.as_str(), camera.width, camera.height), ("a.JPG", 400, 266));
        assert_eq!((camera.fx, camera.fy, camera.position), (411.5, 410.0, [1.0, 2.5, -3.0]));
        assert_eq!((camera.split, cameras[1].split), (None, Some(Split::Test)));
        assert!(parse("[]").unwrap().is_empty());
    }

    #[test]
    fn errors_name_the_camera_and_the_field() {
        let cases = [
            ("\"width\": 400", "\"width\": 0", "width"),
            ("\"width\": 400", "\"width\": 400.5", "width"),
            ("\"width\": 400", "\"width\": -4", "width"),
            ("\"width\": 400", "\"width\": \"wide\"", "width"),
            ("\"width\": 400,", "", "width"),
            ("\"height\": 266.0", "\"height\": 99999", "height"),
            ("\"fx\": 411.5", "\"fx\": -1", "fx"),
            ("\"fx\": 411.5", "\"fx\": 1e300", "fx"),
            ("\"fy\": 410", "\"fy\": null", "fy"),
            ("[1, 2.5, -3]", "[1, 2.5]", "position"),
            ("[1, 2.5, -3]", "[1, 2.5, 1e39]", "position"),
            ("[[1, 0, 0]", "[[1.2, 0, 0]", "rotation"),
            ("[[1, 0, 0]", "[[1, 0, 0, 0]", "rotation"),
            ("\"id\": 0", "\"split\": \"both\"", "split"),
            ("\"img_name\": \"a.JPG\",", "", "img_name"),
        ];
        for (from, to, field) in cases {
            let bad = GOOD.replace(from, to);
            assert_ne!(bad, GOOD, "{from}");
            let message = parse(&format!("[{GOOD}, {bad}]")).unwrap_err().to_string();
            assert!(message.starts_with("cameras.json: camera 1"), "{message}");
            assert!(message.contains(field), "{message}");
        }
    }

    #[test]
    fn other_texts_are_refused() {
        for text in ["", "{}", "[1]", "[", "[] x", "[{]"] {
            assert!(matches!(parse(text), Err(Error::Format { .. })), "{text}");
        }
        let missing = crate::read_cameras("no/such/cameras.json").unwrap_err();
        assert!(matches!(missing, Error::Io { .. }));
        assert!(missing.to_string().starts_with("no/such/cameras.json"));
    }

    #[test]
    fn every_truncation_is_an_error() {
        let text = format!("[{GOOD}]");
        for end in 0..text.len() {
            assert!(parse(&text[..end]).is_err(), "{end}");
        }
    }
}
