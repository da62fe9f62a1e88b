//! Reads INRIA's `cameras.json`: a list of objects with `img_name`, `width`, `height`, `position`,
//! `rotation`, `fx` and `fy` (`gaussian-splatting/utils/camera_utils.py`, `camera_to_JSON`). A field
//! `split` of `"train"` or `"test"` is this project's addition; other fields are ignored.

use serde::de::MapAccess;

use crate::camera::{Camera, Split};
use crate::error::{Error, Result};
use crate::json::{self, Fields, List, Object, required, set};

/// Largest number of cameras in a file.
pub const MAX_CAMERAS: usize = 100_000;
/// Largest length of a camera's name, in bytes.
pub(crate) const MAX_NAME: usize = 1024;

/// Returns the cameras in `bytes`, in order. Errors call the bytes `file`.
///
/// # Errors
/// [`lexisplat::Error::Format`] naming the camera, by its position from 0, and the field, if the text is not such a list,
/// or if a value is out of range, or if the bytes or the list are over [`crate::MAX_CAMERAS_BYTES`] or [`MAX_CAMERAS`].
pub fn read_cameras_bytes(file: &str, bytes: &[u8]) -> Result<Vec<Camera>> {
    Ok(read_placed(file, bytes)?.into_iter().map(|placed| placed.0).collect())
}

/// Reads cameras like [`read_cameras_bytes`], and returns each with its position before rounding.
pub(crate) fn read_placed(file: &str, bytes: &[u8]) -> Result<Vec<(Camera, [f64; 3])>> {
    let list = List {
        expected: "a list of cameras as INRIA's cameras.json".to_owned(),
        most: MAX_CAMERAS,
        what: "cameras",
        element: |index| Object::<CameraFields>::element("camera", index),
    };
    json::parse(bytes, list).map_err(|problem| Error::format(file, problem))
}

#[derive(Default)]
struct CameraFields {
    name: Option<String>,
    width: Option<f64>,
    height: Option<f64>,
    fx: Option<f64>,
    fy: Option<f64>,
    position: Option<[f64; 3]>,
    rotation: Option<[[f64; 3]; 3]>,
    split: Option<String>,
}

impl Fields for CameraFields {
    type Value = (Camera, [f64; 3]);

    fn read<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<bool, A::Error> {
        match key {
            "img_name" => set(self.name.get_or_insert_default(), map),
            "width" => set(self.width.get_or_insert_default(), map),
            "height" => set(self.height.get_or_insert_default(), map),
            "fx" => set(self.fx.get_or_insert_default(), map),
            "fy" => set(self.fy.get_or_insert_default(), map),
            "position" => set(self.position.get_or_insert_default(), map),
            "rotation" => set(self.rotation.get_or_insert_default(), map),
            "split" => set(&mut self.split, map),
            _ => Ok(false),
        }
    }

    fn finish(self, about: &str) -> Result<(Camera, [f64; 3]), String> {
        let name = required(self.name, "img_name", about)?;
        if name.len() > MAX_NAME {
            return Err(format!("{about}field 'img_name' is over the limit of {MAX_NAME} bytes"));
        }
        let side = |field: &str, value: Option<f64>| {
            let value = required(value, field, about)?;
            whole(value)
                .ok_or_else(|| format!("{about}field '{field}' is {value}, not a whole number of pixels"))
        };
        let split = match self.split.as_deref() {
            None => None,
            Some("train") => Some(Split::Train),
            Some("test") => Some(Split::Test),
            Some(other) => {
                return Err(format!("{about}field 'split' is '{other}', expected 'train' or 'test'"));
            }
        };
        let size = [side("width", self.width)?, side("height", self.height)?];
        let focal = [required(self.fx, "fx", about)?, required(self.fy, "fy", about)?];
        let position = required(self.position, "position", about)?;
        let rotation = required(self.rotation, "rotation", about)?;
        let camera = Camera { split, ..Camera::rounded(name, size, focal, position, rotation) };
        let index = about.trim_end_matches(": ");
        camera.validate().map_err(|e| format!("{index} ('{}'): {e}", camera.name))?;
        Ok((camera, position))
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
            assert!(matches!(parse(text), Err(Error::Codec(lexisplat::Error::Format { .. }))), "{text}");
        }
        let missing = crate::read_cameras("no/such/cameras.json").unwrap_err();
        assert!(matches!(missing, Error::Codec(lexisplat::Error::Io { .. })));
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
