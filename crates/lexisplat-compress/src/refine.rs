//! Fits the Gaussians that stay to the pictures of the original: positions, shapes, opacities and colours.
//!
//! Fewer Gaussians then show what all of them showed. The steps are those of Adam (Kingma and Ba, "Adam: a method for
//! stochastic optimization", 2015), one view a step. A Gaussian moves only in steps whose view shows it (docs/METHOD.md, "Refining").

use lexisplat::sh::{C0, MAX_REST, rest_basis};
use lexisplat::simd::Simd;
use lexisplat::{Progress, Sensitivity, Splats, Stage};
use lexisplat_render::{Camera, Differentiator, GaussianGradient, Image, PictureGradient};
use rayon::prelude::*;

use crate::decibels::decibels;
use crate::effort::{Refine, RefineSteps};
use crate::error::Result;
use crate::fit_pictures::fit_pictures;

/// Weights of the past in the moving averages of Adam. The second is smaller than the usual 0.999, since a Gaussian takes
/// few steps.
const FIRST: f32 = 0.9;
const SECOND: f32 = 0.99;
/// Added to roots of averages, so that divisions are finite.
const TINY: f32 = 1e-15;
/// Sizes of the first steps: of positions as a share of the [extent](extent) of the cameras, of the logarithms of scales, of
/// quaternions, of the logits of opacities, and of SH coefficients. They come from those of 3DGS training (INRIA
/// `arguments/__init__.py`) and were tuned on bonsai-3dgs (docs/METHOD.md, "Refining").
const POSITION: f32 = 1.5e-5;
const SCALES: f32 = 1.25e-2;
const ROTATION: f32 = 2.5e-3;
const OPACITY: f32 = 4.5e-2;
const BASE_COLOUR: f32 = 1.5e-2;
const REST: f32 = 1.1e-3;
/// Share of the first steps' size that the last steps have.
const LAST: f32 = 0.1;
/// Bits of the codes of a Gaussian's SH-rest each time its length doubles, about.
const REST_BITS: f32 = 10.0;
/// Squared error of pictures that is worth a bit, in squares of the overall step. Each value is coded to an error of about
/// one square, and one more bit quarters the error: `2 ln 2`.
const ERROR_OF_A_BIT: f32 = 1.386;
/// Number of values of a Gaussian without its SH-rest.
const PLAIN: usize = 14;
/// Error that a step of all values at once adds to pictures, as a share of their root mean squared error before. With half of it
/// the fit of bonsai-3dgs gains 0.3 dB less (docs/METHOD.md, "Refining").
const ADDED: f64 = 0.3;
/// Largest size of a step of a value, as a multiple of the usual size. With a limit of 8 the fit of bonsai-3dgs gains 0.7 dB less.
const MOST_SHARE: f32 = 2.0;

/// The values that change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Free {
    /// All values.
    All,
    /// SH-rest, base colours and opacities.
    Radiance,
    /// Base colours and opacities.
    Appearance,
}

/// The cost of SH-rest in bits, which makes short rows pay.
pub(crate) struct RestCost {
    /// Root of the sensitivity of pictures to the colour of each Gaussian, over the overall step.
    per_step: Vec<f32>,
    /// The overall step.
    step: f64,
}

impl RestCost {
    /// Returns the cost at an overall `step`. `colour` is the sensitivity of pictures to the colour of each Gaussian.
    pub(crate) fn new(colour: impl Iterator<Item = f32>, step: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "a factor")]
        let per_step = colour.map(|s| (f64::from(s).sqrt() / step) as f32).collect();
        Self { per_step, step }
    }

    /// Returns the factor on the SH-rest of Gaussian `i` in the gradient of its cost. The row has this `length`. Errors are
    /// sums over three channels.
    fn slope(&self, i: usize, length: f32) -> f32 {
        let per_step = self.per_step.get(i).copied().unwrap_or_default();
        #[expect(clippy::cast_possible_truncation, reason = "a factor")]
        let error_of_a_bit = 3.0 * ERROR_OF_A_BIT * (self.step * self.step) as f32;
        // The cost is `REST_BITS * log2(1 + per_step * length)`.
        let bits = REST_BITS * std::f32::consts::LOG2_E * per_step / (1.0 + per_step * length);
        error_of_a_bit * bits / length.max(f32::MIN_POSITIVE.sqrt())
    }
}

