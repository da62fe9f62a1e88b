//! The gradient of the squared errors of a picture by every value of the Gaussians that it shows.

use lexisplat::Splats;
use lexisplat::simd::Simd;

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::parallel::*;
use crate::radiance::Radiance;
use crate::scene::Scene;

use super::adjoint::{Behind, Light, Shares, errors, summed};
use super::blend::Tile;
use super::lanes::{LANES, Lanes, each};
use super::measured_tiles::{Pool, Scratch, measure_tiles};
use super::project::Projection;
use super::splat::Splat;
use super::tiles::List;
use super::to_world::{OnScreen, ToWorld};
use super::workspace::Workspace;

/// The derivatives of the squared errors of one picture by the values of one Gaussian, in the units of
/// [`Geometry`](lexisplat::Geometry).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GaussianGradient {
    /// By the position.
    pub position: [f32; 3],
    /// By the natural logarithms of the standard deviations.
    pub scales: [f32; 3],
    /// By the quaternion as it is stored, real part first.
    pub rotation: [f32; 4],
    /// By the logit of the opacity.
    pub opacity: f32,
    /// By the base colour.
    pub dc: [f32; 3],
    /// By the colour towards the camera. The derivative by coefficient k of a channel's SH-rest is the k-th basis value times
    /// this.
    pub colour: [f32; 3],
    /// The unit vector from the camera to the Gaussian.
    pub direction: [f32; 3],
}

/// The gradient of one picture.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PictureGradient {
    /// Mean over the drawn pixels of the squared errors, summed over the channels.
    pub loss: f64,
    /// The Gaussians that the picture shows, ascending.
    pub gaussians: Vec<u32>,
    /// The derivatives of `loss` by the values of each of `gaussians`.
    pub rows: Vec<GaussianGradient>,
}

/// Draws pictures and finds their gradients. Memory is kept from one picture to the next.
#[derive(Debug, Default)]
pub struct Differentiator {
    workspace: Workspace,
    pool: Pool,
    sums: Vec<[f32; SUMS]>,
}

/// Sums over the pixels of a splat, with the derivative g of the loss by the logarithm of the opacity at a pixel and the offset d of
/// the centre from the pixel: three derivatives by the colour, then g, g dx, g dy, g dx dx, g dx dy, g dy dy.
pub(super) const SUMS: usize = 9;
/// Index of the sum of g.
const OF_OPACITY: usize = 3;

impl Differentiator {
    /// Returns the gradient of the squared errors of the picture of `splats` from `camera`. An error is the difference
    /// from `target`, with both clamped to 0 to 1; it is carried back as if the picture were not clamped.
    ///
    /// The gradient covers the pixels in which a Gaussian shows, but not those that it reaches only when it grows.
    ///
    /// # Errors
    /// As [`crate::render`]; [`Error::Parameter`] if the target has another size than the camera's pictures.
    pub fn gradient(&mut self, splats: &Splats, camera: &Camera, target: &Image) -> Result<PictureGradient> {
        let scene = Scene::from(splats);
        scene.validate()?;
        camera.validate()?;
        if camera.picture_size() != [target.width, target.height] {
            let size = format!("{} x {}", target.width, target.height);
            return Err(Error::parameter("target", size, "the size of its camera's pictures"));
        }
        let projection = Projection::new(camera, splats.meta.antialiased);
        let [_, drawn] = projection.pixel_counts();
        let radiance = Radiance::new(&scene);
        self.workspace.project(&scene, &radiance, &projection);
        self.sums.resize(splats.len() + 1, [0.0; SUMS]);
        let loss = splats.len();
        let simd = Simd::current();
        let measure =
            |splats: &[Splat], list: List<'_>, tile: Tile, Scratch { canvas, trace }: &mut Scratch| {
                trace.clear();
                simd.dispatch(
                    #[inline(always)]
                    || {
                        canvas.draw_over(splats, list, tile, projection.background(), trace);
                        let light = errors(canvas, target, tile);
                        let [x, y] = tile.coordinates();
                        let mut behind = Behind::all(canvas, &light);
                        let mut found = summed(
                            trace,
                            tile,
                            #[inline(always)]
                            |splat, sums, block, shares| {
                                let [column, row] = block;
                                let light = &light[column][row];
                                let by_opacity = behind.pass(splat, block, shares, light);
                                add(splat, sums, [&x[column], &y[row]], shares, &by_opacity, light);
                            },
                        );
                        let mut own = [0.0; SUMS];
                        own[0] = squares(&light);
                        found.push((index(loss), own));
                        found
                    },
                )
            };
        let sums = &mut self.sums;
        let keep = |gaussian: usize, values: [f32; SUMS]| {
            sums[gaussian].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        };
        measure_tiles(&mut self.workspace, &self.pool, &projection, measure, keep);
        let loss = f64::from(std::mem::take(&mut self.sums[loss])[0]) / f64::from(drawn);
        let slots = &self.workspace.visible.slots;
        let mut shown: Vec<&Splat> =
            self.workspace.order.keys.iter().map(|&(_, slot)| &slots[slot as usize]).collect();
        shown.retain(|splat| self.sums[splat.gaussian as usize] != [0.0; SUMS]);
        shown.sort_unstable_by_key(|splat| splat.gaussian);
        let world = ToWorld::new(&projection);
        // Errors are `target - picture`, and squares have twice their slope.
        let factor = -2.0 / drawn;
        let sums = &self.sums;
        let rows = shown
            .as_slice()
            .into_par_iter()
            .map(|splat| {
                let i = splat.gaussian as usize;
                let on_screen = OnScreen::of(splat, sums[i].map(|sum| factor * sum));
                world.carry(&splats.geometry, splats.degree, splats.rest(i), i, splat, &on_screen)
            })
            .collect();
        let gaussians: Vec<u32> = shown.iter().map(|splat| splat.gaussian).collect();
        for &i in &gaussians {
            self.sums[i as usize] = [0.0; SUMS];
        }
        Ok(PictureGradient { loss, gaussians, rows })
    }
}

/// Returns a number of a Gaussian, of which there are fewer than 2^32.
fn index(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

/// Returns the sum of the squared errors of a tile over pixels and channels.
#[inline(always)]
fn squares(light: &Light<4>) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for block in light.as_flattened() {
        for channel in &block[..3] {
            [sums] = each([&sums, channel], |[sum, v]| [sum + v * v]);
        }
    }
    sums.iter().sum()
}

/// Adds the products of one block's derivatives with its errors to the sums of `splat`. `g` are the products of the
/// derivatives by the logarithm of the opacity.
#[inline(always)]
fn add(
    splat: &Splat,
    sums: &mut [Lanes; SUMS],
    [x, y]: [&Lanes; 2],
    Shares { weights, .. }: &Shares,
    g: &Lanes,
    light: &[Lanes; 4],
) {
    for channel in 0..3 {
        let inputs = [&sums[channel], weights, &light[channel]];
        [sums[channel]] = each(inputs, |[sum, weight, light]| [sum + weight * light]);
    }
    let [px, py] = splat.centre;
    let [gx, gy] = each([g, x, y], |[g, x, y]| [g * (px - x), g * (py - y)]);
    let [gxx, gxy, gyy] =
        each([&gx, &gy, x, y], |[gx, gy, x, y]| [gx * (px - x), gx * (py - y), gy * (py - y)]);
    for (sum, own) in sums[OF_OPACITY..].iter_mut().zip([g, &gx, &gy, &gxx, &gxy, &gyy]) {
        [*sum] = each([&*sum, own], |[sum, own]| [sum + own]);
    }
}
