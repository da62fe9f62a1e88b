//! Pictures as linear functions of the Gaussians' colours.
//!
//! A pixel is the sum over Gaussians of weight times colour. The weights, A, depend on geometry and opacity alone. Fitting
//! colours to pictures takes products with A and with its adjoint, and both take about as long as drawing.

use lexisplat::simd::Simd;
use lexisplat::{Progress, Stage};

use crate::camera::Camera;
use crate::conventions::{TILE, TRANSMITTANCE_MIN};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::radiance::Radiance;
use crate::scene::Scene;

use super::blend::{BLOCKS, Canvas, SIDE, Tile};
use super::lanes::{LANES, Lanes};
use super::measured_tiles::{Pool, Scratch, measure_tiles};
use super::project::Projection;
use super::trace::Trace;
use super::workspace::Workspace;

/// What the pictures of a scene lack, carried back to its Gaussians.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ColourErrors {
    /// For each Gaussian the sum over pixels of its weight times what the target has more than the picture.
    pub errors: Vec<[f32; 3]>,
    /// For each Gaussian the sum of its row of the matrix A* A: its weights times those of all Gaussians.
    pub row_sums: Vec<f32>,
}

/// The pictures of a scene over black as linear functions A of its Gaussians' colours.
#[derive(Debug)]
pub struct ColourAdjoint<'a> {
    scene: Scene<'a>,
    cameras: &'a [Camera],
    workspace: Workspace,
    pool: Pool,
}

impl<'a> ColourAdjoint<'a> {
    /// The pictures of `scene` from `cameras`.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn new(scene: Scene<'a>, cameras: &'a [Camera]) -> Result<Self> {
        scene.validate()?;
        cameras.iter().try_for_each(Camera::validate)?;
        Ok(Self { scene, cameras, workspace: Workspace::default(), pool: Pool::default() })
    }

    /// Returns the adjoint of A times the errors of the pictures: what `targets`, one for each camera, have more than
    /// them. Both are clamped to 0 to 1. Sums are averaged over the pixels of a view, and over the views.
    ///
    /// Reports [`Stage::Draw`], in views, to `progress`, and asks it before each view whether to stop.
    ///
    /// # Errors
    /// [`Error::Parameter`] if a target is missing or has another size than its camera;
    /// [`Error::Codec`](crate::Error::Codec) if `progress` cancelled the work.
    pub fn of_errors(&mut self, targets: &[Image], progress: &dyn Progress) -> Result<ColourErrors> {
        if targets.len() != self.cameras.len() {
            return Err(Error::parameter("targets", targets.len(), "one for each camera"));
        }
        for (camera, target) in self.cameras.iter().zip(targets) {
            if (camera.width, camera.height) != (target.width, target.height) {
                let size = format!("{} x {}", target.width, target.height);
                return Err(Error::parameter("target", size, "the size of its camera's pictures"));
            }
        }
        let radiance = Radiance::new(&self.scene);
        let light = |canvas: &Canvas, view: usize, tile: Tile| errors(canvas, &targets[view], tile);
        let sums = self.apply(&radiance, light, progress)?;
        Ok(ColourErrors {
            errors: sums.iter().map(|&[r, g, b, _]| [r, g, b]).collect(),
            row_sums: sums.iter().map(|&[.., row]| row).collect(),
        })
    }

    /// Returns the adjoint of A times A times `colours`, one row for each Gaussian, averaged as in [`Self::of_errors`].
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are more or fewer rows than Gaussians; [`Error::Codec`](crate::Error::Codec) if
    /// `progress` cancelled the work.
    pub fn of_pictures(&mut self, colours: &[[f32; 3]], progress: &dyn Progress) -> Result<Vec<[f32; 3]>> {
        if colours.len() != self.scene.len() {
            return Err(Error::parameter("colours", colours.len(), "one row for each Gaussian"));
        }
        let light =
            |canvas: &Canvas, _: usize, _: Tile| canvas.blocks.map(|column| column.map(|block| block.colour));
        self.apply(&Radiance::of_colours(colours), light, progress)
    }

    /// The adjoint of A times `light`, which is worked out for each tile of each view after it was drawn.
    fn apply<const N: usize>(
        &mut self,
        radiance: &Radiance<'_>,
        light: impl Fn(&Canvas, usize, Tile) -> Light<N> + Sync,
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; N]>> {
        let simd = Simd::current();
        let mut sums = vec![[0.0_f32; N]; self.scene.len()];
        progress.begin(Stage::Draw, self.cameras.len() as u64);
        for (view, camera) in self.cameras.iter().enumerate() {
            progress.check()?;
            let projection = Projection::new(camera, self.scene.meta().antialiased);
            let [width, height] = projection.size();
            #[expect(clippy::cast_precision_loss, reason = "a count of pixels, to single precision")]
            let share = 1.0 / (width as f32 * height as f32 * self.cameras.len() as f32);
            let Workspace { visible, order, .. } = &mut self.workspace;
            visible.project(&mut order.keys, simd, self.scene.geometry(), radiance, &projection);
            measure_tiles(
                &mut self.workspace,
                &self.pool,
                &projection,
                |splats, list, tile, Scratch { canvas, trace }| {
                    trace.clear();
                    simd.dispatch(
                        #[inline(always)]
                        || {
                            canvas.draw_watched::<false>(splats, list, tile, trace);
                            weighted(trace, tile, &light(canvas, view, tile))
                        },
                    )
                },
                |gaussian, part: [f32; N]| {
                    sums[gaussian].iter_mut().zip(part).for_each(|(sum, value)| *sum += value * share);
                },
            );
            progress.advance(1);
        }
        progress.end();
        Ok(sums)
    }
}

