//! The reference rasteriser: 3DGS's rules on the processor.
//!
//! `project` turns Gaussians into ellipses on screen, `order` sorts them by depth, `tiles` lists for
//! every tile the splats that may touch it, and `blend` draws the tiles. Every step works in parallel on pieces
//! whose borders and order do not depend on the number of threads. It uses only operations that round the same
//! everywhere. A picture therefore has the same bits on any machine.

mod blend;
mod grid;
mod math;
mod moments;
mod order;
mod project;
mod sensitivity;
mod tiles;
#[cfg(all(test, feature = "gpu"))]
pub(crate) mod twin;

use lexisplat::ShDegree;
use lexisplat::simd::Simd;
use web_time::Instant;

use crate::camera::Camera;
use crate::conventions::TILE;
use crate::error::Result;
use crate::image::Image;
use crate::parallel::*;
use crate::radiance::Radiance;
use crate::scene::Scene;

#[cfg(feature = "gpu")]
pub(crate) use moments::{Moments, SUMS};
pub(crate) use project::Projection;
#[cfg(feature = "gpu")]
pub(crate) use sensitivity::carry;
pub use sensitivity::sensitivity;

/// How to draw. Whether the anti-aliased rules apply is a mark of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct RenderOptions {
    /// Colour behind the scene, 0 to 1 in each channel. Black by default.
    pub background: [f32; 3],
    /// Highest SH degree to draw with; bands above it are left out. By default all that the scene has count.
    pub max_degree: Option<ShDegree>,
}

impl RenderOptions {
    /// These options with another background.
    #[must_use]
    pub fn with_background(self, background: [f32; 3]) -> Self {
        Self { background, ..self }
    }

    /// These options with another highest SH degree; `None` draws all that the scene has.
    #[must_use]
    pub fn with_max_degree(self, max_degree: Option<ShDegree>) -> Self {
        Self { max_degree, ..self }
    }
}

/// A picture, and measurements of drawing it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Drawn {
    /// The picture.
    pub image: Image,
    /// Number of Gaussians that may touch it.
    pub gaussians: usize,
    /// The stages in order, each with its time in milliseconds.
    pub stage_times: Vec<(&'static str, f64)>,
}

/// Draws `scene` as `camera` sees it.
///
/// Leaves out Gaussians with values that are not finite, or that overflow on the way to the screen.
///
/// # Errors
/// [`Error::Codec`](crate::Error::Codec) if the scene's arrays do not fit one another;
/// [`Error::Parameter`](crate::Error::Parameter) if the camera cannot be drawn with.
pub fn render(scene: &Scene<'_>, camera: &Camera, options: &RenderOptions) -> Result<Image> {
    Ok(render_measured(scene, camera, options)?.image)
}

/// Draws as [`render`] does, and measures it.
///
/// # Errors
/// As [`render`].
pub fn render_measured(scene: &Scene<'_>, camera: &Camera, options: &RenderOptions) -> Result<Drawn> {
    scene.validate()?;
    camera.validate()?;
    let projection = Projection::new(camera, scene.meta().antialiased);
    Ok(draw(scene, &projection, options, tiles::MAX_ENTRIES))
}

/// Times the stages of a picture.
struct StageTimer {
    start: Instant,
    times: Vec<(&'static str, f64)>,
}

impl StageTimer {
    fn start() -> Self {
        Self { start: Instant::now(), times: Vec::new() }
    }

    /// Adds the time since the last call to that of `stage`.
    fn end(&mut self, stage: &'static str) {
        let now = Instant::now();
        let milliseconds = now.duration_since(self.start).as_secs_f64() * 1e3;
        match self.times.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += milliseconds,
            None => self.times.push((stage, milliseconds)),
        }
        self.start = now;
    }
}

/// Draws with at most `max_entries` in the tiles' lists at once.
fn draw(scene: &Scene<'_>, projection: &Projection, options: &RenderOptions, max_entries: u64) -> Drawn {
    let mut stages = StageTimer::start();
    let simd = Simd::current();
    let (camera, grid) = (&projection.camera, projection.grid);
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut pixels = vec![options.background; width * height];
    let radiance = Radiance::new(scene).up_to(options.max_degree);
    let projected = project::project(scene.geometry(), &radiance, projection);
    stages.end("project");
    let splats = order::by_depth(projected);
    stages.end("sort");
    for band in tiles::bands(&splats, grid, max_entries) {
        let lists = tiles::TileLists::new(&splats, grid, band.clone());
        stages.end("tiles");
        let count = band.len() * grid.columns;
        let drawn: Vec<blend::TilePixels> = (0..count)
            .into_par_iter()
            .map(|tile| {
                let (column, row) = (tile % grid.columns, band.start + tile / grid.columns);
                blend::tile(simd, &splats, lists.of(tile), [column, row], options.background)
            })
            .collect();
        let rows = &mut pixels[band.start * TILE * width..(band.end * TILE).min(height) * width];
        rows.par_chunks_mut(width * TILE).enumerate().for_each(|(row, rows)| {
            for (y, line) in rows.chunks_mut(width).enumerate() {
                let tiles = &drawn[row * grid.columns..(row + 1) * grid.columns];
                for (piece, tile) in line.chunks_mut(TILE).zip(tiles) {
                    for (x, pixel) in piece.iter_mut().enumerate() {
                        *pixel = tile.pixel(x, y);
                    }
                }
            }
        });
        stages.end("blend");
    }
    let image = Image { width: camera.width, height: camera.height, pixels };
    Drawn { image, gaussians: splats.len(), stage_times: stages.times }
}

#[cfg(test)]
mod tests {
    use lexisplat::{Geometry, SceneMeta, ShDegree, Splats};
    use proptest::prelude::*;

    use super::*;
    use crate::camera::straight_ahead;

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
        prop::collection::vec(one, 0..120)
    }

    proptest! {
        /// Leaving out what cannot reach the least opacity changes not one bit: it is no rule of its own.
        /// Nor does drawing every row of tiles by itself.
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
            let tight = draw(&Scene::from(&splats), &projection, &options, tiles::MAX_ENTRIES);
            let plain = draw(&Scene::from(&splats), &projection.untightened(), &options, 1);
            prop_assert_eq!(tight.image.pixels, plain.image.pixels);
        }
    }
}
