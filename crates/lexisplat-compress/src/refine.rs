//! Fits everything of the Gaussians that stay to the pictures of the original: positions, shapes, opacities and colours.
//!
//! Fewer Gaussians then show what all of them showed. The steps are those of Adam (Kingma and Ba, 2015), one view a step, with the
//! rates of 3DGS training (INRIA `arguments/__init__.py`) for the positions at its end. A Gaussian moves only in steps whose view
//! shows it.

use lexisplat::sh::{CHANNELS, rest_basis};
use lexisplat::{Progress, Splats, Stage};
use lexisplat_render::{Camera, Differentiator, GaussianGradient, Image, PictureGradient, Renderer, Scene};
use rayon::prelude::*;

use crate::drawing::{DrawOptions, draw_views};
use crate::error::Result;

/// Factors of the two moving averages of Adam. The second is shorter than usual, since a Gaussian takes few steps.
const FIRST: f32 = 0.9;
const SECOND: f32 = 0.99;
/// What keeps divisions finite.
const TINY: f32 = 1e-15;
/// Sizes of the first steps. Positions move by a share of the distances between cameras.
const POSITION: f32 = 3e-5;
const SCALES: f32 = 7.5e-3;
const ROTATION: f32 = 1.5e-3;
const OPACITY: f32 = 1.5e-2;
const BASE_COLOUR: f32 = 3.75e-3;
const REST: f32 = 3.75e-4;
/// Share of the first steps' size that the last steps have.
const LAST: f32 = 0.1;
/// Number of values of a Gaussian without its SH-rest.
const PLAIN: usize = 14;

/// The views and pictures that a scene is fitted to.
pub(crate) struct Refining {
    cameras: Vec<Camera>,
    targets: Vec<Image>,
}

impl Refining {
    /// Draws pictures of `splats` from `cameras`, to fit to.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(crate) fn to(splats: &Splats, cameras: Vec<Camera>, progress: &dyn Progress) -> Result<Self> {
        let (mut cpu, options) = (Renderer::cpu(), DrawOptions::default());
        let targets = draw_views(&mut cpu, &Scene::from(splats), &cameras, &options, progress)?;
        Ok(Self { cameras, targets })
    }

    /// Fits `splats` in `steps` steps.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(crate) fn refine(&self, splats: &mut Splats, steps: usize, progress: &dyn Progress) -> Result<()> {
        if self.cameras.is_empty() {
            return Ok(());
        }
        let mut differentiator = Differentiator::default();
        let mut fitted = Fitted::new(splats);
        let extent = extent(&self.cameras);
        progress.begin(Stage::Draw, steps as u64);
        for step in 0..steps {
            progress.check()?;
            let view = order(step, self.cameras.len());
            let PictureGradient { gaussians, rows, .. } =
                differentiator.gradient(splats, &self.cameras[view], &self.targets[view])?;
            #[expect(clippy::cast_precision_loss, reason = "a share of steps")]
            let rate = LAST.powf(step as f32 / steps as f32);
            fitted.step(splats, &gaussians, &rows, &rates(rate, extent));
            progress.advance(1);
        }
        progress.end();
        Ok(())
    }
}

/// Returns the view of a step. Each round takes every view once, in another order.
fn order(step: usize, views: usize) -> usize {
    let (round, within) = (step / views, step % views);
    // A stride without common divisors with the number of views meets each view once.
    let stride = (round * 2 + views / 3..).find(|&stride| gcd(stride, views) == 1).unwrap_or(1);
    (within * stride + round) % views
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Returns the largest distance of a camera from the middle of all cameras, and a tenth more, as INRIA's trainer does
/// (`getNerfppNorm`).
fn extent(cameras: &[Camera]) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "a number of cameras")]
    let number = cameras.len() as f32;
    let middle: [f32; 3] =
        std::array::from_fn(|k| cameras.iter().map(|c| c.position[k]).sum::<f32>() / number);
    let distance =
        |camera: &Camera| (0..3).map(|k| (camera.position[k] - middle[k]).powi(2)).sum::<f32>().sqrt();
    1.1 * cameras.iter().map(distance).fold(0.0, f32::max)
}

