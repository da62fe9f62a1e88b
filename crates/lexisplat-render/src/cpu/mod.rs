//! The reference rasteriser: the rules of 3DGS on the processor.
//!
//! `visible` finds the Gaussians that may be visible, and `project` turns them into ellipses on screen. `order` sorts
//! them by depth, `tiles` lists for every tile the splats that may touch it, and `blend` draws the tiles. `moments`
//! measures how a tile changes with its splats, and `change` carries these measurements over to the values of Gaussians.
//! `adjoint` is for fitting colours, opacities and sizes to pictures.
//!
//! Every step works in parallel on pieces whose borders and order do not depend on the number of threads, and uses only
//! operations that round the same everywhere. A picture therefore has the same bits on any machine.

mod adjoint;
mod blend;
mod change;
mod clusters;
mod gradient;
mod grid;
mod lanes;
mod math;
mod measured_tiles;
mod moments;
mod order;
mod painting;
#[cfg(feature = "gpu")]
mod parts;
mod project;
mod sensitivity;
mod splat;
mod tiles;
mod to_world;
mod trace;
#[cfg(all(test, feature = "gpu"))]
pub(crate) mod twin;
mod visible;
mod workspace;

use lexisplat::ShDegree;

use crate::camera::Camera;
use crate::error::Result;
use crate::image::Image;
use crate::radiance::Radiance;
use crate::scene::Scene;

pub use adjoint::{GaussianChange, PictureAdjoint, PictureErrors};
#[cfg(feature = "gpu")]
pub(crate) use change::carry;
pub use gradient::{Differentiator, GaussianGradient, PictureGradient};
#[cfg(feature = "gpu")]
pub(crate) use moments::{Moments, SUMS};
use painting::{Painting, StageTimer};
#[cfg(feature = "gpu")]
pub use parts::CpuScene;
pub(crate) use project::Projection;
pub use sensitivity::sensitivity;
pub(crate) use workspace::Workspace;

/// Options of drawing. Whether the rules for anti-aliasing apply is a mark of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct RenderOptions {
    /// Colour behind the scene, each channel from 0 to 1. Black by default.
    pub background: [f32; 3],
    /// Highest SH degree to draw; bands above it are left out. By default all degrees of the scene are drawn.
    pub max_degree: Option<ShDegree>,
}

impl RenderOptions {
    /// Returns these options with another background.
    #[must_use]
    pub fn with_background(self, background: [f32; 3]) -> Self {
        Self { background, ..self }
    }

    /// Returns the colour behind the scene in a picture from `camera`.
    pub(crate) fn behind(&self, camera: &Camera) -> [f32; 3] {
        camera.background.unwrap_or(self.background)
    }

    /// Returns these options with another highest SH degree; `None` draws all degrees of the scene.
    #[must_use]
    pub fn with_max_degree(self, max_degree: Option<ShDegree>) -> Self {
        Self { max_degree, ..self }
    }
}

/// A picture, and measurements of its drawing.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Drawn {
    /// The picture.
    pub image: Image,
    /// Number of Gaussians that may touch the picture.
    pub gaussians: usize,
    /// The stages in order, each with its duration in milliseconds.
    pub stage_times: Vec<(&'static str, f64)>,
}

/// Draws `scene` as `camera` sees it.
///
/// Gaussians with values that are not finite, or that overflow in the projection, are left out.
///
/// # Errors
/// [`Error::Codec`](crate::Error::Codec) if the lengths of the scene's arrays do not match;
/// [`Error::Parameter`](crate::Error::Parameter) if the camera is not valid.
pub fn render(scene: &Scene<'_>, camera: &Camera, options: &RenderOptions) -> Result<Image> {
    Ok(render_measured(scene, camera, options)?.image)
}

/// Draws like [`render`], and measures the drawing.
///
/// # Errors
/// As [`render`].
pub fn render_measured(scene: &Scene<'_>, camera: &Camera, options: &RenderOptions) -> Result<Drawn> {
    render_with(&mut Workspace::default(), scene, camera, options)
}

/// Draws like [`render_measured`], in the memory of `workspace`.
pub(crate) fn render_with(
    workspace: &mut Workspace,
    scene: &Scene<'_>,
    camera: &Camera,
    options: &RenderOptions,
) -> Result<Drawn> {
    scene.validate()?;
    camera.validate()?;
    let projection = Projection::new(camera, scene.meta().antialiased);
    Ok(draw(workspace, scene, &projection, options, tiles::MAX_ENTRIES))
}

/// Draws with at most `max_entries` entries in the lists of tiles at once.
fn draw(
    workspace: &mut Workspace,
    scene: &Scene<'_>,
    projection: &Projection,
    options: &RenderOptions,
    max_entries: u64,
) -> Drawn {
    let stages = StageTimer::start();
    let radiance = Radiance::new(scene).up_to(options.max_degree);
    workspace.project(scene, &radiance, projection);
    let mut painting = Painting::begin(workspace, projection.clone(), options, max_entries, stages);
    while painting.advance(workspace) {}
    painting.finish()
}

