//! Signs that cameras or photos do not belong to a scene.

use lexisplat_compress::shows_almost_nothing;
use lexisplat_render::Image;

use crate::scores::Comparison;

/// Mean PSNR against photos below which there is a warning, in dB. Published models reach 20 dB and more on their hardest
/// scenes. A plain grey picture reaches 10 to 14 dB.
const MISFIT_DB: f64 = 15.0;

/// Returns a warning for each sign that cameras do not belong to the scene `model`: most of its `pictures` show almost
/// nothing but `background`, or they are far from the photos.
#[must_use]
pub fn misfit(
    model: &str,
    pictures: &[Image],
    background: [f32; 3],
    to_photos: Option<&Comparison>,
) -> Vec<String> {
    let mut warnings: Vec<String> = shows_almost_nothing(model, pictures, background).into_iter().collect();
    if let Some(mean) = to_photos.and_then(|comparison| comparison.psnr.mean).filter(|&mean| mean < MISFIT_DB)
    {
        warnings.push(format!(
            "{model} has {mean:.1} dB against the photos, and models of the photographed scene have 20 dB or more; check that model, cameras and photos belong to one scene, that the cameras are in its coordinates, and that the background is right"
        ));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::ViewScore;

    #[test]
    fn pictures_far_from_their_photos_are_told() {
        let picture = Image { width: 10, height: 10, pixels: vec![[0.5; 3]; 100] };
        let score = |psnr| Comparison::of(vec![ViewScore::new("v", [10, 10], psnr, 0.5, Default::default())]);
        let warnings = |psnr| misfit("a.ply", std::slice::from_ref(&picture), [1.0; 3], Some(&score(psnr)));
        assert!(warnings(Some(11.2))[0].contains("11.2 dB against the photos"));
        assert!(warnings(Some(19.0)).is_empty() && warnings(None).is_empty());
    }
}
