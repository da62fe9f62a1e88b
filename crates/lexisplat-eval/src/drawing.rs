//! All pictures of a view set, and their scores.

use lexisplat_render::{Camera, Image, RenderOptions, Renderer, Scene};

use crate::compare::Comparison;
use crate::error::{Error, Result};
use crate::scorer::Scorer;

/// How to draw pictures that are scored.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DrawOptions {
    /// Colour behind the scene.
    pub background: [f32; 3],
    /// Whether pictures are rounded to 8 bits, as when they are saved and read back.
    pub eight_bit: bool,
}

/// `scene` as every camera sees it. `on_view` is called after each.
///
/// # Errors
/// What [`Renderer::prepare`] and [`Renderer::render`] say.
pub fn draw_views(
    renderer: &mut Renderer,
    scene: &Scene<'_>,
    cameras: &[Camera],
    options: &DrawOptions,
    on_view: &mut dyn FnMut(),
) -> Result<Vec<Image>> {
    let drawing = RenderOptions::default().with_background(options.background);
    let prepared = renderer.prepare(*scene)?;
    let mut draw = |camera| {
        let image = renderer.render(&prepared, camera, &drawing)?;
        on_view();
        if !options.eight_bit {
            return Ok(image);
        }
        Ok(Image::from_8bit(image.width, image.height, &image.to_8bit())?)
    };
    cameras.iter().map(&mut draw).collect()
}

/// Scores each of `pictures` against its reference; all three lists are in the same order.
///
/// # Errors
/// [`Error::Parameter`] if the lists differ in length, or two pictures in size.
pub fn score_views(
    scorer: &Scorer,
    cameras: &[Camera],
    references: &[Image],
    pictures: &[Image],
) -> Result<Comparison> {
    for found in [references.len(), pictures.len()] {
        if found != cameras.len() {
            return Err(Error::parameter(
                "pictures",
                found,
                format!("one for each of {} cameras", cameras.len()),
            ));
        }
    }
    let views = cameras.iter().zip(references.iter().zip(pictures));
    let scores = views.map(|(camera, (a, b))| scorer.score(&camera.name, a, b));
    Ok(Comparison::of(scores.collect::<Result<Vec<_>>>()?))
}
