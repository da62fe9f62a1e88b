//! Reads photos as pictures.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use image::imageops::{self, FilterType};
use image::{DynamicImage, ImageError, ImageReader, Limits, RgbImage};
use lexisplat_render::{Image, MAX_SIDE};

use super::View;
use crate::error::{Error, Result};

/// Largest file that is read, in bytes: ten times the size that the largest camera writes.
pub(super) const MAX_PHOTO_BYTES: u64 = 512 << 20;
/// Largest memory that decoding may take, in bytes: the size of a picture with alpha of [`MAX_SIDE`] pixels a side.
const MAX_DECODED: u64 = 4 * (MAX_SIDE as u64).pow(2);
/// Number of bytes from the start that nearly always hold the size: it may follow a preview and a colour profile.
const HEADER: u64 = 256 << 10;
/// Markers of a JPEG: its start, the start of a scan, and its end (ITU-T T.81, table B.1).
const JPEG_START: [u8; 2] = [0xFF, 0xD8];
const JPEG_SCAN: [u8; 2] = [0xFF, 0xDA];
const JPEG_END: [u8; 2] = [0xFF, 0xD9];

fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_DECODED);
    limits
}

/// Reads up to `limit` bytes from the start of the file.
fn start(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(limit).read_to_end(&mut bytes))
        .map_err(|e| Error::io(path, e))?;
    Ok(bytes)
}

fn reader(path: &Path, bytes: Vec<u8>) -> Result<ImageReader<Cursor<Vec<u8>>>> {
    let mut reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| Error::io(path, e))?;
    reader.limits(limits());
    Ok(reader)
}

fn refused(path: &Path, error: &ImageError) -> Error {
    let problem = match error {
        ImageError::Limits(_) => {
            format!("over the limit of {MAX_SIDE} pixels a side or {} MiB decoded", MAX_DECODED >> 20)
        }
        ImageError::Unsupported(_) => "neither a PNG nor a JPEG that can be read".into(),
        other => format!("damaged: {other}"),
    };
    Error::format(path, problem)
}

/// Reads the width and height of a photo, in pixels, from its header. The orientation in EXIF is ignored.
pub(super) fn size(path: &Path) -> Result<(u32, u32)> {
    let head = start(path, HEADER)?;
    let whole = (head.len() as u64) < HEADER;
    match reader(path, head)?.into_dimensions() {
        Ok(size) => Ok(size),
        Err(error) if whole => Err(refused(path, &error)),
        // The header is longer than the bytes read.
        Err(_) => reader(path, all(path)?)?.into_dimensions().map_err(|e| refused(path, &e)),
    }
}

fn all(path: &Path) -> Result<Vec<u8>> {
    let bytes = start(path, MAX_PHOTO_BYTES + 1)?;
    if bytes.len() as u64 > MAX_PHOTO_BYTES {
        return Err(Error::format(path, format!("over the limit of {} MiB", MAX_PHOTO_BYTES >> 20)));
    }
    Ok(bytes)
}

/// Reads the photo of `view` in the size of its camera. Values are 8-bit levels divided by 255.
///
/// `background` (0 to 1 a channel) shows through transparent pixels. A photo of another size is then resized by the
/// cubic convolution of the 3DGS authors' loader (`PIL`'s bicubic: a = -0.5, widened where it shrinks). The
/// orientation in EXIF is ignored, as in that loader.
///
/// # Errors
/// [`Error::Parameter`] if the view has no photo. [`Error::Io`] if it cannot be read. [`Error::Format`] if it is
/// damaged, neither PNG nor JPEG, or over 16,384 pixels a side.
pub fn photo(view: &View, background: [f32; 3]) -> Result<Image> {
    let Some(path) = &view.photo else {
        return Err(Error::parameter("view", &view.camera.name, "a view with a photo"));
    };
    let bytes = all(path)?;
    if is_cut_jpeg(&bytes) {
        return Err(Error::format(path, "damaged: it ends before the picture does"));
    }
    let decoded = reader(path, bytes)?.decode().map_err(|e| refused(path, &e))?;
    let (width, height) = (view.camera.width, view.camera.height);
    let mut picture = opaque(decoded, background);
    if picture.dimensions() != (width, height) {
        picture = imageops::resize(&picture, width, height, FilterType::CatmullRom);
    }
    let pixels: Vec<[u8; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
    Ok(Image::from_8bit(width, height, &pixels)?)
}

/// Returns whether `bytes` are a JPEG without an end marker after its last scan. The decoder would fill the missing part
/// with grey. Neither marker occurs within a scan.
fn is_cut_jpeg(bytes: &[u8]) -> bool {
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|pair| pair == marker);
    bytes.starts_with(&JPEG_START) && last(JPEG_END) <= last(JPEG_SCAN)
}

/// Returns the picture in front of `background`.
fn opaque(picture: DynamicImage, background: [f32; 3]) -> RgbImage {
    if !picture.color().has_alpha() {
        return picture.into_rgb8();
    }
    let rgba = picture.into_rgba8();
    let behind = background.map(|v| v.clamp(0.0, 1.0) * 255.0);
    RgbImage::from_fn(rgba.width(), rgba.height(), |x, y| {
        let [r, g, b, a] = rgba.get_pixel(x, y).0.map(f32::from);
        let alpha = a / 255.0;
        let over = |front: f32, behind: f32| front * alpha + behind * (1.0 - alpha) + 0.5;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0.5 to 255.5")]
        let byte = |v: f32| v as u8;
        image::Rgb([over(r, behind[0]), over(g, behind[1]), over(b, behind[2])].map(byte))
    })
}