/// Sizes of the steps of each Gaussian, as multiples of the usual sizes: of its [`PLAIN`] values, then of its SH-rest.
///
/// Values on which pictures depend much move less, so that no value adds more error than another. With the usual sizes for all
/// Gaussians fits of 800 steps gain 0.5 dB less on bonsai-3dgs and 0.2 dB less on room-large.
pub(crate) struct StepShares(Vec<[f32; PLAIN + 1]>);

impl StepShares {
    /// Returns the sizes for `splats`, whose pictures have this `sensitivity` and a PSNR of `decibels`.
    fn new(splats: &Splats, sensitivity: &Sensitivity, decibels: f64, usual: &Sizes) -> Self {
        let values = splats.len() * (PLAIN + splats.degree.rest());
        #[expect(clippy::cast_possible_truncation, reason = "an error")]
        let error = (ADDED * libm::pow(10.0, -decibels / 20.0) / (values.max(1) as f64).sqrt()) as f32;
        let of = |i: usize| {
            let Sensitivity { colour, opacity, position, scale, rotation, .. } = sensitivity;
            let [xx, _, _, yy, _, zz] = position[i];
            // A quaternion of unit length turns by twice its change.
            let turn = 4.0 * rotation[i].iter().copied().fold(0.0, f32::max);
            // The logarithm of the opacity changes by this much of the change of the logit.
            let clear = 1.0 / (1.0 + splats.geometry.opacities[i].exp());
            let [base, logit] = [C0 * C0 * colour[i], clear * clear * opacity[i]];
            let [x, y, z] = scale[i];
            let all = [xx, yy, zz, x, y, z, turn, turn, turn, turn, logit, base, base, base, base];
            let usual = usual.plain.into_iter().chain([usual.rest]);
            let mut shares = [MOST_SHARE; PLAIN + 1];
            for ((share, sensitivity), usual) in shares.iter_mut().zip(all).zip(usual) {
                // Where nothing depends on a value, the quotient is not finite.
                let own = error / (sensitivity.sqrt() * usual);
                *share = if own < MOST_SHARE { own } else { MOST_SHARE };
            }
            shares
        };
        Self((0..splats.len()).into_par_iter().map(of).collect())
    }
}

/// The views and pictures that a scene is fitted to.
pub(crate) struct Refining {
    cameras: Vec<Camera>,
    /// The pictures of the original, of 8 bits.
    targets: Vec<Vec<[u8; 3]>>,
    /// Numbers of steps of the fits.
    pub(crate) steps: RefineSteps,
}

impl Refining {
    /// Draws pictures of `splats` from `cameras`, to fit to with this `effort`.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(crate) fn to(
        splats: &Splats,
        cameras: Vec<Camera>,
        effort: Refine,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let targets = fit_pictures(splats, &cameras, progress)?;
        let pixels: usize = targets.iter().map(Vec::len).sum();
        let steps = effort.steps(pixels as f64 / targets.len().max(1) as f64, splats.len());
        Ok(Self { cameras, targets, steps })
    }

    /// Returns the sizes of steps for [`Self::refine`] of all values of `splats`, whose pictures have this `sensitivity` and a
    /// PSNR of `decibels`.
    pub(crate) fn shares(&self, splats: &Splats, sensitivity: &Sensitivity, decibels: f64) -> StepShares {
        StepShares::new(splats, sensitivity, decibels, &Sizes::new(Free::All, extent(&self.cameras)))
    }

    /// Fits the `free` values of `splats` in `steps` steps. Short rows of SH-rest pay by `cost`. Steps have the usual sizes, or
    /// those of `shares`.
    ///
    /// # Errors
    /// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
    pub(crate) fn refine(
        &self,
        splats: &mut Splats,
        free: Free,
        steps: usize,
        cost: &RestCost,
        shares: Option<&StepShares>,
        progress: &dyn Progress,
    ) -> Result<()> {
        if self.cameras.is_empty() {
            return Ok(());
        }
        let mut differentiator = Differentiator::default();
        let mut adam = Adam::new(splats);
        let sizes = Sizes::new(free, extent(&self.cameras));
        progress.begin(Stage::Refine, steps as u64);
        // The squared error of a pixel, a mean over about one round of the views.
        let mut error = 0.0;
        for step in 0..steps {
            progress.check()?;
            let view = order(step, self.cameras.len());
            let camera = &self.cameras[view];
            let [width, height] = camera.picture_size();
            let target = Image::from_8bit(width, height, &self.targets[view])?;
            let gradient = differentiator.gradient(splats, camera, &target)?;
            adam.step(splats, &gradient, &sizes.after(step, steps), cost, shares);
            error += (gradient.loss - error) / (step + 1).min(self.cameras.len()) as f64;
            if let Some(decibels) = decibels(error, 1) {
                progress.quality(decibels);
            }
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
/// (`scene/dataset_readers.py`, `getNerfppNorm`).
fn extent(cameras: &[Camera]) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "a number of cameras")]
    let number = cameras.len() as f32;
    let middle: [f32; 3] =
        std::array::from_fn(|k| cameras.iter().map(|c| c.position[k]).sum::<f32>() / number);
    let distance =
        |camera: &Camera| (0..3).map(|k| (camera.position[k] - middle[k]).powi(2)).sum::<f32>().sqrt();
    1.1 * cameras.iter().map(distance).fold(0.0, f32::max)
}

