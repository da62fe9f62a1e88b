//! Differences between two pictures. Values are first clipped to 0..1; [`outside`] tells whether there are values outside
//! of this range. Pictures with NaN are refused. Nothing is rounded to 8 bits.

mod flip;
pub mod lpips;
mod metric;
mod psnr;
mod rows;
mod ssim;

pub use flip::flip;
pub use lpips::Lpips;
pub use metric::Metric;
pub use psnr::psnr;
pub use ssim::{ssim, ssim_inner};

use lexisplat_render::Image;

use lexisplat_compress::{Error, Result};

/// Returns the smallest and largest value of `image` if one of them is outside of 0..1, where metrics clip. Pictures of
/// scenes may have such values. Values up to 255 mean that the picture should be divided by 255.
#[must_use]
pub fn outside(image: &Image) -> Option<[f32; 2]> {
    let ends = [f32::INFINITY, f32::NEG_INFINITY];
    let [low, high] =
        image.pixels.as_flattened().iter().fold(ends, |[low, high], &v| [low.min(v), high.max(v)]);
    (low < 0.0 || high > 1.0).then_some([low, high])
}

/// Returns `value` within 0..1. NaN becomes 0.
#[inline]
pub(crate) fn clip(value: f32) -> f32 {
    if value > 0.0 { value.min(1.0) } else { 0.0 }
}

/// Returns an error for two pictures of different sizes, for pictures whose number of pixels does not match their size,
/// and for pictures with NaN.
fn comparable(a: &Image, b: &Image) -> Result<()> {
    same_size(a, b)?;
    for image in [a, b] {
        // The loop has no early exit, so that it is vectorised.
        let has_nan = image.pixels.as_flattened().iter().fold(false, |found, v| found | v.is_nan());
        let is_nan = |pixel: &[f32; 3]| pixel.iter().any(|v| v.is_nan());
        if let Some(i) = image.pixels.iter().position(is_nan).filter(|_| has_nan) {
            let width = image.width as usize;
            let found = format!("NaN at column {}, row {}", i % width, i / width);
            return Err(Error::parameter("picture", found, "numbers from 0 to 1"));
        }
    }
    Ok(())
}

/// Returns an error for two pictures of different sizes, and for pictures whose number of pixels does not match their
/// size.
fn same_size(a: &Image, b: &Image) -> Result<()> {
    let describe = |image: &Image| format!("{} x {}", image.width, image.height);
    if (a.width, a.height) != (b.width, b.height) {
        return Err(Error::parameter("picture", describe(b), format!("the other's size, {}", describe(a))));
    }
    for image in [a, b] {
        let pixels = u64::from(image.width) * u64::from(image.height);
        if pixels == 0 || image.pixels.len() as u64 != pixels {
            return Err(Error::parameter(
                "picture",
                image.pixels.len(),
                format!("{} pixels", describe(image)),
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::testing::picture;
    use super::*;
    use crate::metrics::lpips::{Network, PixelRange, testing::random};

    #[test]
    fn pictures_with_nan_are_refused_by_every_metric() {
        let good = picture(40, 32, 1);
        let mut bad = good.clone();
        bad.pixels[40 * 7 + 3][2] = f32::NAN;
        let lpips = random(Network::Alex, 1);
        for (a, b) in [(&good, &bad), (&bad, &good), (&bad, &bad)] {
            let said = [
                psnr(a, b).map(drop),
                ssim(a, b).map(drop),
                ssim_inner(a, b).map(drop),
                flip(a, b).map(drop),
                lpips.distance(a, b, PixelRange::Standard).map(drop),
            ];
            for said in said {
                let said = said.unwrap_err().to_string();
                assert!(said.contains("picture = NaN at column 3, row 7"), "{said}");
            }
        }
    }

    #[test]
    fn values_outside_are_told() {
        let of =
            |value: f32| outside(&Image { width: 1, height: 2, pixels: vec![[0.0; 3], [1.0, value, 0.5]] });
        assert_eq!([of(0.5), of(1.0), of(0.0)], [None; 3]);
        assert_eq!(of(255.0), Some([0.0, 255.0]));
        assert_eq!(of(-0.25), Some([-0.25, 1.0]));
        assert_eq!(of(f32::INFINITY), Some([0.0, f32::INFINITY]));
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use lexisplat_render::Image;

    /// Two pictures of 64 x 48 that `benches/metrics_beside_references.py --golden` makes too: stripes and
    /// chequers in 8 bits, and the same shifted in places with noise of at most 12 levels.
    pub(crate) fn golden() -> [Image; 2] {
        let plain = |x: i32, y: i32, c: i32| (37 * c + 3 * x + 2 * y + 90 * ((x / 8 + y / 6) % 2)) % 256;
        let noisy = |x: i32, y: i32, c: i32| {
            let noise = (31 * x * x + 17 * y * y + 13 * x * y + 101 * c) % 25 - 12;
            (plain(x + (y / 16) % 2, y, c) + noise).clamp(0, 255)
        };
        let picture = |value: &dyn Fn(i32, i32, i32) -> i32| {
            let pixels: Vec<[u8; 3]> = (0..48 * 64)
                .map(|i| [0, 1, 2].map(|c| u8::try_from(value(i % 64, i / 64, c)).unwrap()))
                .collect();
            Image::from_8bit(64, 48, &pixels).unwrap()
        };
        [picture(&plain), picture(&noisy)]
    }

    /// Made-up content with edges, gradients, noise, and values outside 0..1.
    pub(crate) fn picture(width: u32, height: u32, seed: u64) -> Image {
        let mut state = seed;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f32::from(u16::try_from(state >> 48).unwrap()) / 65_536.0
        };
        let mut pixels = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let edge = if (x / 7 + y / 5) % 2 == 0 { 0.7 } else { 0.1 };
                let gradient =
                    f32::from(u16::try_from(x).unwrap()) / f32::from(u16::try_from(width).unwrap());
                pixels.push([edge + 0.1 * noise(), gradient, 1.4 * noise() - 0.2]);
            }
        }
        Image { width, height, pixels }
    }
}
