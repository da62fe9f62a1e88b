//! `cameras.bin` and `images.bin`.

use std::io::{BufRead, Seek};

use super::binary_reader::BinaryReader;
use super::intrinsics::{Cameras, Intrinsics, Pinhole};
use super::pose::Posed;
use crate::error::Result;

/// Smallest number of bytes of a camera: number, model, width, height and three parameters.
const CAMERA_BYTES: u64 = 4 + 4 + 8 + 8 + 3 * 8;
/// Smallest number of bytes of an image: number, pose, camera, the end of an empty name, and number of points.
const IMAGE_BYTES: u64 = 4 + 7 * 8 + 4 + 1 + 8;
/// Number of bytes of a point of an image: x, y, and the number of the 3D point.
const POINT_BYTES: u64 = 3 * 8;

pub(super) fn cameras<R: BufRead + Seek>(mut reader: BinaryReader<'_, R>) -> Result<Cameras> {
    let count = reader.count("cameras", CAMERA_BYTES)?;
    let mut cameras = Cameras::new();
    for index in 0..count {
        let number = reader.u32(format_args!("camera at position {index}"))?;
        let what = format_args!("camera {number}");
        let model = Pinhole::numbered(reader.u32(what)?).map_err(|problem| reader.wrong(what, problem))?;
        let (width, height) = (reader.u64(what)?, reader.u64(what)?);
        let focal = match model {
            Pinhole::Simple => reader.f64s::<1>(what).map(|[f]| [f; 2])?,
            Pinhole::Two => reader.f64s::<2>(what)?,
        };
        let centre = reader.f64s::<2>(what)?;
        let intrinsics = Intrinsics::new(width, height, focal, centre).map_err(|p| reader.wrong(what, p))?;
        if cameras.insert(number, intrinsics).is_some() {
            return Err(reader.wrong(what, "there are two of this number"));
        }
    }
    reader.end("cameras")?;
    Ok(cameras)
}

pub(super) fn images<R: BufRead + Seek>(mut reader: BinaryReader<'_, R>) -> Result<Vec<Posed>> {
    let count = reader.count("images", IMAGE_BYTES)?;
    let mut images = Vec::new();
    for index in 0..count {
        let number = reader.u32(format_args!("image at position {index}"))?;
        let quaternion = reader.f64s(format_args!("image {number}: rotation"))?;
        let translation = reader.f64s(format_args!("image {number}: translation"))?;
        let camera = reader.u32(format_args!("image {number}: camera"))?;
        let name = reader.name(format_args!("image {number}: name"))?;
        let points = reader.u64(format_args!("image {number}: number of points"))?;
        reader.skip(points, POINT_BYTES, format_args!("image {number} ('{name}'): number of points"))?;
        images.push(Posed { name, camera, quaternion, translation });
    }
    reader.end("images")?;
    Ok(images)
}
