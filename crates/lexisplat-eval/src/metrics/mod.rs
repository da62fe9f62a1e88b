//! How much two pictures differ.
//!
//! Both metrics look at float values clipped to \[0, 1\], NaN counting as 0, over all pixels and the
//! three channels, as the evaluation of the 3DGS papers does with its tensors.

mod psnr;
mod ssim;

pub use psnr::psnr;
pub use ssim::ssim;

use lexisplat_render::Image;

/// A value as the metrics see it.
fn clip(value: f32) -> f64 {
    // Comparisons with NaN are false.
    if value > 0.0 { f64::from(value.min(1.0)) } else { 0.0 }
}

/// # Panics
/// If the sizes differ or do not fit the pixels.
fn check_sizes(a: &Image, b: &Image) {
    assert_eq!((a.width, a.height), (b.width, b.height), "pictures to compare must be of one size");
    for image in [a, b] {
        assert_eq!(image.pixels.len(), image.width as usize * image.height as usize, "width * height pixels");
    }
}
