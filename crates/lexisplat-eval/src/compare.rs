//! Two scenes against each other, view by view.

use std::convert::Infallible;

use lexisplat_render::{Camera, Image, RenderOptions, Scene, render};
use serde::Serialize;

use crate::metrics::{psnr, ssim};

/// How to compare.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct CompareOptions {
    /// Colour behind both scenes, 0 to 1 in each channel. Default black.
    pub background: [f32; 3],
    /// Score the pictures as 8-bit files would give them back, as INRIA's `metrics.py` does, instead of
    /// as drawn. Default no.
    pub eight_bit: bool,
}

impl CompareOptions {
    /// Options with these values.
    #[must_use]
    pub fn new(background: [f32; 3], eight_bit: bool) -> Self {
        Self { background, eight_bit }
    }
}

/// Scores of one view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewScore {
    /// The camera's name.
    pub name: String,
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
    /// Peak signal-to-noise ratio in dB; `None`, in JSON `null`, if the pictures are identical.
    pub psnr: Option<f64>,
    /// Structural similarity; 1 if the pictures are identical.
    pub ssim: f64,
    /// Whether the pictures do not differ at all once clipped to \[0, 1\].
    pub identical: bool,
}

/// Mean, least and greatest of a score. All `None`, in JSON `null`, if no view has one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Summary {
    /// Arithmetic mean.
    pub mean: Option<f64>,
    /// Least.
    pub min: Option<f64>,
    /// Greatest.
    pub max: Option<f64>,
}

/// Scores of all views. As JSON it holds finite numbers and `null` only.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Over the views whose pictures are **not** identical: an identical view has no PSNR, so it
    /// cannot raise the mean. [`Self::identical_views`] says how many were left out.
    pub psnr: Summary,
    /// Over all views.
    pub ssim: Summary,
    /// Whether there are views and all are identical.
    pub identical: bool,
    /// Views whose pictures are identical.
    pub identical_views: usize,
    /// Whether the pictures went through 8 bits before they were scored.
    pub eight_bit: bool,
    /// Every view, in the cameras' order.
    pub views: Vec<ViewScore>,
}

/// One compared view, as a callback gets it.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// Position in the list of cameras, from 0.
    pub index: usize,
    /// The camera.
    pub camera: &'a Camera,
    /// What it sees of the first scene, as scored.
    pub a: &'a Image,
    /// What it sees of the second scene, as scored.
    pub b: &'a Image,
    /// The scores.
    pub score: &'a ViewScore,
}

/// Draws `a` and `b` from every camera and scores the pictures.
///
/// # Panics
/// As [`render`].
#[must_use]
pub fn compare(a: &Scene<'_>, b: &Scene<'_>, cameras: &[Camera], options: &CompareOptions) -> Comparison {
    let done = compare_with(a, b, cameras, options, |_| Ok::<(), Infallible>(()));
    match done {
        Ok(comparison) => comparison,
        Err(never) => match never {},
    }
}

/// [`compare`], which calls `on_view` after every view, in order; to save pictures or show progress.
///
/// # Errors
/// The first error of `on_view`, at once.
///
/// # Panics
/// As [`render`].
pub fn compare_with<E>(
    a: &Scene<'_>,
    b: &Scene<'_>,
    cameras: &[Camera],
    options: &CompareOptions,
    mut on_view: impl FnMut(&View<'_>) -> Result<(), E>,
) -> Result<Comparison, E> {
    let mut views = Vec::with_capacity(cameras.len());
    let render_options = RenderOptions { background: options.background };
    let draw = |scene: &Scene<'_>, camera: &Camera| {
        let image = render(scene, camera, &render_options);
        if options.eight_bit { through_8bit(&image) } else { image }
    };
    for (index, camera) in cameras.iter().enumerate() {
        let (a, b) = (draw(a, camera), draw(b, camera));
        let score = score(camera, &a, &b);
        on_view(&View { index, camera, a: &a, b: &b, score: &score })?;
        views.push(score);
    }
    Ok(summarise(views, options.eight_bit))
}

fn through_8bit(image: &Image) -> Image {
    let pixels = image.to_8bit().iter().map(|pixel| pixel.map(|byte| f32::from(byte) / 255.0)).collect();
    Image { width: image.width, height: image.height, pixels }
}

