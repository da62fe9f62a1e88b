//! PSNR of sums of squared errors.

/// Returns the PSNR in dB of pictures whose squared errors sum to `squares` over all three channels of `pixels` pixels:
/// `-10 log10(squares / (3 pixels))`. Returns `None` if there are no errors.
#[must_use]
pub fn decibels(squares: f64, pixels: u64) -> Option<f64> {
    let mean = squares / (pixels * 3) as f64;
    (mean > 0.0).then(|| -10.0 * libm::log10(mean))
}
