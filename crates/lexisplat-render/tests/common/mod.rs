//! Functions that the integration tests share: reading real models and photos, and PSNR.
#![allow(dead_code, reason = "each test file uses a part")]

use lexisplat::{Splats, ply};
use lexisplat_render::Image;
use lexisplat_testing::real_data;

/// Reads a PLY of the real models.
pub(crate) fn load(name: &str) -> Option<Splats> {
    Some(ply::read(&real_data(name)?, &ply::ReadOptions::default()).unwrap().splats)
}

/// Peak signal-to-noise ratio in dB of two pictures, clipped to \[0, 1\] if `clip`; infinite if equal.
pub(crate) fn psnr(a: &Image, b: &Image, clip: bool) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let level = |v: f32| if clip { f64::from(v.clamp(0.0, 1.0)) } else { f64::from(v) };
    let squares: f64 = a
        .pixels
        .as_flattened()
        .iter()
        .zip(b.pixels.as_flattened())
        .map(|(&a, &b)| (level(a) - level(b)).powi(2))
        .sum();
    -10.0 * (squares / (3 * a.pixels.len()) as f64).log10()
}

/// The photo beside a scene that `camera` names.
pub(crate) fn photo(folder: &str, camera: &str) -> Option<Image> {
    let stem = camera.split('.').next().unwrap();
    let picture = image::open(real_data(&format!("{folder}/{stem}.png"))?).unwrap().to_rgb8();
    let pixels: Vec<[u8; 3]> = picture.pixels().map(|p| p.0).collect();
    Some(Image::from_8bit(picture.width(), picture.height(), &pixels).unwrap())
}
