//! The sharpness that pictures of a scene are meant to have.

use lexisplat::Geometry;
use lexisplat_render::Camera;

use crate::views::DEFAULT_MAX_WIDTH;

/// Median size of a Gaussian on screen, in pixels, in pictures as sharp as the training photographs. The size is the
/// standard deviation: the geometric mean of the two larger ones. Over training views of eight models of three trainers the
/// median is 0.9 to 1.8 (docs/METHOD.md, "How sharp").
const MEDIAN_SIZE: f64 = 1.25;
/// Smallest opacity of a Gaussian that counts, 10 %, before the sigmoid.
const FAINT: f32 = -2.2;
/// Approximate number of sizes over which the median is taken.
const SIZES: usize = 1 << 18;
/// Smallest width, in pixels.
const LEAST_WIDTH: u32 = 192;

/// Returns the width of pictures from `cameras`, in pixels, at which the median size of Gaussians on screen is
/// [`MEDIAN_SIZE`]. All cameras have the same size. The width is at least [`LEAST_WIDTH`] and at most
/// [`DEFAULT_MAX_WIDTH`], as drawn in papers. If no camera sees a Gaussian, the width of the first camera is returned.
pub(crate) fn natural_width(geometry: &Geometry, cameras: &[Camera]) -> u32 {
    let Some(first) = cameras.first() else { return DEFAULT_MAX_WIDTH };
    let step = (geometry.len() * cameras.len()).div_ceil(SIZES).max(1);
    let mut sizes = Vec::new();
    for (k, camera) in cameras.iter().enumerate() {
        // Each camera takes other Gaussians than the one before it.
        for i in (k % step..geometry.len()).step_by(step) {
            sizes.extend(size(geometry, i, camera));
        }
    }
    let middle = sizes.len() / 2;
    if sizes.is_empty() {
        return first.width;
    }
    let (_, &mut median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    let width = f64::from(first.width) * MEDIAN_SIZE / median;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 16 bits")]
    let width = width.clamp(LEAST_WIDTH.into(), DEFAULT_MAX_WIDTH.into()) as u32;
    width
}

/// Returns the size of Gaussian `i` in the picture of `camera`, in pixels; `None` if the Gaussian is outside of the
/// picture, faint or not finite.
fn size(geometry: &Geometry, i: usize, camera: &Camera) -> Option<f64> {
    let [x, y, z] = camera.to_view(geometry.positions[i]).map(f64::from);
    let within = |v: f64, focal: f32, side: u32| (v / z * f64::from(focal)).abs() * 2.0 < f64::from(side);
    let sees = z > f64::from(camera.near)
        && within(x, camera.fx, camera.width)
        && within(y, camera.fy, camera.height)
        && geometry.opacities[i] > FAINT;
    let logs = geometry.scales[i].map(f64::from);
    let least = logs.iter().copied().fold(f64::INFINITY, f64::min);
    let size = libm::exp(0.5 * (logs.iter().sum::<f64>() - least)) / z * f64::from(camera.fx);
    (sees && size > 0.0 && size.is_finite()).then_some(size)
}

#[cfg(test)]
mod tests {
    use lexisplat_render::orbit;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    fn small_ones() -> Geometry {
        let mut geometry = scene(&SampleOptions::new(4000, 3)).geometry;
        geometry.scales.iter_mut().for_each(|scales| *scales = scales.map(|s| s - 1.5));
        geometry
    }

    #[test]
    fn smaller_gaussians_need_sharper_pictures() {
        let mut geometry = small_ones();
        let cameras = orbit(&geometry, 6, 384, 256);
        let mut grow = |by: f32| {
            geometry.scales.iter_mut().for_each(|scales| *scales = scales.map(|s| s + by.ln()));
            natural_width(&geometry, &cameras)
        };
        let width = grow(1.0);
        let [half, same] = [grow(2.0), grow(0.5)];
        assert!(width > 2 * LEAST_WIDTH && width < DEFAULT_MAX_WIDTH / 2, "{width}");
        assert!(half.abs_diff(width / 2) <= 1 && same.abs_diff(width) <= 1, "{half} {same} {width}");
        assert_eq!((grow(1e3), grow(1e-9)), (LEAST_WIDTH, DEFAULT_MAX_WIDTH));
        assert_eq!(natural_width(&Geometry::default(), &cameras), 384);
    }

    #[test]
    fn it_does_not_depend_on_the_unit() {
        let geometry = small_ones();
        let width = |geometry: &Geometry| natural_width(geometry, &orbit(geometry, 6, 384, 256));
        let mut other = geometry.clone();
        other.positions.iter_mut().for_each(|p| *p = p.map(|v| v / 1024.0));
        other.scales.iter_mut().for_each(|s| *s = s.map(|v| v - 1024.0_f32.ln()));
        assert!(width(&other).abs_diff(width(&geometry)) <= 1);
    }
}
