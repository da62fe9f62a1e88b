//! What the integration tests share: the data folder, if it is there, and PSNR.
#![allow(dead_code, reason = "each test file uses a part")]

use std::path::PathBuf;

use lexisplat::{Geometry, SceneMeta, ShDegree, Splats};
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

/// Reads a PLY of 62 floats a Gaussian by property name.
pub(crate) fn load(name: &str) -> Option<Splats> {
    let bytes = std::fs::read(data(name)?).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap();
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let names: Vec<&str> = header.lines().filter_map(|l| l.strip_prefix("property float ")).collect();
    let row = names.len();
    let floats: Vec<f32> =
        bytes[end + 11..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let at = |name: String| names.iter().position(|n| *n == name).unwrap();
    let pick = |names: &[&str]| -> Vec<usize> { names.iter().map(|n| at((*n).to_owned())).collect() };
    fn get<const N: usize>(floats: &[f32], row: usize, columns: &[usize]) -> Vec<[f32; N]> {
        floats.chunks_exact(row).map(|r| std::array::from_fn(|k| r[columns[k]])).collect()
    }
    let rest: Vec<usize> = (0..45).map(|k| at(format!("f_rest_{k}"))).collect();
    let geometry = Geometry {
        positions: get(&floats, row, &pick(&["x", "y", "z"])),
        dc: get(&floats, row, &pick(&["f_dc_0", "f_dc_1", "f_dc_2"])),
        opacities: get::<1>(&floats, row, &pick(&["opacity"])).concat(),
        scales: get(&floats, row, &pick(&["scale_0", "scale_1", "scale_2"])),
        rotations: get(&floats, row, &pick(&["rot_0", "rot_1", "rot_2", "rot_3"])),
        ..Geometry::default()
    };
    let sh_rest = get::<45>(&floats, row, &rest).concat();
    Some(Splats { geometry, degree: ShDegree::THREE, sh_rest, meta: SceneMeta::default() })
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
