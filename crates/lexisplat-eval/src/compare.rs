//! Draws two scenes from the same cameras and scores them view by view. No photos are needed.

use lexisplat::{Progress, Stage};
use lexisplat_render::{Camera, Image, Renderer, Scene};

use crate::scorer::Scorer;
use crate::scores::{Comparison, ViewScore};
use lexisplat_compress::{DrawOptions, Error, Result};

/// Draws `a` and `b` with `renderer` from every camera and scores `b` against `a` by PSNR and SSIM.
///
/// Reports [`Stage::Draw`] to `progress`, in views. `on_view` receives each score and the two scored pictures, those of
/// `a` and of `b`. An error of `on_view` ends the comparison.
///
/// # Errors
/// [`Error::Parameter`] if there are no cameras, or a camera is not valid. On a GPU [`Error::Render`] if a scene or a
/// view does not fit. [`Error::Codec`] if `progress` cancels. Errors of `on_view`.
pub fn compare<E: From<Error>>(
    renderer: &mut Renderer,
    a: &Scene<'_>,
    b: &Scene<'_>,
    cameras: &[Camera],
    options: &DrawOptions,
    progress: &dyn Progress,
    mut on_view: impl FnMut(&ViewScore, &Image, &Image) -> Result<(), E>,
) -> Result<Comparison, E> {
    if cameras.is_empty() {
        return Err(Error::parameter("cameras", "none", "at least one view").into());
    }
    let scorer = Scorer::new();
    let a = renderer.prepare(*a).map_err(Error::from)?;
    let b = renderer.prepare(*b).map_err(Error::from)?;
    let mut views = Vec::with_capacity(cameras.len());
    progress.begin(Stage::Draw, cameras.len() as u64);
    for camera in cameras {
        progress.check().map_err(Error::from)?;
        let (image_a, image_b) = (options.draw(renderer, &a, camera)?, options.draw(renderer, &b, camera)?);
        let view = scorer.score(&camera.name, &image_a, &image_b)?;
        on_view(&view, &image_a, &image_b)?;
        views.push(view);
        progress.advance(1);
    }
    progress.end();
    Ok(Comparison::of(views))
}

/// Scores each of `pictures` against its reference. `cameras`, `references` and `pictures` are in the same order. Reports
/// [`Stage::Score`] to `progress`, in views.
///
/// # Errors
/// [`Error::Parameter`] if the lists differ in length, or two pictures in size. [`Error::Codec`] if `progress` cancels.
pub fn score_views(
    scorer: &Scorer,
    cameras: &[Camera],
    references: &[Image],
    pictures: &[Image],
    progress: &dyn Progress,
) -> Result<Comparison> {
    for found in [references.len(), pictures.len()] {
        if found != cameras.len() {
            let expected = format!("one for each of {} cameras", cameras.len());
            return Err(Error::parameter("pictures", found, expected));
        }
    }
    let views = cameras.iter().zip(references.iter().zip(pictures));
    progress.begin(Stage::Score, cameras.len() as u64);
    let scores = views.map(|(camera, (a, b))| {
        progress.check()?;
        let score = scorer.score(&camera.name, a, b);
        progress.advance(1);
        score
    });
    let scores = scores.collect::<Result<Vec<_>>>()?;
    progress.end();
    Ok(Comparison::of(scores))
}
