//! Structural similarity, as the 3DGS papers measure it.

use lexisplat_render::Image;
use rayon::prelude::*;

use super::{check_sizes, clip};

/// Side of the window in pixels (INRIA `utils/loss_utils.py`, `ssim`).
const WINDOW: usize = 11;
/// Pixels the window reaches to each side. Beyond the picture's edge everything is 0.
const REACH: usize = WINDOW / 2;
/// Standard deviation of the window in pixels.
const SIGMA: f64 = 1.5;
/// Keeps the luminance term finite in the dark: (0.01 * peak)^2.
const C1: f64 = 0.01 * 0.01;
/// Keeps the contrast term finite where nothing varies: (0.03 * peak)^2.
const C2: f64 = 0.03 * 0.03;
/// Rows in one unit of work. Fixes the order of additions.
const BAND: usize = 32;
/// Window averages kept for each pixel: a, b, a^2, b^2 and ab.
const MOMENTS: usize = 5;

/// Structural similarity: 1 for pictures that are the same, less the more they differ.
///
/// An 11 x 11 Gaussian window of sigma 1.5, zero padding, and the mean over all pixels and channels, as
/// `ssim` in INRIA's `utils/loss_utils.py`; computed in f64. 1 if there are no pixels.
///
/// The result does not depend on the number of threads.
///
/// # Panics
/// If the pictures differ in size.
#[must_use]
pub fn ssim(a: &Image, b: &Image) -> f64 {
    check_sizes(a, b);
    let (width, height) = (a.width as usize, a.height as usize);
    if width == 0 || height == 0 {
        return 1.0;
    }
    let window = window();
    let bands: Vec<f64> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let rows = band * BAND..((band + 1) * BAND).min(height);
            (0..3).map(|channel| band_sum(a, b, &window, rows.clone(), channel)).sum()
        })
        .collect();
    bands.iter().sum::<f64>() / (a.pixels.len() * 3) as f64
}