#[cfg(test)]
mod tests {
    use lexisplat::{Geometry, SceneMeta, ShDegree, Splats};
    use lexisplat_sample::{SampleOptions, scene};
    use proptest::prelude::*;

    use super::*;
    use crate::camera::straight_ahead;
    use crate::orbit::orbit;
    use crate::tile_set::TileSet;

    type Gaussian = ([f32; 3], [f32; 3], [f32; 4], f32);

    /// Numbers from `low` to `high`; proptest's own ranges fail an assertion of theirs once in a while.
    fn within(low: f32, high: f32) -> impl Strategy<Value = f32> {
        #[expect(clippy::cast_precision_loss, reason = "24 bits are exact")]
        (0_u32..1 << 24).prop_map(move |v| low + (high - low) * (v as f32 / (1 << 24) as f32))
    }

    fn gaussians() -> impl Strategy<Value = Vec<Gaussian>> {
        let position = [within(-3.0, 3.0), within(-3.0, 3.0), within(0.1, 8.0)];
        let scale = prop::array::uniform3(within(-9.0, 2.5));
        let one = (position, scale, prop::array::uniform4(within(-1.0, 1.0)), within(-6.0, 9.0));
        prop::collection::vec(one, 0..200)
    }

    /// Pictures from inside and outside, some of them of some tiles, and Gaussians of equal depth.
    #[test]
    fn clusters_change_nothing() {
        let mut splats = scene(&SampleOptions::new(3000, 2));
        splats.append(splats.clone());
        let mut views = orbit(&splats.geometry, 5, 300, 200);
        for (k, view) in (0..).zip(views.clone()) {
            let mut inside = view.clone();
            inside.position = inside.position.map(|v| 0.2 * v);
            let set = TileSet::new(300, 200, |column, row| (column + row + k).is_multiple_of(5));
            views.extend([inside.clone(), inside.with_tiles(set.clone()), view.with_tiles(set)]);
        }
        let options = RenderOptions::default();
        let mut clustered = Workspace::of_scene(&splats.geometry);
        for view in &views {
            let plain = render(&Scene::from(&splats), view, &options).unwrap();
            let drawn = render_with(&mut clustered, &Scene::from(&splats), view, &options).unwrap().image;
            assert!(plain == drawn, "{view:?}");
        }
    }

    proptest! {
        /// Leaving out what cannot reach the least opacity changes not one bit: it is no rule of its own.
        /// Nor does drawing every row of tiles by itself, or projecting clusters.
        #[test]
        fn tightening_changes_nothing(
            gaussians in gaussians(),
            antialiased: bool,
            (width, height) in (1_u32..1000, 1_u32..70),
            focal in within(5.0, 2000.0),
        ) {
            let mut geometry = Geometry::default();
            for (position, scale, rotation, opacity) in gaussians {
                geometry.positions.push(position);
                geometry.dc.push(position);
                geometry.scales.push(scale);
                geometry.rotations.push(rotation);
                geometry.opacities.push(opacity);
            }
            let meta = SceneMeta { antialiased, ..SceneMeta::default() };
            let splats = Splats { geometry, degree: ShDegree::ZERO, sh_rest: Vec::new(), meta };
            let options = RenderOptions { background: [0.3, 0.6, 0.9], ..RenderOptions::default() };
            let projection = Projection::new(&straight_ahead(width, height, focal), antialiased);
            let mut workspace = Workspace::default();
            let mut clustered = Workspace::of_scene(&splats.geometry);
            let mut draw = |projection: &Projection, max_entries| {
                let drawn = draw(&mut workspace, &Scene::from(&splats), projection, &options, max_entries);
                let again = draw(&mut clustered, &Scene::from(&splats), projection, &options, max_entries);
                assert_eq!((&again.image, again.gaussians), (&drawn.image, drawn.gaussians), "by clusters");
                drawn
            };
            let tight = draw(&projection, tiles::MAX_ENTRIES);
            let plain = draw(&projection.clone().untightened(), 1);
            prop_assert_eq!(&tight.image.pixels, &plain.image.pixels);
            // Some tiles have the bits that they have in the whole picture, in bands of any size.
            let set = TileSet::new(width, height, |column, row| (column + 2 * row) % 3 == 1 || row == 2);
            if !set.tiles().is_empty() {
                let camera = projection.camera.clone().with_tiles(set.clone());
                let some = Projection::new(&camera, antialiased);
                for max_entries in [1, tiles::MAX_ENTRIES] {
                    let drawn = draw(&some, max_entries).image;
                    prop_assert_eq!(drawn, set.cut(&tight.image, options.background));
                }
            }
        }
    }
}
