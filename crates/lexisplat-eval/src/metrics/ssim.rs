//! Structural similarity, in the variant of the 3DGS papers and in that of image libraries.

use lexisplat::simd::Simd;
use lexisplat_render::Image;

use super::rows::{add_across, planes, sum_rows};
use super::{clip, comparable};
use lexisplat_compress::{Error, Result};

/// Side of the Gaussian window in pixels (INRIA `utils/loss_utils.py`, `window_size`).
const WINDOW: usize = 11;
/// Standard deviation of the window in pixels (`gaussian` in the same file).
const SIGMA: f64 = 1.5;
/// Stabiliser of the luminance term, `(0.01 peak)^2`.
const C1: f64 = 0.01 * 0.01;
/// Stabiliser of the contrast term, `(0.03 peak)^2`.
const C2: f64 = 0.03 * 0.03;
/// Distance from the centre to the border of the window, in pixels.
const REACH: usize = WINDOW / 2;
/// Number of blurred quantities: both means, the sum of both squares, and the product. No formula needs the squares one
/// by one.
const MAPS: usize = 4;

/// Treatment of pixels whose window extends beyond the picture.
#[derive(Clone, Copy, PartialEq)]
enum Border {
    /// Pixels outside of the picture are 0.
    Zero,
    /// Pixels with such a window do not count.
    Cut,
}

/// Returns the SSIM, averaged over all pixels and channels, with a window of 11 x 11, sigma 1.5 and zero padding. It is
/// 1, the largest value, for identical pictures.
///
/// # Errors
/// [`Error::Parameter`] if the sizes differ, or a picture is empty or has NaN.
pub fn ssim(a: &Image, b: &Image) -> Result<f64> {
    comparable(a, b)?;
    Ok(mean(a, b, Border::Zero))
}

/// Returns the SSIM over the pixels whose window lies within the picture, as in the paper of Wang et al. (2004) and in
/// scikit-image with `gaussian_weights`. Tables of 3DGS papers have [`ssim`] instead.
///
/// # Errors
/// [`Error::Parameter`] if the sizes differ or a side of a picture is smaller than 11 pixels.
pub fn ssim_inner(a: &Image, b: &Image) -> Result<f64> {
    comparable(a, b)?;
    if (a.width.min(a.height) as usize) < WINDOW {
        let found = format!("{} x {}", a.width, a.height);
        return Err(Error::parameter("picture", found, format!("at least {WINDOW} x {WINDOW} pixels")));
    }
    Ok(mean(a, b, Border::Cut))
}

fn mean(a: &Image, b: &Image, border: Border) -> f64 {
    let (width, height) = (a.width as usize, a.height as usize);
    let (a, b) = (planes(a, |p| p.map(clip)), planes(b, |p| p.map(clip)));
    let (window, simd) = (window(), Simd::current());
    let cut = if border == Border::Cut { REACH } else { 0 };
    let (rows, columns) = (cut..height - cut, cut..width - cut);
    let pixels = rows.len() * columns.len();
    let sum = sum_rows(
        rows,
        || Scratch::new(width),
        |scratch, y| {
            let channels = a.iter().zip(&b);
            channels
                .map(|(a, b)| {
                    simd.dispatch(
                        #[inline(always)]
                        || scratch.blur([a, b], &window, y),
                    );
                    columns
                        .clone()
                        .map(|x| similarity(scratch.across.each_ref().map(|row| row[x])))
                        .sum::<f64>()
                })
                .sum()
        },
    );
    sum / (pixels * 3) as f64
}

/// Blurred quantities of one row of one channel.
struct Scratch {
    /// Quantities blurred down the columns, with [`REACH`] zeros to each side.
    down: [Vec<f64>; MAPS],
    /// Quantities blurred along columns and rows.
    across: [Vec<f64>; MAPS],
}

impl Scratch {
    fn new(width: usize) -> Self {
        let rows = |length| [(); MAPS].map(|()| vec![0.0; length]);
        Self { down: rows(width + 2 * REACH), across: rows(width) }
    }

