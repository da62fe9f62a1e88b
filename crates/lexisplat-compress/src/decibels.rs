//! PSNR of sums of squared errors.

/// The PSNR in dB of a sum of squared errors over all channels of so many pixels; `None` if there are no errors.
#[must_use]
pub fn decibels(squares: f64, pixels: u64) -> Option<f64> {
    let mean = squares / (pixels * 3) as f64;
    (mean > 0.0).then(|| -10.0 * libm::log10(mean))
}