fn score(camera: &Camera, a: &Image, b: &Image) -> ViewScore {
    let psnr = psnr(a, b);
    let ssim = if psnr.is_none() { 1.0 } else { ssim(a, b) };
    let Camera { name, width, height, .. } = camera;
    ViewScore { name: name.clone(), width: *width, height: *height, psnr, ssim, identical: psnr.is_none() }
}

fn summarise(views: Vec<ViewScore>, eight_bit: bool) -> Comparison {
    let identical_views = views.iter().filter(|view| view.identical).count();
    Comparison {
        psnr: summary(views.iter().filter_map(|view| view.psnr)),
        ssim: summary(views.iter().map(|view| view.ssim)),
        identical: !views.is_empty() && identical_views == views.len(),
        identical_views,
        eight_bit,
        views,
    }
}

fn summary(values: impl Iterator<Item = f64> + Clone) -> Summary {
    let count = values.clone().count();
    Summary {
        mean: (count > 0).then(|| values.clone().sum::<f64>() / count as f64),
        min: values.clone().min_by(f64::total_cmp),
        max: values.max_by(f64::total_cmp),
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::Splats;
    use lexisplat::sample::{SampleOptions, scene};
    use lexisplat_render::orbit;

    use super::*;

    fn pair() -> (Splats, Splats, Vec<Camera>) {
        let a = scene(&SampleOptions::new(800, 0));
        let mut b = a.clone();
        b.sh_rest.iter_mut().for_each(|v| *v *= 0.8);
        let mut cameras = orbit(&a.geometry, 3, 60, 40);
        // One that looks away: nothing to see, so the pictures are identical.
        let mut away = cameras[0].clone();
        away.position = [0.0, -500.0, 0.0];
        away.rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
        away.name = "away".to_owned();
        cameras.insert(1, away);
        (a, b, cameras)
    }

    #[test]
    fn identical_views_have_no_psnr_and_do_not_count() {
        let (a, b, cameras) = pair();
        let found = compare(&Scene::from(&a), &Scene::from(&b), &cameras, &CompareOptions::default());
        assert_eq!((found.identical, found.identical_views, found.views.len()), (false, 1, 4));
        assert!(found.views[1].identical && found.views[1].psnr.is_none());
        let others: Vec<f64> = found.views.iter().filter_map(|v| v.psnr).collect();
        assert_eq!(others.len(), 3);
        assert!((found.psnr.mean.unwrap() - others.iter().sum::<f64>() / 3.0).abs() < 1e-12);
        assert!(found.psnr.min <= found.psnr.mean && found.psnr.mean <= found.psnr.max);
        assert_eq!(found.ssim.max, Some(1.0));
    }

    #[test]
    fn json_never_holds_what_is_no_number() {
        let (a, b, cameras) = pair();
        let (a, b) = (Scene::from(&a), Scene::from(&b));
        for (a, b, cameras) in [(a, b, &cameras[..]), (a, a, &cameras[..]), (a, b, &[])] {
            let found = compare(&a, &b, cameras, &CompareOptions::default());
            let json = serde_json::to_value(&found).unwrap();
            assert_eq!(json["psnr"]["mean"].is_null(), found.identical || cameras.is_empty());
            for (view, score) in json["views"].as_array().unwrap().iter().zip(&found.views) {
                assert_eq!(view["identical"], score.identical);
                assert_eq!(view["psnr"].is_null(), score.identical);
                assert!(view["ssim"].is_number());
            }
        }
    }

    #[test]
    fn eight_bits_change_the_score_a_little_and_callbacks_can_stop() {
        let (a, b, cameras) = pair();
        let (a, b) = (Scene::from(&a), Scene::from(&b));
        let float = compare(&a, &b, &cameras, &CompareOptions::default()).psnr.mean.unwrap();
        let bytes = compare(&a, &b, &cameras, &CompareOptions::new([0.0; 3], true)).psnr.mean.unwrap();
        assert!(float != bytes && (float - bytes).abs() < 0.2, "{float} {bytes}");
        let mut seen = Vec::new();
        let stopped = compare_with(&a, &b, &cameras, &CompareOptions::default(), |view| {
            seen.push((view.index, view.camera.name.clone()));
            if view.index == 1 { Err("full") } else { Ok(()) }
        });
        assert_eq!(stopped, Err("full"));
        assert_eq!(seen.len(), 2);
    }
}
