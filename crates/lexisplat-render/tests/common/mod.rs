//! What the integration tests share: the data folder, if it is there, and PSNR.
#![allow(dead_code, reason = "each test file uses a part")]

use std::path::PathBuf;

use lexisplat::{Splats, ply};
use lexisplat_render::Image;

/// `name` in the data folder: `LEXISPLAT_DATA`, else `../shared/data` beside the workspace.
pub(crate) fn data(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("LEXISPLAT_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is not there", path.display());
    None
}

/// Reads a PLY of the data folder.
pub(crate) fn load(name: &str) -> Option<Splats> {
    Some(ply::read(&data(name)?, &ply::ReadOptions::default()).unwrap().splats)
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
    let picture = image::open(data(&format!("{folder}/{stem}.png"))?).unwrap().to_rgb8();
    let pixels: Vec<[u8; 3]> = picture.pixels().map(|p| p.0).collect();
    Some(Image::from_8bit(picture.width(), picture.height(), &pixels).unwrap())
}
