//! Pictures as PNG.

use image::ImageEncoder;

use lexisplat_compress::{Error, Result};

/// Returns an 8-bit RGB picture of `width * height` pixels as the bytes of a PNG file.
///
/// # Errors
/// [`Error::Parameter`] if there are no pixels, or their number is not `width * height`.
pub fn png(width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<Vec<u8>> {
    let wrong = || Error::parameter("picture", pixels.len(), format!("{width} x {height} pixels"));
    if pixels.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(wrong());
    }
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    encoder
        .write_image(pixels.as_flattened(), width, height, image::ExtendedColorType::Rgb8)
        .map_err(|_| wrong())?;
    Ok(bytes)
}