/// `N` values for each pixel of a tile, by column and row of blocks.
type Light<const N: usize> = [[[Lanes; N]; BLOCKS]; BLOCKS];

/// What the pixels of `target` have more than those of a finished tile, and the sum of all weights there; 0 beyond the
/// border.
#[inline(always)]
fn errors(picture: &Canvas, target: &Image, tile: Tile) -> Light<4> {
    let mut light = [[[[0.0; LANES]; 4]; BLOCKS]; BLOCKS];
    let width = target.width as usize;
    let [left, top] = tile.corner();
    for (y, row) in target.pixels.chunks_exact(width.max(1)).skip(top).take(TILE).enumerate() {
        for (x, pixel) in row.iter().skip(left).take(TILE).enumerate() {
            let lane = y % SIDE * SIDE + x % SIDE;
            let [column, row] = [x / SIDE, y / SIDE];
            let (block, light) = (&picture.blocks[column][row], &mut light[column][row]);
            for channel in 0..3 {
                let drawn = block.colour[channel][lane];
                light[channel][lane] = pixel[channel].clamp(0.0, 1.0) - drawn.clamp(0.0, 1.0);
            }
            light[3][lane] = 1.0 - block.open[lane];
        }
    }
    light
}

/// Returns for each splat in `trace` the sum over pixels of its weight times the `light` there, by the Gaussian's index.
#[inline(always)]
fn weighted<const N: usize>(trace: &Trace, tile: Tile, light: &Light<N>) -> Vec<(u32, [f32; N])> {
    let mut out = Vec::with_capacity(trace.splats.len());
    let mut open: [[Lanes; BLOCKS]; BLOCKS] =
        std::array::from_fn(|column| std::array::from_fn(|row| tile.inside(column, row)));
    for same in trace.marks.chunk_by(|a, b| a.splat == b.splat) {
        let mut sums = [[0.0_f32; LANES]; N];
        for mark in same {
            let [column, row] = mark.block.map(|k| usize::from(k) % BLOCKS);
            let (open, light) = (&mut open[column][row], &light[column][row]);
            for lane in 0..LANES {
                let alpha = mark.alpha[lane];
                let left = open[lane] * (1.0 - alpha);
                let shows = left >= TRANSMITTANCE_MIN;
                let weight = if shows { alpha * open[lane] } else { 0.0 };
                open[lane] = if shows { left } else { 0.0 };
                for channel in 0..N {
                    sums[channel][lane] += weight * light[channel][lane];
                }
            }
        }
        let splat = &trace.splats[same[0].splat as usize];
        out.push((splat.gaussian, sums.map(|lanes| lanes.iter().sum())));
    }
    out
}

#[cfg(test)]
mod tests {
    use lexisplat::{Silent, Splats};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::cpu::{RenderOptions, render};
    use crate::orbit::orbit;

    fn dot(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    }

    /// A scene of one colour from everywhere, and the pictures of it.
    fn flat(splats: &Splats, colours: &[[f32; 3]]) -> Splats {
        let mut flat = splats.with_degree_cut(lexisplat::ShDegree::ZERO);
        let dc = |c: &[f32; 3]| c.map(|v| (v - lexisplat::sh::COLOUR_OFFSET) / lexisplat::sh::C0);
        flat.geometry.dc = colours.iter().map(dc).collect();
        flat
    }

    /// `<x, A* A x>` is the sum of squares of the pictures of x, which the renderer draws too.
    #[test]
    fn products_agree_with_pictures() {
        let splats = scene(&SampleOptions::new(400, 3));
        let colours: Vec<[f32; 3]> =
            splats.geometry.positions.iter().map(|p| p.map(|v| (v * 3.0).sin().abs() * 0.3)).collect();
        let cameras = orbit(&splats.geometry, 3, 70, 50);
        let drawn = flat(&splats, &colours);
        let picture =
            |camera: &Camera| render(&Scene::from(&drawn), camera, &RenderOptions::default()).unwrap();
        let pictures: Vec<Image> = cameras.iter().map(picture).collect();
        let squares: f64 = pictures.iter().map(|image| dot(&image.pixels, &image.pixels)).sum();
        let pixels = (3 * 70 * 50) as f64;
        let mut adjoint = ColourAdjoint::new(Scene::from(&drawn), &cameras).unwrap();
        let product = dot(&adjoint.of_pictures(&colours, &Silent).unwrap(), &colours);
        assert!((product * pixels / squares - 1.0).abs() < 1e-4, "{product} {squares}");
        // The errors of a picture against twice itself are that picture, as long as nothing is clamped.
        let twice = |mut image: Image| {
            assert!(image.pixels.as_flattened().iter().all(|v| *v < 0.5));
            image.pixels.as_flattened_mut().iter_mut().for_each(|v| *v *= 2.0);
            image
        };
        let targets: Vec<Image> = pictures.into_iter().map(twice).collect();
        let ColourErrors { errors, row_sums } = adjoint.of_errors(&targets, &Silent).unwrap();
        let errors = dot(&errors, &colours);
        assert!((errors / product - 1.0).abs() < 1e-4, "{errors} {product}");
        let rows = adjoint.of_pictures(&vec![[1.0; 3]; splats.len()], &Silent).unwrap();
        for (found, row) in row_sums.iter().zip(rows) {
            // The last light of a finished pixel, 1e-4 at most, counts as a weight.
            assert!((found - row[0]).abs() <= 1e-3 * row[0], "{found} {row:?}");
        }
        assert!(adjoint.of_errors(&targets[1..], &Silent).is_err());
        assert!(adjoint.of_pictures(&colours[1..], &Silent).is_err());
    }
}
