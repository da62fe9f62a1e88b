//! Signs that cameras do not belong to a scene.

use lexisplat::Geometry;
use lexisplat_render::{Camera, Image, hidden_share};

/// Share of drawn pixels below which a picture shows almost nothing of a scene.
const ALMOST_NOTHING: f64 = 0.02;
/// Largest share of the opacity before cameras that their near planes may hide without a warning. In the models of
/// docs/results the near planes hide nothing.
const HIDDEN: f64 = 0.03;

/// Returns a warning if more than half of `pictures` of the scene `model` show almost nothing but `background`.
#[must_use]
pub fn shows_almost_nothing(model: &str, pictures: &[Image], background: [f32; 3]) -> Option<String> {
    let is_empty = |picture: &&Image| {
        let drawn = picture.pixels.iter().filter(|pixel| **pixel != background).count();
        (drawn as f64) < ALMOST_NOTHING * picture.pixels.len() as f64
    };
    let (empty, all) = (pictures.iter().filter(is_empty).count(), pictures.len());
    (2 * empty > all).then(|| {
        format!(
            "{empty} of {all} views show almost nothing of {model}; check that the cameras belong to this scene and are in its coordinates"
        )
    })
}

/// Returns a warning if the near planes of `cameras` hide more than 3 % of the opacity before them. This happens to a scene
/// in small units that is drawn with the trainer's near plane.
#[must_use]
pub(crate) fn near_plane_hides(geometry: &Geometry, cameras: &[Camera]) -> Option<String> {
    let (share, near) = (hidden_share(geometry, cameras), cameras.first()?.near);
    (share > HIDDEN).then(|| {
        format!(
            "the near plane, {near} units from the cameras, hides {:.0} % of what is before them; if the scene is in small units, a smaller --near shows it",
            100.0 * share
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(drawn: usize) -> Image {
        let pixels = (0..100).map(|i| if i < drawn { [0.5; 3] } else { [1.0; 3] }).collect();
        Image { width: 10, height: 10, pixels }
    }

    #[test]
    fn views_of_nothing_are_told_if_they_are_most() {
        let white = [1.0; 3];
        let warning = shows_almost_nothing("a.ply", &[picture(1), picture(0), picture(50)], white).unwrap();
        assert!(warning.starts_with("2 of 3 views"), "{warning}");
        assert!(shows_almost_nothing("a.ply", &[picture(1), picture(2)], white).is_none());
        assert!(shows_almost_nothing("a.ply", &[picture(0)], [0.0; 3]).is_none(), "another background");
    }

    #[test]
    fn a_near_plane_beyond_the_scene_is_told() {
        let splats = lexisplat_sample::scene(&lexisplat_sample::SampleOptions::new(300, 1));
        let mut small = splats.geometry.clone();
        small.positions.iter_mut().flatten().for_each(|v| *v *= 0.01);
        small.scales.iter_mut().flatten().for_each(|v| *v += 0.01_f32.ln());
        let around = |geometry: &Geometry, near: f32| -> Vec<Camera> {
            let views = lexisplat_render::orbit(geometry, 4, 60, 40);
            views.into_iter().map(|camera| camera.with_near(near)).collect()
        };
        let told = near_plane_hides(&small, &around(&small, 0.2)).unwrap();
        assert!(
            told.starts_with("the near plane, 0.2 units from the cameras, hides") && told.contains("--near"),
            "{told}"
        );
        assert!(near_plane_hides(&small, &around(&small, 0.001)).is_none());
        assert!(near_plane_hides(&splats.geometry, &around(&splats.geometry, 0.2)).is_none());
    }
}
