//! Drawing of the pictures that are scored.

use lexisplat::{Progress, ShDegree, Stage};
use lexisplat_render::{Camera, Image, Prepared, RenderOptions, Renderer, Scene};

use crate::error::Result;

/// Options of drawing the pictures that are scored. By default the background is black and values are not rounded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct DrawOptions {
    /// Colour behind the scene, each channel from 0 to 1.
    pub background: [f32; 3],
    /// Whether pictures are rounded to 8 bits, as in saved pictures.
    pub eight_bit: bool,
    /// Highest SH degree to draw; `None` draws all degrees of the scene.
    pub max_degree: Option<ShDegree>,
}

impl DrawOptions {
    /// Returns options with this background and rounding.
    #[must_use]
    pub fn new(background: [f32; 3], eight_bit: bool) -> Self {
        Self { background, eight_bit, max_degree: None }
    }

    /// Returns these options with another highest SH degree.
    #[must_use]
    pub fn with_max_degree(self, max_degree: Option<ShDegree>) -> Self {
        Self { max_degree, ..self }
    }

    /// Draws the view of `scene` from `camera`. `renderer` must have prepared the scene.
    ///
    /// # Errors
    /// [`crate::Error::Render`] as [`Renderer::render`].
    pub fn draw(&self, renderer: &mut Renderer, scene: &Prepared<'_>, camera: &Camera) -> Result<Image> {
        let drawing =
            RenderOptions::default().with_background(self.background).with_max_degree(self.max_degree);
        let image = renderer.render(scene, camera, &drawing)?;
        if !self.eight_bit {
            return Ok(image);
        }
        Ok(Image::from_8bit(image.width, image.height, &image.to_8bit())?)
    }
}

/// Draws `scene` from every camera. Reports [`Stage::Draw`] to `progress`, in views.
///
/// # Errors
/// [`crate::Error::Render`] as [`Renderer::prepare`] and [`Renderer::render`]. [`crate::Error::Codec`] if
/// `progress` cancels.
pub fn draw_views(
    renderer: &mut Renderer,
    scene: &Scene<'_>,
    cameras: &[Camera],
    options: &DrawOptions,
    progress: &dyn Progress,
) -> Result<Vec<Image>> {
    draw_each(renderer, scene, cameras, options, |image| image, progress)
}

/// Draws `scene` from every camera as [`draw_views`] does. Returns the result of `with` for each picture, so that not all
/// pictures need memory at once.
///
/// # Errors
/// As [`draw_views`].
pub(crate) fn draw_each<T>(
    renderer: &mut Renderer,
    scene: &Scene<'_>,
    cameras: &[Camera],
    options: &DrawOptions,
    mut with: impl FnMut(Image) -> T,
    progress: &dyn Progress,
) -> Result<Vec<T>> {
    let prepared = renderer.prepare(*scene)?;
    progress.begin(Stage::Draw, cameras.len() as u64);
    let mut draw = |camera| {
        progress.check()?;
        let image = options.draw(renderer, &prepared, camera)?;
        progress.advance(1);
        Ok(with(image))
    };
    let drawn = cameras.iter().map(&mut draw).collect();
    progress.end();
    drawn
}
