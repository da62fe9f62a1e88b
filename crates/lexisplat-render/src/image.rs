//! Pictures in floating point.

use crate::error::{Error, Result};

/// Largest value of an 8-bit channel.
const MAX_8BIT: f32 = 255.0;

/// A picture of `width * height` RGB pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Number of pixels in a row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Rows from the top, pixels from the left, channels red, green, blue. 0 is black and 1 is white;
    /// drawn pictures are not clamped.
    pub pixels: Vec<[f32; 3]>,
}

impl Image {
    /// Returns every pixel in 8 bits a channel: clipped to \[0, 1\], times 255, rounded half up, like
    /// `torchvision.utils.save_image`. NaN becomes 0.
    #[must_use]
    pub fn to_8bit(&self) -> Vec<[u8; 3]> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0.5 to 255.5")]
        let byte = |v: f32| (v.clamp(0.0, 1.0) * MAX_8BIT + 0.5) as u8;
        self.pixels.iter().map(|pixel| pixel.map(byte)).collect()
    }

    /// Returns the picture with the 8-bit pixels `pixels`. Its values are `byte / 255`.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the number of pixels is not `width * height`.
    pub fn from_8bit(width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<Self> {
        if u64::try_from(pixels.len()) != Ok(u64::from(width) * u64::from(height)) {
            return Err(Error::parameter("pixels", pixels.len(), format!("{width} x {height} pixels")));
        }
        let pixels = pixels.iter().map(|pixel| pixel.map(|byte| f32::from(byte) / MAX_8BIT)).collect();
        Ok(Self { width, height, pixels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bits_round_half_up_and_clip() {
        let pixels =
            vec![[-1.0, 0.0, 2.0], [0.5, 1.0, f32::NAN], [0.499 / 255.0, 0.5 / 255.0, 254.6 / 255.0]];
        let image = Image { width: 3, height: 1, pixels };
        assert_eq!(image.to_8bit(), [[0, 0, 255], [128, 255, 0], [0, 1, 255]]);
    }

    #[test]
    fn eight_bits_survive_the_round_trip() {
        let bytes: Vec<[u8; 3]> = (0..=255).map(|b| [b, 255 - b, b / 2]).collect();
        let image = Image::from_8bit(16, 16, &bytes).unwrap();
        assert_eq!(image.to_8bit(), bytes);
        assert!(Image::from_8bit(16, 15, &bytes).is_err());
    }
}
