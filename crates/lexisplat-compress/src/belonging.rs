//! Decides whether cameras that were found belong to a scene.

use lexisplat::{Progress, Splats};
use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene, natural_views};

use crate::error::Result;
use crate::found::{detail, sketch};
use crate::signs::shows_almost_nothing;

/// Largest number of views drawn from the cameras, and the same number from natural views. Below: the largest width of
/// their pictures, in pixels.
const DRAWN: usize = 12;
const DRAWN_WIDTH: u32 = 96;
/// Least ratio of the detail of the cameras' pictures to that of natural views. Pictures of a lower ratio are not like
/// photographs. The ratio is 1.36 to 3.7 with the own cameras of six scenes, and 0.35 and 0.97 with cameras of another
/// scene.
const LEAST_DETAIL: f64 = 1.15;

/// Returns whether photographs of `splats` may have been taken by `cameras`. The pictures of most cameras must show
/// something of the scene, and their median detail must exceed that of [`natural_views`]. Cameras of another scene, or in
/// other coordinates, fail.
///
/// # Errors
/// As [`Renderer::render`]; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub fn belong(
    renderer: &mut Renderer,
    splats: &Splats,
    cameras: &[Camera],
    progress: &dyn Progress,
) -> Result<bool> {
    if cameras.len() < 2 || cameras.iter().any(|camera| camera.validate().is_err()) {
        return Ok(false);
    }
    let sketch = sketch(splats);
    let scene = renderer.prepare(Scene::from(&sketch))?;
    let mut drawn = |cameras: Vec<Camera>| -> Result<Vec<Image>> {
        let draw = |camera: Camera| {
            progress.check()?;
            let small = camera.with_max_width(DRAWN_WIDTH);
            Ok(renderer.render(&scene, &small, &RenderOptions::default())?)
        };
        cameras.into_iter().map(draw).collect()
    };
    let pictures = drawn(cameras.iter().step_by(cameras.len().div_ceil(DRAWN)).cloned().collect())?;
    if shows_almost_nothing("", &pictures, RenderOptions::default().background).is_some() {
        return Ok(false);
    }
    let natural = drawn(natural_views(&splats.geometry, DRAWN, NATURAL_SIZE))?;
    Ok(median_detail(&pictures) >= LEAST_DETAIL * median_detail(&natural))
}

/// Width and height of natural views, in pixels.
const NATURAL_SIZE: [u32; 2] = [DRAWN_WIDTH, DRAWN_WIDTH * 2 / 3];

fn median_detail(pictures: &[Image]) -> f64 {
    let mut all: Vec<f64> = pictures.iter().map(detail).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::orbit;
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    #[test]
    fn cameras_elsewhere_do_not_belong() {
        let splats = scene(&SampleOptions::new(1500, 3));
        let cameras = orbit(&splats.geometry, 8, 320, 200);
        let belong = |cameras: &[Camera]| belong(&mut Renderer::cpu(), &splats, cameras, &Silent).unwrap();
        assert!(belong(&cameras));
        let changed = |change: &dyn Fn(&mut Camera)| -> Vec<Camera> {
            let mut cameras = cameras.clone();
            cameras.iter_mut().for_each(change);
            cameras
        };
        // Turned away, and in other units.
        let away = |camera: &mut Camera| {
            camera.rotation = camera.rotation.map(|[right, down, forward]| [-right, down, -forward]);
        };
        assert!(!belong(&changed(&away)));
        let farther = |camera: &mut Camera| camera.position = camera.position.map(|v| 20.0 * v);
        assert!(!belong(&changed(&farther)));
        assert!(!belong(&cameras[..1]));
    }
}
