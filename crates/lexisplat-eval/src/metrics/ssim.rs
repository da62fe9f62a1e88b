//! Structural similarity, as the 3DGS papers compute it.

use lexisplat_render::Image;
use rayon::prelude::*;

use super::{clipped, same_size};
use crate::error::Result;

/// Side of the Gaussian window in pixels (INRIA `utils/loss_utils.py`, `window_size`).
const WINDOW: usize = 11;
/// Standard deviation of the window in pixels (the same file, `gaussian`).
const SIGMA: f64 = 1.5;
/// Stabiliser of the luminance term, `(0.01 peak)^2`.
const C1: f64 = 0.01 * 0.01;
/// Stabiliser of the contrast term, `(0.03 peak)^2`.
const C2: f64 = 0.03 * 0.03;
/// Pixels the window reaches to each side. Outside the picture everything is 0.
const REACH: usize = WINDOW / 2;
/// Blurred quantities: both means, both squares, the product.
const MAPS: usize = 5;

/// SSIM, averaged over all pixels and channels: window of 11 x 11, sigma 1.5, zero padding.
/// At most 1, which it is for identical pictures.
///
/// # Errors
/// [`crate::Error::Parameter`] if the sizes differ or a picture is empty.
pub fn ssim(a: &Image, b: &Image) -> Result<f64> {
    same_size(a, b)?;
    let (width, height) = (a.width as usize, a.height as usize);
    let window = window();
    // One row of all channels at a time: first across, then down, each in a fixed order.
    let across: Vec<[f64; MAPS * 3]> = (0..height)
        .into_par_iter()
        .flat_map_iter(|y| {
            let row = |image: &Image| -> Vec<[f64; 3]> {
                image.pixels[y * width..(y + 1) * width].iter().map(|p| p.map(clipped)).collect()
            };
            let (row_a, row_b) = (row(a), row(b));
            (0..width).map(move |x| {
                let mut sums = [0.0; MAPS * 3];
                for (k, weight) in window.iter().enumerate() {
                    let Some(i) = (x + k).checked_sub(REACH).filter(|&i| i < width) else { continue };
                    for c in 0..3 {
                        let (p, q) = (row_a[i][c], row_b[i][c]);
                        for (sum, value) in sums[c * MAPS..].iter_mut().zip([p, q, p * p, q * q, p * q]) {
                            *sum += weight * value;
                        }
                    }
                }
                sums
            })
        })
        .collect();
    let rows: Vec<f64> = (0..height)
        .into_par_iter()
        .map(|y| {
            let mut total = 0.0;
            for x in 0..width {
                let mut sums = [0.0; MAPS * 3];
                for (k, weight) in window.iter().enumerate() {
                    let Some(i) = (y + k).checked_sub(REACH).filter(|&i| i < height) else { continue };
                    for (sum, value) in sums.iter_mut().zip(&across[i * width + x]) {
                        *sum += weight * value;
                    }
                }
                total += sums.chunks_exact(MAPS).map(similarity).sum::<f64>();
            }
            total
        })
        .collect();
    Ok(rows.iter().sum::<f64>() / (width * height * 3) as f64)
}

/// SSIM at one pixel of one channel from its blurred quantities.
fn similarity(blurred: &[f64]) -> f64 {
    let (mean_a, mean_b) = (blurred[0], blurred[1]);
    let (squares, product) = (mean_a * mean_a + mean_b * mean_b, mean_a * mean_b);
    let variances = blurred[2] + blurred[3] - squares;
    let covariance = blurred[4] - product;
    ((2.0 * product + C1) * (2.0 * covariance + C2)) / ((squares + C1) * (variances + C2))
}

/// The window's weights along one axis; they sum to 1.
fn window() -> [f64; WINDOW] {
    let mut weights: [f64; WINDOW] = std::array::from_fn(|k| {
        let distance = k as f64 - REACH as f64;
        (-distance * distance / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = weights.iter().sum();
    for weight in &mut weights {
        *weight /= sum;
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::testing::picture;

    /// The definition: a full 2-D window at every pixel.
    fn naive(a: &Image, b: &Image) -> f64 {
        let (width, height) = (i64::from(a.width), i64::from(a.height));
        let reach = i64::try_from(REACH).unwrap();
        let weight = |d: i64| (-(d * d) as f64 / (2.0 * SIGMA * SIGMA)).exp();
        let norm: f64 = (-reach..=reach).map(weight).sum();
        let mut total = 0.0;
        for y in 0..height {
            for x in 0..width {
                for c in 0..3 {
                    let mut sums = [0.0; MAPS];
                    for dy in -reach..=reach {
                        for dx in -reach..=reach {
                            let (u, v) = (x + dx, y + dy);
                            if !(0..width).contains(&u) || !(0..height).contains(&v) {
                                continue;
                            }
                            let i = usize::try_from(v * width + u).unwrap();
                            let (p, q) = (clipped(a.pixels[i][c]), clipped(b.pixels[i][c]));
                            let w = weight(dx) * weight(dy) / (norm * norm);
                            for (s, value) in sums.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                                *s += w * value;
                            }
                        }
                    }
                    total += similarity(&sums);
                }
            }
        }
        total / (width * height * 3) as f64
    }

    #[test]
    fn agrees_with_the_definition() {
        for (width, height) in [(1, 1), (3, 20), (31, 17)] {
            let (a, b) = (picture(width, height, 1), picture(width, height, 2));
            let (fast, slow) = (ssim(&a, &b).unwrap(), naive(&a, &b));
            assert!((fast - slow).abs() < 1e-12, "{width} x {height}: {fast} {slow}");
            assert!(fast < 0.98, "the pictures must differ for this to mean anything: {fast}");
        }
    }

    #[test]
    fn identical_pictures_score_one() {
        let a = picture(30, 20, 3);
        assert!((ssim(&a, &a).unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn threads_do_not_change_the_score() {
        let (a, b) = (picture(50, 40, 4), picture(50, 40, 5));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ssim(&a, &b)).unwrap().to_bits()
        };
        assert_eq!(on(1), on(3));
    }
}
