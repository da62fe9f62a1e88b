//! Peak signal-to-noise ratio.

use lexisplat_compress::decibels;
use lexisplat_render::{Image, squared_error};

use super::comparable;
use lexisplat_compress::Result;

/// Returns the PSNR in dB, `-10 log10(mse)`, where `mse` is the mean squared error over all pixels and channels, for a
/// peak of 1. Returns `None` if the clipped pictures are identical, because the PSNR is then infinite.
///
/// # Errors
/// [`lexisplat_compress::Error::Parameter`] if the sizes differ, or a picture is empty or has NaN.
pub fn psnr(a: &Image, b: &Image) -> Result<Option<f64>> {
    comparable(a, b)?;
    Ok(decibels(squared_error(a, b)?, a.pixels.len() as u64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::testing::picture;

    fn flat(value: f32) -> Image {
        Image { width: 4, height: 2, pixels: vec![[value; 3]; 8] }
    }

    #[test]
    fn known_differences_give_known_decibels() {
        assert!((psnr(&flat(0.5), &flat(0.6)).unwrap().unwrap() - 20.0).abs() < 1e-5);
        assert!((psnr(&flat(0.0), &flat(1.0)).unwrap().unwrap()).abs() < 1e-12);
        let mut one = flat(0.5);
        one.pixels[3][1] = 0.75;
        let expected = -10.0 * (0.0625_f64 / 24.0).log10();
        assert!((psnr(&one, &flat(0.5)).unwrap().unwrap() - expected).abs() < 1e-9);
    }

    #[test]
    fn clipping_comes_first_and_identity_is_none() {
        assert_eq!(psnr(&flat(1.5), &flat(1.0)).unwrap(), None);
        // Colours of a finite scene may overflow where it is drawn.
        assert_eq!(decibels(squared_error(&flat(-3.0), &flat(f32::NAN)).unwrap(), 8), None);
        assert_eq!(psnr(&flat(f32::INFINITY), &flat(1.0)).unwrap(), None);
        let a = picture(20, 10, 1);
        assert_eq!(psnr(&a, &a).unwrap(), None);
    }

    #[test]
    fn sizes_must_match() {
        assert!(psnr(&picture(4, 5, 1), &picture(5, 4, 1)).is_err());
        let short = Image { width: 4, height: 2, pixels: vec![[0.0; 3]; 7] };
        assert!(psnr(&short, &short).is_err());
    }
}
