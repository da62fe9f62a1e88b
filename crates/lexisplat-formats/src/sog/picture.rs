//! The pictures of a SOG: values of 8 bits in lossless WebP.

use std::io::Cursor;

use image_webp::{ColorType, EncoderParams, WebPDecoder, WebPEncoder};
use lexisplat::{Error, Limits, Result};

/// Number of bytes of a pixel with opacity.
pub(super) const RGBA: usize = 4;
/// Number of bytes of a pixel without opacity.
const RGB: usize = 3;
/// Largest number of pixels along a side of a WebP (RFC 9649, 2.4: 14 bits).
pub(super) const MOST_SIDE: usize = 1 << 14;
/// Largest number of bytes that a decoder may hold besides the pixels, such as metadata.
const MOST_BESIDE: usize = 1 << 20;

/// The memory that all pictures of a scene may take.
#[derive(Debug)]
pub(super) struct Budget<'a> {
    pub(super) name: &'a str,
    pub(super) limits: &'a Limits,
    /// Number of bytes of all files read. A file counts for at most the bytes of its pixels, so that other contents do
    /// not raise the limit.
    pub(super) file_bytes: u64,
    /// Number of bytes of all decoded pictures.
    pub(super) taken: usize,
}

/// A decoded picture.
#[derive(Debug)]
pub(super) struct Picture {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Number of bytes of a pixel, 3 or 4.
    each: usize,
    pixels: Vec<u8>,
    /// Whether the picture was written with loss.
    pub(super) is_lossy: bool,
}

impl Picture {
    /// Decodes the WebP `bytes` of the file `called`, which takes `stored` bytes. The picture may have at most `most`
    /// pixels.
    pub(super) fn read(
        called: &str,
        (bytes, stored): (&[u8], u64),
        most: usize,
        budget: &mut Budget<'_>,
    ) -> Result<Self> {
        let name = budget.name;
        let damaged = |error: &dyn std::fmt::Display| {
            Error::malformed(name, format!("the picture '{called}' is no WebP that can be read: {error}"))
        };
        let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(|error| damaged(&error))?;
        if decoder.is_animated() {
            return Err(damaged(&"it is animated"));
        }
        let (width, height) = decoder.dimensions();
        let [width, height] = [width, height].map(|side| usize::try_from(side).unwrap_or(usize::MAX));
        let each = if decoder.has_alpha() { RGBA } else { RGB };
        let size = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(each));
        let size = size.unwrap_or(usize::MAX);
        budget.file_bytes = budget.file_bytes.saturating_add(stored.min(size as u64));
        let all = budget.taken.saturating_add(size);
        budget.limits.check_arrays(name, budget.file_bytes, all, 1)?;
        if width.saturating_mul(height) > most {
            let text = format!("the picture '{called}' has {width} x {height} pixels, where {most} are most");
            return Err(Error::malformed(name, text));
        }
        decoder.set_memory_limit(bytes.len().saturating_add(MOST_BESIDE));
        let mut pixels = vec![0; size];
        decoder.read_image(&mut pixels).map_err(|error| damaged(&error))?;
        budget.taken = all;
        Ok(Self { width, height, each, pixels, is_lossy: decoder.is_lossy() })
    }

    /// Returns the number of pixels.
    pub(super) fn len(&self) -> usize {
        self.width * self.height
    }

    /// Returns pixel number `i`, counted row by row. A pixel without opacity is opaque.
    pub(super) fn pixel(&self, i: usize) -> [u8; RGBA] {
        match *self.pixels.get(i * self.each..).unwrap_or_default() {
            [r, g, b, a, ..] if self.each == RGBA => [r, g, b, a],
            [r, g, b, ..] => [r, g, b, u8::MAX],
            _ => [0; RGBA],
        }
    }
}

/// Returns `pixels` as a WebP of `width` and `height`. The values of transparent pixels are kept too.
pub(super) fn write(pixels: &[[u8; RGBA]], width: usize, height: usize) -> Result<Vec<u8>> {
    let opaque = pixels.iter().all(|pixel| pixel[3] == u8::MAX);
    let data: Vec<u8> = if opaque {
        pixels.iter().flat_map(|pixel| pixel[..RGB].to_vec()).collect()
    } else {
        pixels.as_flattened().to_vec()
    };
    let kind = if opaque { ColorType::Rgb8 } else { ColorType::Rgba8 };
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    let encode = |predict: bool| {
        let mut bytes = Vec::new();
        let mut encoder = WebPEncoder::new(&mut bytes);
        let mut params = EncoderParams::default();
        params.use_predictor_transform = predict;
        encoder.set_params(params);
        let encoded = encoder.encode(&data, side(width), side(height), kind);
        encoded.map_err(|error| Error::Writer { source: std::io::Error::other(error) })?;
        Ok(bytes)
    };
    let [plain, predicted] = [encode(false)?, encode(true)?];
    Ok(if predicted.len() < plain.len() { predicted } else { plain })
}