/// The window along one axis; the whole is its product with itself.
fn window() -> [f64; WINDOW] {
    let raw: [f64; WINDOW] = std::array::from_fn(|i| {
        let x = i as f64 - REACH as f64;
        (-x * x / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = raw.iter().sum();
    raw.map(|v| v / sum)
}

/// The sum of the similarities of one channel in some rows.
fn band_sum(
    a: &Image,
    b: &Image,
    window: &[f64; WINDOW],
    rows: std::ops::Range<usize>,
    channel: usize,
) -> f64 {
    let (width, height) = (a.width as usize, a.height as usize);
    let above = rows.start.saturating_sub(REACH);
    let below = (rows.end + REACH).min(height);
    // Averages along the rows first; row `y` of moment `m` starts at ((y - above) * MOMENTS + m) * width.
    let mut blurred = vec![0.0; (below - above) * MOMENTS * width];
    let mut padded = vec![[0.0; MOMENTS]; width + 2 * REACH];
    for (y, blurred) in (above..below).zip(blurred.chunks_exact_mut(MOMENTS * width)) {
        let line = y * width..(y + 1) * width;
        let pixels = a.pixels[line.clone()].iter().zip(&b.pixels[line]);
        for (moments, (a, b)) in padded[REACH..].iter_mut().zip(pixels) {
            let (a, b) = (clip(a[channel]), clip(b[channel]));
            *moments = [a, b, a * a, b * b, a * b];
        }
        for x in 0..width {
            let mut sums = [0.0; MOMENTS];
            for (moments, weight) in padded[x..x + WINDOW].iter().zip(window) {
                for (sum, moment) in sums.iter_mut().zip(moments) {
                    *sum += weight * moment;
                }
            }
            for (m, sum) in sums.into_iter().enumerate() {
                blurred[m * width + x] = sum;
            }
        }
    }
    let mut total = 0.0;
    let mut means = vec![0.0; MOMENTS * width];
    for y in rows {
        means.fill(0.0);
        for (i, weight) in window.iter().enumerate() {
            // Row y + i - REACH; rows outside the picture are 0.
            let Some(row) = (y + i).checked_sub(REACH).filter(|row| *row < height) else { continue };
            let start = (row - above) * MOMENTS * width;
            let from = &blurred[start..start + MOMENTS * width];
            for (mean, value) in means.iter_mut().zip(from) {
                *mean += weight * value;
            }
        }
        for x in 0..width {
            let [a, b, aa, bb, ab] = std::array::from_fn(|m| means[m * width + x]);
            total += similarity(a, b, aa, bb, ab);
        }
    }
    total
}

/// The index from the window averages of a, b, a^2, b^2 and ab.
fn similarity(a: f64, b: f64, aa: f64, bb: f64, ab: f64) -> f64 {
    let (var_a, var_b, covariance) = (aa - a * a, bb - b * b, ab - a * b);
    ((2.0 * a * b + C1) * (2.0 * covariance + C2)) / ((a * a + b * b + C1) * (var_a + var_b + C2))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The definition, pixel by pixel with the whole square window.
    fn naive(a: &Image, b: &Image) -> f64 {
        let line = window();
        let (width, height) = (i64::from(a.width), i64::from(a.height));
        let mut total = 0.0;
        for y in 0..height {
            for x in 0..width {
                for channel in 0..3 {
                    let mut m = [0.0; MOMENTS];
                    for (dy, wy) in (-5..=5).zip(line) {
                        for (dx, wx) in (-5..=5).zip(line) {
                            let (x, y) = (x + dx, y + dy);
                            if (0..width).contains(&x) && (0..height).contains(&y) {
                                let at = usize::try_from(y * width + x).unwrap();
                                let (p, q) = (clip(a.pixels[at][channel]), clip(b.pixels[at][channel]));
                                for (m, v) in m.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                                    *m += wx * wy * v;
                                }
                            }
                        }
                    }
                    total += similarity(m[0], m[1], m[2], m[3], m[4]);
                }
            }
        }
        total / (a.pixels.len() * 3) as f64
    }

    fn pictures() -> impl Strategy<Value = (Image, Image)> {
        (1_u32..40, 1_u32..80).prop_flat_map(|(width, height)| {
            let len = (width * height) as usize;
            let pixels = || prop::collection::vec(prop::array::uniform3(-0.2_f32..1.2), len);
            (pixels(), pixels(), 0.0_f32..1.0).prop_map(move |(pixels, other, far)| {
                let mixed = pixels.iter().zip(&other);
                let mixed = mixed.map(|(p, q)| std::array::from_fn(|c| p[c] + far * (q[c] - p[c]))).collect();
                (Image { width, height, pixels }, Image { width, height, pixels: mixed })
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn fast_is_naive((a, b) in pictures()) {
            prop_assert!((ssim(&a, &b) - naive(&a, &b)).abs() < 1e-12);
        }
    }

    #[test]
    fn the_same_is_one() {
        let pixels = (0..48 * 33_u16).map(|i| [f32::from(i % 251) / 250.0, f32::from(i % 7), 0.0]).collect();
        let a = Image { width: 48, height: 33, pixels };
        assert!((ssim(&a, &a) - 1.0).abs() < 1e-12);
    }

    /// Values of INRIA's formula, from `scipy.ndimage.correlate` with constant padding in f64.
    #[test]
    fn agrees_with_scipy() {
        let (width, height) = (37_u32, 29_u32);
        let make = |f: fn(u32, u32, u32) -> u32| {
            let at = |i: u32, c: u32| f(i % width, i / width, c) as f32 / 255.0;
            let pixels = (0..width * height).map(|i| [at(i, 0), at(i, 1), at(i, 2)]).collect();
            Image { width, height, pixels }
        };
        let a = make(|x, y, c| (x * x * 3 + y * 7 + c * 31) % 256);
        let b = make(|x, y, c| (x * x * 3 + y * 7 + c * 31 + (x * y) % 23) % 256);
        assert!((ssim(&a, &b) - SCIPY).abs() < 1e-6, "{}", ssim(&a, &b));
    }
    const SCIPY: f64 = 0.803_736_701_053_693_1;
}