/// The sizes of a step; 0 for values that stay.
#[derive(Clone, Copy)]
struct Sizes {
    plain: [f32; PLAIN],
    rest: f32,
}

impl Sizes {
    fn new(free: Free, extent: f32) -> Self {
        let shape = if free == Free::All { 1.0 } else { 0.0 };
        let sizes = [
            (3, shape * POSITION * extent),
            (3, shape * SCALES),
            (4, shape * ROTATION),
            (1, OPACITY),
            (3, BASE_COLOUR),
        ];
        let mut all = sizes.into_iter().flat_map(|(count, size)| std::iter::repeat_n(size, count));
        let rest = if free == Free::Appearance { 0.0 } else { REST };
        Self { plain: std::array::from_fn(|_| all.next().unwrap_or_default()), rest }
    }

    /// Returns the sizes of step `step` of `steps`.
    #[expect(clippy::cast_precision_loss, reason = "a share of steps")]
    fn after(self, step: usize, steps: usize) -> Self {
        let rate = LAST.powf(step as f32 / steps as f32);
        Self { plain: self.plain.map(|size| rate * size), rest: rate * self.rest }
    }
}

/// The values of all Gaussians and the moving averages of their derivatives.
struct Adam {
    /// Number of values of a Gaussian.
    width: usize,
    /// For each Gaussian: the number of its steps, its values, the averages of derivatives, the averages of their squares.
    all: Vec<f32>,
    /// Number of the row of each Gaussian in the gradient, or [`NONE`].
    rows: Vec<u32>,
    /// Number of steps.
    steps: f32,
}

const NONE: u32 = u32::MAX;

