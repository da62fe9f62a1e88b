//! The squared error of two pictures.

use crate::error::{Error, Result};
use crate::image::Image;

/// Returns the sum of the squared differences of all channels of two pictures, each clipped to 0..1. NaN counts as 0. The
/// PSNR in dB is `-10 log10(sum / channels)`, where `channels` is three times the number of pixels.
///
/// # Errors
/// [`Error::Parameter`] if the pictures differ in size.
pub fn squared_error(a: &Image, b: &Image) -> Result<f64> {
    let size = |image: &Image| format!("{} x {}", image.width, image.height);
    if size(a) != size(b) || a.pixels.len() != b.pixels.len() {
        return Err(Error::parameter("picture", size(b), size(a)));
    }
    let clipped = |v: f32| if v > 0.0 { f64::from(v.min(1.0)) } else { 0.0 };
    let channels = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
    Ok(channels.map(|(&a, &b)| (clipped(a) - clipped(b)).powi(2)).sum())
}
