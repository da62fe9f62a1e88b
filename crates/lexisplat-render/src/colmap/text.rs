//! `cameras.txt` and `images.txt`.

use std::io::BufRead;

use super::intrinsics::{Cameras, Intrinsics, Pinhole};
use super::lines::Lines;
use super::pose::Posed;
use crate::cameras_json::{MAX_CAMERAS, MAX_NAME};
use crate::error::Result;

/// Text before the number of images in COLMAP's comment.
const COUNT_MARK: &str = "# Number of images:";
/// Number of words before the name in an image's first line: the number, four of the rotation, three of the translation,
/// and the camera.
const WORDS_BEFORE_NAME: usize = 9;
/// Number of words of a point of an image: x, y, and the number of the 3D point.
const POINT_WORDS: u64 = 3;

pub(super) fn cameras<R: BufRead>(mut lines: Lines<'_, R>) -> Result<Cameras> {
    let mut cameras = Cameras::new();
    while let Some(line) = lines.line()? {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (number, intrinsics) = camera(&line).map_err(|problem| lines.wrong(problem))?;
        if cameras.len() == MAX_CAMERAS {
            return Err(lines.too_many("cameras", MAX_CAMERAS));
        }
        if cameras.insert(number, intrinsics).is_some() {
            return Err(lines.wrong(format!("camera {number}: there are two of this number")));
        }
    }
    Ok(cameras)
}

fn camera(line: &str) -> Result<(u32, Intrinsics), String> {
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let [number, model, width, height, parameters @ ..] = words.as_slice() else {
        return Err("not a camera: expected number, model, width, height and parameters".into());
    };
    let number: u32 = parsed("number of the camera", number)?;
    let intrinsics = || {
        let model = Pinhole::named(model)?;
        let (width, height) = (parsed("width", width)?, parsed("height", height)?);
        let numbers: Vec<f64> =
            parameters.iter().map(|word| parsed("parameter", word)).collect::<Result<_, String>>()?;
        let (focal, centre) = match (model, numbers.as_slice()) {
            (Pinhole::Simple, &[f, cx, cy]) => ([f; 2], [cx, cy]),
            (Pinhole::Two, &[fx, fy, cx, cy]) => ([fx, fy], [cx, cy]),
            (model, other) => {
                let expected = if model == Pinhole::Simple { "f, cx, cy" } else { "fx, fy, cx, cy" };
                return Err(format!("{} parameters, expected {expected}", other.len()));
            }
        };
        Intrinsics::new(width, height, focal, centre)
    };
    Ok((number, intrinsics().map_err(|problem| format!("camera {number}: {problem}"))?))
}

/// Returns the images, and a warning if the file states another number of images.
pub(super) fn images<R: BufRead>(mut lines: Lines<'_, R>) -> Result<(Vec<Posed>, Vec<String>)> {
    let mut images = Vec::new();
    let mut said: Option<u64> = None;
    while let Some(line) = lines.line()? {
        if let Some(rest) = line.strip_prefix(COUNT_MARK) {
            said = rest.trim_start().split(|c: char| !c.is_ascii_digit()).next().and_then(|n| n.parse().ok());
        }
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if images.len() == MAX_CAMERAS {
            return Err(lines.too_many("images", MAX_CAMERAS));
        }
        images.push(image(&line).map_err(|problem| lines.wrong(problem))?);
        // Every image has a second line, which may be empty.
        let words = lines.words_of_next()?;
        if words % POINT_WORDS != 0 {
            return Err(lines.wrong(format!(
                "{words} words, expected the points of the image above, three words each, or an empty line"
            )));
        }
    }
    let found = images.len() as u64;
    let warning = said.filter(|said| *said != found);
    let warnings =
        warning.map(|said| format!("images.txt says that there are {said} images and has {found}"));
    Ok((images, warnings.into_iter().collect()))
}

fn image(line: &str) -> Result<Posed, String> {
    let mut rest = line;
    let mut words = [""; WORDS_BEFORE_NAME];
    for word in &mut words {
        let (next, after) = rest.split_once(|c: char| c.is_ascii_whitespace()).ok_or_else(|| {
            "not an image: expected number, rotation, translation, camera and name".to_owned()
        })?;
        (*word, rest) = (next, after.trim_ascii_start());
    }
    let [number, qw, qx, qy, qz, tx, ty, tz, camera] = words;
    let number: u32 = parsed("number of the image", number)?;
    let about = |problem: String| format!("image {number}: {problem}");
    let value = |word: &str| parsed::<f64>("pose", word).map_err(about);
    if rest.len() > MAX_NAME {
        return Err(about(format!("name is over the limit of {MAX_NAME} bytes")));
    }
    Ok(Posed {
        name: rest.to_owned(),
        camera: parsed("camera", camera).map_err(about)?,
        quaternion: [value(qw)?, value(qx)?, value(qy)?, value(qz)?],
        translation: [value(tx)?, value(ty)?, value(tz)?],
    })
}

fn parsed<T: std::str::FromStr>(what: &str, word: &str) -> Result<T, String> {
    word.parse().map_err(|_| format!("{what} is '{word}', which is not a number of this kind"))
}
