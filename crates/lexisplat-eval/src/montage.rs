//! Pictures of how two pictures differ.

use lexisplat_render::Image;

/// Times a difference is multiplied by default: makes 1 / 255 visible and 16 / 255 white.
pub const DEFAULT_AMPLIFICATION: f32 = 16.0;
/// Black columns between the pictures of a montage.
const GAP: usize = 4;

/// An 8-bit picture of pictures side by side.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Montage {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Rows from the top, pixels from the left, channels red, green, blue.
    pub rgb: Vec<u8>,
}

/// `|a - b| * amplification` in each channel, both clipped to \[0, 1\] first. Not clipped itself.
///
/// # Panics
/// If the pictures differ in size.
#[must_use]
pub fn difference(a: &Image, b: &Image, amplification: f32) -> Image {
    assert_eq!((a.width, a.height), (b.width, b.height), "pictures to compare must be of one size");
    let clip = |v: f32| if v > 0.0 { v.min(1.0) } else { 0.0 };
    let pixels = a.pixels.iter().zip(&b.pixels);
    let pixels =
        pixels.map(|(a, b)| std::array::from_fn(|c| (clip(a[c]) - clip(b[c])).abs() * amplification));
    Image { width: a.width, height: a.height, pixels: pixels.collect() }
}

/// `a`, `b` and their [`difference`] from left to right, in 8 bits, with a thin gap between.
///
/// # Panics
/// If the pictures differ in size, or three of them are wider than `u32::MAX`.
#[must_use]
pub fn montage(a: &Image, b: &Image, amplification: f32) -> Montage {
    let difference = difference(a, b, amplification);
    let (width, height) = (a.width as usize, a.height as usize);
    let pictures = [a.to_8bit(), b.to_8bit(), difference.to_8bit()];
    let whole = pictures.len() * width + (pictures.len() - 1) * GAP;
    let mut rgb = Vec::with_capacity(whole * height * 3);
    for y in 0..height {
        for (k, picture) in pictures.iter().enumerate() {
            if k > 0 {
                rgb.extend([0; 3 * GAP]);
            }
            rgb.extend_from_slice(picture[y * width..(y + 1) * width].as_flattened());
        }
    }
    #[expect(clippy::expect_used, reason = "documented")]
    let width = u32::try_from(whole).expect("no picture is that wide");
    Montage { width, height: a.height, rgb }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_in_order() {
        let one =
            |v: f32| Image { width: 2, height: 2, pixels: vec![[v, 0.0, 2.0], [0.0; 3], [v; 3], [v; 3]] };
        let (a, b) = (one(0.2), one(0.2 + 4.0 / 255.0));
        let montage = montage(&a, &b, 16.0);
        assert_eq!((montage.width, montage.height), (2 * 3 + 2 * 4, 2));
        let pixel = |x: usize, y: usize| &montage.rgb[(y * 14 + x) * 3..][..3];
        assert_eq!(montage.rgb.len(), 14 * 2 * 3);
        assert_eq!(pixel(0, 0), [51, 0, 255]);
        assert_eq!(pixel(2, 0), [0, 0, 0]);
        assert_eq!(pixel(6, 0), [55, 0, 255]);
        assert_eq!(pixel(12, 0), [64, 0, 0]);
        assert_eq!(pixel(13, 1), [64, 64, 64]);
    }
}