    /// Blurs the quantities of row `y` of two planes.
    #[inline(always)]
    fn blur(&mut self, [a, b]: [&[f32]; 2], window: &[f64; WINDOW], y: usize) {
        let width = self.across[0].len();
        let inner = REACH..REACH + width;
        let [mean_a, mean_b, squares, product] = self.down.each_mut().map(|row| &mut row[inner.clone()]);
        for row in [&mut *mean_a, &mut *mean_b, &mut *squares, &mut *product] {
            row.fill(0.0);
        }
        for (k, &weight) in window.iter().enumerate() {
            let Some(start) = (y + k).checked_sub(REACH).map(|row| row * width) else { continue };
            let (Some(a), Some(b)) = (a.get(start..start + width), b.get(start..start + width)) else {
                break;
            };
            for x in 0..width {
                let (p, q) = (f64::from(a[x]), f64::from(b[x]));
                mean_a[x] += weight * p;
                mean_b[x] += weight * q;
                squares[x] += weight * (p * p + q * q);
                product[x] += weight * (p * q);
            }
        }
        for (across, down) in self.across.iter_mut().zip(&self.down) {
            across.fill(0.0);
            add_across(across, window, down);
        }
    }
}

/// Returns the SSIM at one pixel of one channel from its blurred quantities.
fn similarity([mean_a, mean_b, squares, product]: [f64; MAPS]) -> f64 {
    let (means, cross) = (mean_a * mean_a + mean_b * mean_b, mean_a * mean_b);
    let (variances, covariance) = (squares - means, product - cross);
    ((2.0 * cross + C1) * (2.0 * covariance + C2)) / ((means + C1) * (variances + C2))
}

/// Returns the weights of the window along one axis. Their sum is 1.
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

    /// The definition: a full 2-D window at every pixel at least `cut` from the border.
    fn naive(a: &Image, b: &Image, cut: i64) -> f64 {
        let (width, height) = (i64::from(a.width), i64::from(a.height));
        let reach = i64::try_from(REACH).unwrap();
        let weight = |d: i64| (-(d * d) as f64 / (2.0 * SIGMA * SIGMA)).exp();
        let norm: f64 = (-reach..=reach).map(weight).sum();
        let mut total = 0.0;
        for y in cut..height - cut {
            for x in cut..width - cut {
                for c in 0..3 {
                    let mut sums = [0.0; 5];
                    for dy in -reach..=reach {
                        for dx in -reach..=reach {
                            let (u, v) = (x + dx, y + dy);
                            if !(0..width).contains(&u) || !(0..height).contains(&v) {
                                continue;
                            }
                            let i = usize::try_from(v * width + u).unwrap();
                            let (p, q) = (f64::from(clip(a.pixels[i][c])), f64::from(clip(b.pixels[i][c])));
                            let w = weight(dx) * weight(dy) / (norm * norm);
                            for (s, value) in sums.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                                *s += w * value;
                            }
                        }
                    }
                    let [mean_a, mean_b, square_a, square_b, product] = sums;
                    let (variance_a, variance_b) = (square_a - mean_a * mean_a, square_b - mean_b * mean_b);
                    let covariance = product - mean_a * mean_b;
                    total += (2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2)
                        / ((mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2));
                }
            }
        }
        total / ((width - 2 * cut) * (height - 2 * cut) * 3) as f64
    }

    #[test]
    fn agrees_with_the_definition() {
        for (width, height) in [(1, 1), (3, 20), (31, 17)] {
            let (a, b) = (picture(width, height, 1), picture(width, height, 2));
            let (fast, slow) = (ssim(&a, &b).unwrap(), naive(&a, &b, 0));
            assert!((fast - slow).abs() < 1e-12, "{width} x {height}: {fast} {slow}");
            assert!(fast < 0.98, "the pictures must differ for this to mean anything: {fast}");
        }
    }

    #[test]
    fn without_its_border_agrees_with_the_definition() {
        for (width, height) in [(11, 11), (12, 30), (31, 17)] {
            let (a, b) = (picture(width, height, 1), picture(width, height, 2));
            let (fast, slow) = (ssim_inner(&a, &b).unwrap(), naive(&a, &b, 5));
            assert!((fast - slow).abs() < 1e-12, "{width} x {height}: {fast} {slow}");
            let whole = ssim(&a, &b).unwrap();
            assert!((fast - whole).abs() > 1e-4, "the border must matter: {fast} {whole}");
        }
        for (width, height) in [(10, 30), (30, 10)] {
            let small = picture(width, height, 1);
            assert!(ssim_inner(&small, &small).unwrap_err().to_string().contains("at least 11 x 11"));
        }
    }

    #[test]
    fn identical_pictures_score_one() {
        let a = picture(30, 20, 3);
        assert!((ssim(&a, &a).unwrap() - 1.0).abs() < 1e-12);
        assert!((ssim_inner(&a, &a).unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn threads_do_not_change_the_score() {
        let (a, b) = (picture(50, 40, 4), picture(50, 40, 5));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| [ssim(&a, &b), ssim_inner(&a, &b)]).map(|score| score.unwrap().to_bits())
        };
        assert_eq!(on(1), on(3));
    }
}
