//! One picture against another of the same view.
#![allow(dead_code, reason = "each test file uses a part")]

use lexisplat_render::Image;

use crate::common;

/// Least PSNR in dB between the GPU's and the processor's pictures.
pub(crate) const TWIN_DB: f64 = 60.0;
/// Largest difference of nearly all pixels, for values of 0 to 1.
const USUAL: f32 = 2.0 / 255.0;
/// Share of the pixels that may differ by more: opacities near the least fall on either side.
const UNUSUAL: f64 = 1e-3;

/// Checks that two pictures are as good as the same.
///
/// # Panics
/// If they are not.
pub(crate) fn check(found: &Image, expected: &Image, case: &str) {
    assert_eq!((found.width, found.height), (expected.width, expected.height), "{case}");
    assert!(found.pixels.as_flattened().iter().all(|v| v.is_finite()), "{case}: not finite");
    let db = common::psnr(found, expected, true);
    assert!(db >= TWIN_DB, "{case}: {db:.1} dB");
    let far = |(p, q): (&[f32; 3], &[f32; 3])| {
        p.iter().zip(q).any(|(a, b)| (a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).abs() > USUAL)
    };
    let unusual = found.pixels.iter().zip(&expected.pixels).filter(|&pair| far(pair)).count();
    // A single pixel of a small picture may.
    let most = (UNUSUAL * found.pixels.len() as f64).max(1.0);
    assert!(unusual as f64 <= most, "{case}: {unusual} of {} pixels", found.pixels.len());
}

/// The bits of a picture.
pub(crate) fn bits(image: &Image) -> Vec<u32> {
    image.pixels.as_flattened().iter().map(|v| v.to_bits()).collect()
}
