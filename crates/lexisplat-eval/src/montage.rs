//! Two pictures and their difference side by side.

use lexisplat_render::Image;

use crate::metrics::clip;

/// Factor on differences, so that they are visible.
pub const AMPLIFICATION: f32 = 10.0;
/// Width of the gap between pictures, in pixels.
const GAP: u32 = 4;
/// Colour of the gap: a medium grey.
const GAP_COLOUR: [u8; 3] = [128; 3];

/// Returns the absolute difference of two pictures of the same size, times [`AMPLIFICATION`].
#[must_use]
pub fn difference(a: &Image, b: &Image) -> Image {
    let pixels = a
        .pixels
        .iter()
        .zip(&b.pixels)
        .map(|(p, q)| std::array::from_fn(|c| (clip(p[c]) - clip(q[c])).abs() * AMPLIFICATION))
        .collect();
    Image { width: a.width, height: a.height, pixels }
}

/// Returns `a`, `b` and their amplified difference side by side, in 8 bits: width, height, and pixels row by row.
#[must_use]
pub fn montage(a: &Image, b: &Image) -> (u32, u32, Vec<[u8; 3]>) {
    let pictures = [a.to_8bit(), b.to_8bit(), difference(a, b).to_8bit()];
    let width = a.width as usize;
    let mut out = Vec::new();
    for y in 0..a.height as usize {
        for (i, picture) in pictures.iter().enumerate() {
            if i > 0 {
                out.extend(std::iter::repeat_n(GAP_COLOUR, GAP as usize));
            }
            out.extend_from_slice(&picture[y * width..(y + 1) * width]);
        }
    }
    (3 * a.width + 2 * GAP, a.height, out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::testing::picture;

    #[test]
    fn the_parts_stand_where_they_should() {
        let (a, b) = (picture(6, 3, 1), picture(6, 3, 2));
        let (width, height, pixels) = montage(&a, &b);
        assert_eq!((width, height, pixels.len()), (26, 3, 78));
        assert_eq!(pixels[26 + 2], a.to_8bit()[6 + 2]);
        assert_eq!(pixels[26 + 10 + 2], b.to_8bit()[6 + 2]);
        assert_eq!(pixels[26 + 20 + 2], difference(&a, &b).to_8bit()[6 + 2]);
        assert_eq!(pixels[6], GAP_COLOUR);
        assert!(difference(&a, &a).pixels.iter().all(|p| *p == [0.0; 3]));
    }
}
