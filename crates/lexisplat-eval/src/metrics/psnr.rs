//! Peak signal-to-noise ratio.

use lexisplat_render::Image;
use rayon::prelude::*;

use super::{check_sizes, clip};

/// Pixels whose squares are added up before they join the others: fixes the order of additions.
const BLOCK: usize = 1 << 14;

/// Peak signal-to-noise ratio in dB for a peak of 1: `-10 log10` of the mean squared difference.
/// `None` if there is no difference at all, for which the formula gives no number.
///
/// The result does not depend on the number of threads.
///
/// # Panics
/// If the pictures differ in size.
#[must_use]
pub fn psnr(a: &Image, b: &Image) -> Option<f64> {
    check_sizes(a, b);
    let blocks: Vec<f64> = a
        .pixels
        .par_chunks(BLOCK)
        .zip(b.pixels.par_chunks(BLOCK))
        .map(|(a, b)| {
            let values = a.as_flattened().iter().zip(b.as_flattened());
            values.map(|(&a, &b)| (clip(a) - clip(b)) * (clip(a) - clip(b))).sum()
        })
        .collect();
    let sum: f64 = blocks.iter().sum();
    (sum > 0.0).then(|| {
        let count = a.pixels.as_flattened().len() as f64;
        -10.0 * (sum / count).log10()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: Vec<[f32; 3]>) -> Image {
        Image { width: u32::try_from(pixels.len()).unwrap(), height: 1, pixels }
    }

    #[test]
    fn known_values() {
        let a = image(vec![[0.5; 3]; 7]);
        let b = image(vec![[0.6; 3]; 7]);
        assert!((psnr(&a, &b).unwrap() - 20.0).abs() < 1e-5);
        // One value of six is off by 0.5: mean square 1 / 24.
        let c = image(vec![[0.5; 3], [0.5, 1.0, 0.5]]);
        let d = image(vec![[0.5; 3]; 2]);
        assert!((psnr(&c, &d).unwrap() - 10.0 * 24.0_f64.log10()).abs() < 1e-12);
        assert_eq!(psnr(&c, &d), psnr(&d, &c));
    }

    #[test]
    fn identical_is_none_also_beyond_the_clip() {
        let a = image(vec![[0.2, -1.0, 3.0], [f32::NAN, 0.0, 1.0]]);
        let b = image(vec![[0.2, -9.0, 1.0], [-1.0, f32::NAN, f32::INFINITY]]);
        assert_eq!(psnr(&a, &b), None);
        assert_eq!(psnr(&image(vec![]), &image(vec![])), None);
    }

    #[test]
    fn thread_count_changes_nothing() {
        let wave =
            |k: f32| image((0..100_000_u32).map(|i| [(k * (i % 971) as f32).sin().abs(); 3]).collect());
        let (a, b) = (wave(0.1), wave(0.100_1));
        let score = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| (psnr(&a, &b), super::super::ssim(&a, &b)))
        };
        assert_eq!(score(1), score(4));
    }
}