impl Adam {
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
        Self { width, all, rows: vec![NONE; splats.len()], steps: 0.0 }
    }

    /// Moves the Gaussians of a gradient, and writes them to `splats`.
    fn step(
        &mut self,
        splats: &mut Splats,
        PictureGradient { gaussians, rows, .. }: &PictureGradient,
        sizes: &Sizes,
        cost: &RestCost,
        shares: Option<&StepShares>,
    ) {
        self.steps += 1.0;
        for (k, &i) in (0..).zip(gaussians) {
            self.rows[i as usize] = k;
        }
        let (width, degree, all_steps) = (self.width, splats.degree, self.steps);
        let (simd, per_channel) = (Simd::current(), degree.rest_per_channel().max(1));
        let own = self.all.par_chunks_exact_mut(1 + 3 * width).zip(&self.rows);
        own.enumerate().for_each(|(i, (own, &row))| {
            let Some(row) = rows.get(row as usize) else { return };
            let shares = shares.map_or([1.0; PLAIN + 1], |shares| shares.0[i]);
            let (steps, values) = own.split_at_mut(1);
            steps[0] += 1.0;
            let (values, averages) = values.split_at_mut(width);
            let (first, second) = averages.split_at_mut(width);
            let bias = [1.0 - FIRST.powf(steps[0]), 1.0 - SECOND.powf(steps[0])];
            let GaussianGradient { position, scales, rotation, opacity, dc, colour, direction } = row;
            let plain =
                [&position[..], scales, rotation, std::slice::from_ref(opacity), dc].into_iter().flatten();
            for (k, &derivative) in plain.enumerate().filter(|&(k, _)| sizes.plain[k] > 0.0) {
                let size = shares[k] * sizes.plain[k];
                moved(&mut values[k], [&mut first[k], &mut second[k]], derivative, size, bias);
            }
            if sizes.rest > 0.0 {
                let basis = rest_basis(degree, *direction);
                let mut data = [0.0; MAX_REST];
                for (data, by_colour) in data.chunks_exact_mut(per_channel).zip(colour) {
                    data.iter_mut().zip(&basis).for_each(|(data, basis)| *data = by_colour * basis);
                }
                let length = values[PLAIN..].iter().map(|v| v * v).sum::<f32>().sqrt();
                // The cost counts in every step, and the Gaussian moves only in those that show it.
                let slope = cost.slope(i, length) * all_steps / steps[0];
                let size = shares[PLAIN] * sizes.rest;
                let [values, first, second] = [values, first, second].map(|all| &mut all[PLAIN..]);
                simd.dispatch(
                    #[inline(always)]
                    || {
                        let averages = first.iter_mut().zip(second);
                        for ((value, data), (first, second)) in values.iter_mut().zip(&data).zip(averages) {
                            moved(value, [first, second], data + slope * *value, size, bias);
                        }
                    },
                );
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

/// Moves a value against its derivative by about `size`, and updates the averages of its derivatives and of their squares.
/// `bias` has the weights that the averages have gathered.
#[inline(always)]
fn moved(value: &mut f32, [first, second]: [&mut f32; 2], derivative: f32, size: f32, bias: [f32; 2]) {
    *first += (1.0 - FIRST) * (derivative - *first);
    *second += (1.0 - SECOND) * (derivative * derivative - *second);
    *value -= size * (*first / bias[0]) / ((*second / bias[1]).sqrt() + TINY);
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::sync::Mutex;

    use lexisplat::Silent;
    use lexisplat_render::{Renderer, orbit};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::Judge;

    /// Half of a scene, and the fit of it to pictures of the whole.
    fn half(steps: usize) -> (Splats, Splats, Refining) {
        let all = scene(&SampleOptions::new(400, 3));
        let mut some = all.clone();
        some.retain(&(0..400).map(|i| i % 2 == 0).collect::<Vec<_>>());
        let mut refining =
            Refining::to(&all, orbit(&all.geometry, 8, 96, 72), Refine::Quick, &Silent).unwrap();
        refining.steps.all = steps;
        (all, some, refining)
    }

    /// The qualities that were told.
    #[derive(Default)]
    struct Told(Mutex<Vec<f64>>);

    impl Progress for Told {
        fn quality(&self, decibels: f64) {
            self.0.lock().unwrap().push(decibels);
        }
    }

    #[test]
    fn views_come_once_a_round_in_changing_order() {
        for views in [1, 2, 7, 12] {
            let round = |k: usize| (0..views).map(|i| order(k * views + i, views)).collect::<Vec<_>>();
            assert!((0..5).all(|k| round(k).into_iter().collect::<HashSet<_>>().len() == views), "{views}");
            assert!(views < 3 || round(0) != round(1), "{views}");
        }
    }

    #[test]
    fn the_fit_brings_pictures_nearer_to_the_original() {
        let (all, some, refining) = half(160);
        let views = orbit(&all.geometry, 5, 96, 72);
        let mut judge = Judge::new(Renderer::cpu(), &all, &views, true, &Silent).unwrap();
        let free = RestCost::new(std::iter::repeat_n(0.0, 200), 1.0);
        let mut fitted = [Free::All, Free::Radiance, Free::Appearance].map(|values| {
            let (mut splats, told) = (some.clone(), Told::default());
            refining.refine(&mut splats, values, 160, &free, None, &told).unwrap();
            let told = told.0.into_inner().unwrap();
            assert!(told.len() == 160 && told[159] > told[7] + 1.0, "{told:?}");
            (judge.score(&splats, &Silent).unwrap().mean, splats)
        });
        let before = judge.score(&some, &Silent).unwrap().mean;
        let quality = [0, 1, 2].map(|k| fitted[k].0);
        assert!(
            quality[0] > quality[1] && quality[1] > quality[2] && quality[2] > before + 1.0,
            "{before} {quality:?}"
        );
        // Values that are not free stay.
        let kept = |splats: &Splats| {
            let g = &splats.geometry;
            (g.positions.clone(), g.scales.clone(), g.rotations.clone())
        };
        assert!(kept(&fitted[0].1) != kept(&some) && kept(&fitted[1].1) == kept(&some));
        assert_eq!(fitted[2].1.sh_rest, some.sh_rest);
        // A cost makes rows of SH-rest shorter.
        let length = |splats: &Splats| splats.sh_rest.iter().map(|v| f64::from(v * v)).sum::<f64>();
        let cost = RestCost::new(std::iter::repeat_n(1e-4, 200), 1e-3);
        refining.refine(&mut fitted[2].1, Free::Radiance, 160, &cost, None, &Silent).unwrap();
        assert!(length(&fitted[2].1) < 0.9 * length(&fitted[1].1));
    }

    #[test]
    fn a_step_of_all_values_adds_a_known_error() {
        let splats = scene(&SampleOptions::new(300, 3));
        let mut sensitivity = Sensitivity::guess(&splats.geometry);
        sensitivity.colour[7] = 0.0;
        let usual = Sizes::new(Free::All, 4.0);
        // At so many decibels no size is limited, but that of a value which shows nowhere.
        let (decibels, rest) = (200.0, splats.degree.rest());
        let StepShares(shares) = StepShares::new(&splats, &sensitivity, decibels, &usual);
        let mut error = 0.0;
        for (i, shares) in shares.iter().enumerate() {
            let moved = |k: usize| f64::from(shares[k] * usual.plain.get(k).unwrap_or(&usual.rest));
            let squared = |k: usize| moved(k) * moved(k);
            if i == 7 {
                assert_eq!((shares[11], shares[PLAIN]), (MOST_SHARE, MOST_SHARE));
                continue;
            }
            let clear = 1.0 - 1.0 / (1.0 + f64::from(-splats.geometry.opacities[i]).exp());
            let colour = f64::from(C0 * C0 * sensitivity.colour[i]);
            error += colour * (3.0 * squared(11) + rest as f64 * squared(PLAIN))
                + f64::from(sensitivity.opacity[i]) * clear * clear * squared(10)
                + (0..3).map(|k| f64::from(sensitivity.scale[i][k]) * squared(3 + k)).sum::<f64>()
                + [0, 3, 5]
                    .map(|k| f64::from(sensitivity.position[i][k]))
                    .iter()
                    .zip(0..)
                    .map(|(s, k)| s * squared(k))
                    .sum::<f64>();
            // The largest of the three turns counts for the four numbers of the quaternion.
            let turn = sensitivity.rotation[i].iter().copied().fold(0.0, f32::max);
            error += f64::from(4.0 * turn) * 4.0 * squared(6);
        }
        let expected = ADDED * ADDED * libm::pow(10.0, -decibels / 10.0) * 299.0 / 300.0;
        assert!((error / expected - 1.0).abs() < 0.01, "{error:e} {expected:e}");
        // At few decibels all sizes are limited.
        let StepShares(shares) = StepShares::new(&splats, &sensitivity, 0.0, &usual);
        assert!(shares.iter().flatten().all(|&share| share == MOST_SHARE));
    }

    #[test]
    fn threads_change_nothing() {
        let (_, some, refining) = half(20);
        let fitted = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut splats = some.clone();
            let cost = RestCost::new(std::iter::repeat_n(1e-6, 200), 1e-3);
            pool.install(|| refining.refine(&mut splats, Free::All, 20, &cost, None, &Silent)).unwrap();
            splats
        };
        assert_eq!(fitted(1), fitted(3));
    }
}