/// Returns the sizes of a step, for each of the [`PLAIN`] values and for SH-rest.
fn rates(rate: f32, extent: f32) -> ([f32; PLAIN], f32) {
    let sizes = [(3, POSITION * extent), (3, SCALES), (4, ROTATION), (1, OPACITY), (3, BASE_COLOUR)];
    let mut all = sizes.into_iter().flat_map(|(count, size)| std::iter::repeat_n(rate * size, count));
    (std::array::from_fn(|_| all.next().unwrap_or_default()), rate * REST)
}

/// The values of all Gaussians and the moving averages of their derivatives.
struct Fitted {
    /// Number of values of a Gaussian.
    width: usize,
    /// For each Gaussian: the number of its steps, its values, the averages of derivatives, the averages of their squares.
    all: Vec<f32>,
    /// Number of the row of each Gaussian in the gradient, or [`NONE`].
    rows: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Fitted {
    fn new(splats: &Splats) -> Self {
        let rest = splats.degree.rest();
        let width = PLAIN + rest;
        let mut all = vec![0.0; splats.len() * (1 + 3 * width)];
        for (i, own) in all.chunks_exact_mut(1 + 3 * width).enumerate() {
            let g = &splats.geometry;
            let plain = [&g.positions[i][..], &g.scales[i], &g.rotations[i], &[g.opacities[i]], &g.dc[i]];
            let values = plain.into_iter().flatten().chain(&splats.sh_rest[i * rest..(i + 1) * rest]);
            own[1..].iter_mut().zip(values).for_each(|(own, value)| *own = *value);
        }
        Self { width, all, rows: vec![NONE; splats.len()] }
    }

    /// Moves the Gaussians of a gradient, and writes them to `splats`.
    fn step(
        &mut self,
        splats: &mut Splats,
        gaussians: &[u32],
        rows: &[GaussianGradient],
        rates: &([f32; PLAIN], f32),
    ) {
        for (k, &i) in (0..).zip(gaussians) {
            self.rows[i as usize] = k;
        }
        let (width, degree) = (self.width, splats.degree);
        let own = self.all.par_chunks_exact_mut(1 + 3 * width).zip(&self.rows);
        own.for_each(|(own, &row)| {
            let Some(row) = rows.get(row as usize) else { return };
            let (steps, values) = own.split_at_mut(1);
            steps[0] += 1.0;
            let (values, averages) = values.split_at_mut(width);
            let (first, second) = averages.split_at_mut(width);
            let (a, b) = (1.0 - FIRST.powf(steps[0]), 1.0 - SECOND.powf(steps[0]));
            let mut go = |k: usize, derivative: f32, size: f32| {
                first[k] += (1.0 - FIRST) * (derivative - first[k]);
                second[k] += (1.0 - SECOND) * (derivative * derivative - second[k]);
                values[k] -= size * (first[k] / a) / ((second[k] / b).sqrt() + TINY);
            };
            let GaussianGradient { position, scales, rotation, opacity, dc, colour, direction } = row;
            let plain = [&position[..], scales, rotation, &[*opacity], dc];
            for (k, &derivative) in plain.into_iter().flatten().enumerate() {
                go(k, derivative, rates.0[k]);
            }
            let per_channel = degree.rest_per_channel();
            let basis = rest_basis(degree, *direction);
            for c in 0..CHANNELS {
                for k in 0..per_channel {
                    go(PLAIN + c * per_channel + k, colour[c] * basis[k], rates.1);
                }
            }
        });
        let rest = degree.rest();
        for &i in gaussians {
            let i = i as usize;
            self.rows[i] = NONE;
            let values = &self.all[i * (1 + 3 * width) + 1..][..width];
            let g = &mut splats.geometry;
            g.positions[i].copy_from_slice(&values[..3]);
            g.scales[i].copy_from_slice(&values[3..6]);
            g.rotations[i].copy_from_slice(&values[6..10]);
            g.opacities[i] = values[10];
            g.dc[i].copy_from_slice(&values[11..14]);
            splats.sh_rest[i * rest..(i + 1) * rest].copy_from_slice(&values[PLAIN..]);
        }
    }
}
