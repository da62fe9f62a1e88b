//! `cameras.bin` and `images.bin`.

use std::io::{BufRead, Seek};

use super::intrinsics::{Cameras, Intrinsics, Pinhole};
use super::pose::Posed;
use super::source::Source;
use crate::error::Result;

/// Least bytes of a camera: number, model, width, height and three parameters.
const CAMERA_BYTES: u64 = 4 + 4 + 8 + 8 + 3 * 8;
/// Least bytes of an image: number, pose, camera, the end of an empty name, number of points.
const IMAGE_BYTES: u64 = 4 + 7 * 8 + 4 + 1 + 8;
/// Bytes of a point of an image: x, y, and the number of the point it shows.
const POINT_BYTES: u64 = 3 * 8;

pub(super) fn cameras<R: BufRead + Seek>(source: &mut Source<'_, R>) -> Result<Cameras> {
    let count = source.count("cameras", CAMERA_BYTES)?;
    let mut cameras = Cameras::new();
    for index in 0..count {
        let number = source.u32(format_args!("camera at position {index}"))?;
        let what = format_args!("camera {number}");
        let model = Pinhole::numbered(source.u32(what)?).map_err(|problem| source.wrong(what, problem))?;
        let (width, height) = (source.u64(what)?, source.u64(what)?);
        let focal = match model {
            Pinhole::Simple => source.f64s::<1>(what).map(|[f]| [f; 2])?,
            Pinhole::Two => source.f64s::<2>(what)?,
        };
        let centre = source.f64s::<2>(what)?;
        let intrinsics = Intrinsics::new(width, height, focal, centre).map_err(|p| source.wrong(what, p))?;
        if cameras.insert(number, intrinsics).is_some() {
            return Err(source.wrong(what, "there are two of this number"));
        }
    }
    source.end("cameras")?;
    Ok(cameras)
}

pub(super) fn images<R: BufRead + Seek>(source: &mut Source<'_, R>) -> Result<Vec<Posed>> {
    let count = source.count("images", IMAGE_BYTES)?;
    let mut images = Vec::new();
    for index in 0..count {
        let number = source.u32(format_args!("image at position {index}"))?;
        let quaternion = source.f64s(format_args!("image {number}: rotation"))?;
        let translation = source.f64s(format_args!("image {number}: translation"))?;
        let camera = source.u32(format_args!("image {number}: camera"))?;
        let name = source.name(format_args!("image {number}: name"))?;
        let points = source.u64(format_args!("image {number}: number of points"))?;
        source.skip(points, POINT_BYTES, format_args!("image {number} ('{name}'): number of points"))?;
        images.push(Posed { name, camera, quaternion, translation });
    }
    source.end("images")?;
    Ok(images)
}
