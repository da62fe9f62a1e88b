//! Products with the derivatives of pictures by the colours, opacities and sizes of Gaussians, and with the adjoint.
//!
//! A pixel is the sum of weight times colour over all Gaussians. It is linear in all colours, and in each single opacity.
//! Fitting colours and opacities to pictures takes products with the matrix J of derivatives and with its adjoint.

use lexisplat::simd::Simd;
use lexisplat::{Progress, Stage};

use crate::camera::Camera;
use crate::conventions::{ALPHA_MAX, DILATION, TILE, TRANSMITTANCE_MIN};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::radiance::Radiance;
use crate::scene::Scene;

use super::blend::{BLOCKS, Canvas, SIDE, Tile};
use super::lanes::{LANES, Lanes, each};
use super::math::mask;
use super::measured_tiles::{KeptView, Pool, Scratch, measure_tiles};
use super::project::Projection;
use super::splat::Splat;
use super::tiles::List;
use super::trace::Trace;
use super::workspace::Workspace;

/// Changes of the values of a Gaussian: of red, green and blue; with four values, also of the natural logarithm of its
/// opacity; with five values, also of the logarithms of its three scales, which change alike.
pub type GaussianChange<const N: usize> = [f32; N];

/// Number of values of a change with the opacity, and of a change with the opacity and the scales.
const WITH_OPACITY: usize = 4;
const WITH_SIZE: usize = 5;

/// The errors of the pictures of a scene, carried back to its Gaussians.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PictureErrors<const N: usize> {
    /// For each Gaussian, the adjoint of J times the errors `target - picture`.
    pub errors: Vec<GaussianChange<N>>,
    /// For each Gaussian, the sum over pixels of its weight times the weights of all Gaussians: the sum of its row of J*
    /// J for one colour channel.
    pub row_sums: Vec<f32>,
    /// For each Gaussian, the sum of the squared derivatives by the logarithm of its opacity: the diagonal of J* J.
    pub opacity_squares: Vec<f32>,
    /// For each Gaussian, the sum of the squared derivatives by the logarithms of its scales: the diagonal of J* J. It is
    /// 0 unless `N` is 5.
    pub size_squares: Vec<f32>,
}

/// The pictures of a scene, and their derivatives J by the colours, opacities and sizes of its Gaussians.
///
/// J covers the pixels in which a Gaussian shows, but not the pixels that the Gaussian reaches only when it grows. In
/// anti-aliased scenes J ignores that the opacity of a Gaussian on screen depends on its size.
#[derive(Debug)]
pub struct PictureAdjoint<'a> {
    scene: Scene<'a>,
    cameras: &'a [Camera],
    workspace: Workspace,
    pool: Pool,
    /// The first views, as many as there is memory for.
    kept: Vec<KeptView>,
    /// Number of bytes that more kept views may have.
    room: u64,
}

impl<'a> PictureAdjoint<'a> {
    /// Returns the pictures of `scene` from `cameras`. Projected Gaussians of the first cameras are kept from one product to
    /// the next, in at most `most_bytes` bytes. Results do not depend on this number.
    ///
    /// # Errors
    /// As [`crate::render`].
    pub fn new(scene: Scene<'a>, cameras: &'a [Camera], most_bytes: u64) -> Result<Self> {
        scene.validate()?;
        cameras.iter().try_for_each(Camera::validate)?;
        let workspace = Workspace::of_scene(scene.geometry());
        Ok(Self { scene, cameras, workspace, pool: Pool::default(), kept: Vec::new(), room: most_bytes })
    }

    /// Returns the adjoint of J times the errors of the pictures. An error is `target - picture`, with both clamped to 0
    /// to 1. There is one of `targets` for each camera. Sums over pixels are divided by the number of pixels of a view,
    /// and averaged over the views.
    ///
    /// Reports [`Stage::Draw`] to `progress`, in views, and asks it before each view whether to stop.
    ///
    /// # Errors
    /// [`Error::Parameter`] if a target is missing or has another size than its camera;
    /// [`Error::Codec`](crate::Error::Codec) if `progress` cancelled the work.
    pub fn of_errors<const N: usize>(
        &mut self,
        targets: &[Image],
        progress: &dyn Progress,
    ) -> Result<PictureErrors<N>> {
        if targets.len() != self.cameras.len() {
            return Err(Error::parameter("targets", targets.len(), "one for each camera"));
        }
        for (camera, target) in self.cameras.iter().zip(targets) {
            if camera.picture_size() != [target.width, target.height] {
                let size = format!("{} x {}", target.width, target.height);
                return Err(Error::parameter("target", size, "the size of its camera's pictures"));
            }
        }
        let sums = self.apply(
            #[inline(always)]
            |canvas, _, view, tile| errors(canvas, &targets[view], tile),
            #[expect(clippy::redundant_closure, reason = "a function item would not be inlined")]
            #[inline(always)]
            |canvas, trace, tile, light| carried_with_squares::<N>(canvas, trace, tile, light),
            progress,
        )?;
        let column = |k: usize| sums.iter().map(|sums| sums[k]).collect();
        Ok(PictureErrors {
            errors: sums.iter().map(|sums| std::array::from_fn(|k| sums[k])).collect(),
            row_sums: column(ROW_SUM),
            opacity_squares: column(OPACITY_SQUARES),
            size_squares: column(SIZE_SQUARES),
        })
    }

    /// Returns the adjoint of J times J times `changes`. There is one change for each Gaussian. Sums are averaged as in
    /// [`Self::of_errors`].
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are more or fewer changes than Gaussians; [`Error::Codec`](crate::Error::Codec) if
    /// `progress` cancelled the work.
    pub fn of_changes<const N: usize>(
        &mut self,
        changes: &[GaussianChange<N>],
        progress: &dyn Progress,
    ) -> Result<Vec<GaussianChange<N>>> {
        if changes.len() != self.scene.len() {
            return Err(Error::parameter("changes", changes.len(), "one for each Gaussian"));
        }
        let cameras = self.cameras;
        self.apply(
            #[inline(always)]
            |canvas, trace, view, tile| changed(canvas, trace, cameras[view].background, tile, changes),
            #[expect(clippy::redundant_closure, reason = "a function item would not be inlined")]
            #[inline(always)]
            |canvas, trace, tile, light| carried(canvas, trace, tile, light),
            progress,
        )
    }

    /// Applies `carry` to each tile of each view after the tile is drawn, with the values that `light` returns for its
    /// pixels. Both must be closures marked `#[inline(always)]`, since nothing else gets the vector instructions.
    fn apply<const N: usize, const M: usize>(
        &mut self,
        light: impl Fn(&Canvas, &Trace, usize, Tile) -> Light<M> + Sync,
        carry: impl Fn(&Canvas, &Trace, Tile, &Light<M>) -> Vec<(u32, [f32; N])> + Sync,
        progress: &dyn Progress,
    ) -> Result<Vec<[f32; N]>> {
        let simd = Simd::current();
        let mut sums = vec![[0.0_f32; N]; self.scene.len()];
        let radiance = Radiance::new(&self.scene);
        progress.begin(Stage::Draw, self.cameras.len() as u64);
        for (view, camera) in self.cameras.iter().enumerate() {
            progress.check()?;
            let projection = Projection::new(camera, self.scene.meta().antialiased);
            let [_, drawn] = projection.pixel_counts();
            #[expect(clippy::cast_precision_loss, reason = "a count of views, to single precision")]
            let share = 1.0 / (drawn * self.cameras.len() as f32);
            let mut spare = None;
            if view >= self.kept.len() {
                self.workspace.project(&self.scene, &radiance, &projection);
                spare = self.keep(view, &projection);
            }
            let measure =
                |splats: &[Splat], list: List<'_>, tile, Scratch { canvas, trace }: &mut Scratch| {
                    trace.clear();
                    simd.dispatch(
                        #[inline(always)]
                        || {
                            canvas.draw_over(splats, list, tile, projection.background(), trace);
                            carry(canvas, trace, tile, &light(canvas, trace, view, tile))
                        },
                    )
                };
            let add = |gaussian: usize, values: [f32; N]| {
                sums[gaussian].iter_mut().zip(values).for_each(|(sum, value)| *sum += value * share);
            };
            match self.kept.get(view).or(spare.as_ref()) {
                Some(kept) => kept.measure(&self.pool, &projection, measure, add),
                None => measure_tiles(&mut self.workspace, &self.pool, &projection, measure, add),
            }
            progress.advance(1);
        }
        progress.end();
        Ok(sums)
    }

    /// Keeps view number `view`, which is projected, if all views before it are kept. Returns it if there is no room for it.
    fn keep(&mut self, view: usize, projection: &Projection) -> Option<KeptView> {
        if view != self.kept.len() || self.room == 0 {
            return None;
        }
        let kept = KeptView::of(&mut self.workspace, projection)?;
        let room = self.room.checked_sub(kept.bytes());
        self.room = room.unwrap_or(0);
        if room.is_none() {
            return Some(kept);
        }
        self.kept.push(kept);
        None
    }
}

/// `N` values for each pixel of a tile, by column and row of blocks.
pub(super) type Light<const N: usize> = [[[Lanes; N]; BLOCKS]; BLOCKS];

/// Returns the errors `target - picture` of the pixels of a finished tile, and the sum of all weights in each pixel. The
/// values are 0 beyond the border.
#[inline(always)]
pub(super) fn errors(picture: &Canvas, target: &Image, tile: Tile) -> Light<4> {
    let mut light = [[[[0.0; LANES]; 4]; BLOCKS]; BLOCKS];
    let width = target.width as usize;
    let [left, top] = tile.drawn();
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

/// Returns J times `changes` at each pixel of a finished tile.
///
/// A change of a splat's opacity changes the weights of the splats behind it and of the background, all by the same factor.
/// The logarithm of that factor is therefore carried from front to back.
#[inline(always)]
fn changed<const N: usize>(
    picture: &Canvas,
    trace: &Trace,
    background: Option<[f32; 3]>,
    tile: Tile,
    changes: &[GaussianChange<N>],
) -> Light<3> {
    let [x, y] = tile.coordinates();
    let mut light = [[[[0.0; LANES]; 3]; BLOCKS]; BLOCKS];
    // Changes of the logarithm of the light that reaches a splat.
    let mut reaching = [[[0.0; LANES]; BLOCKS]; BLOCKS];
    each_mark(
        trace,
        tile,
        #[inline(always)]
        |splat, [column, row], Shares { weights, odds }| {
            let change = &changes[splat.gaussian as usize];
            let light = &mut light[column][row];
            let mut of_weight = [0.0; LANES];
            if N >= WITH_OPACITY {
                let power = power_by_size::<N>(splat, &x[column], &y[row]);
                let [opacity, size] = [3, 4].map(|k| if k < N { change[k] } else { 0.0 });
                let reaching = &mut reaching[column][row];
                [of_weight, *reaching] = each([&*reaching, odds, &power], |[reaching, odds, by_size]| {
                    let of_alpha = if N == WITH_SIZE { opacity + by_size * size } else { opacity };
                    [where_moves(of_alpha, odds) + reaching, reaching - odds * of_alpha]
                });
            }
            for (channel, colour) in splat.colour.into_iter().enumerate() {
                let inputs = [&light[channel], weights, &of_weight];
                [light[channel]] = each(inputs, |[sum, weight, of_weight]| {
                    let by_opacity = if N < WITH_OPACITY { 0.0 } else { colour * of_weight };
                    [sum + weight * (change[channel] + by_opacity)]
                });
            }
        },
    );
    let blocks = picture.blocks.as_flattened().iter().zip(reaching.as_flattened());
    for ((block, reaching), light) in blocks.zip(light.as_flattened_mut()) {
        for (light, behind) in light.iter_mut().zip(background.into_iter().flatten()) {
            let inputs = [&*light, &block.transmittance, reaching];
            [*light] = each(inputs, |[sum, share, of_weight]| [sum + share * behind * of_weight]);
        }
    }
    light
}

/// Returns the adjoint of J times `light`, for each splat in `trace`, with the index of its Gaussian.
#[inline(always)]
fn carried<const N: usize>(
    picture: &Canvas,
    trace: &Trace,
    tile: Tile,
    light: &Light<3>,
) -> Vec<(u32, GaussianChange<N>)> {
    let [x, y] = tile.coordinates();
    let mut behind = Behind::all(picture, light);
    summed(
        trace,
        tile,
        #[inline(always)]
        |splat, sums: &mut [Lanes; N], block, shares| {
            let power = power_by_size::<N>(splat, &x[block[0]], &y[block[1]]);
            add_carried::<N, N, 3>(sums, splat, block, shares, &power, &mut behind, light);
        },
    )
}

/// Indices of sums in the result of [`carried_with_squares`].
const ROW_SUM: usize = 5;
const OPACITY_SQUARES: usize = 6;
const SIZE_SQUARES: usize = 7;

/// Returns the values of [`carried`] for the first three values of `light`, then the sum of weights times the fourth
/// value of `light`, then the sums of the squared derivatives by the opacity and by the size.
#[inline(always)]
fn carried_with_squares<const N: usize>(
    picture: &Canvas,
    trace: &Trace,
    tile: Tile,
    light: &Light<4>,
) -> Vec<(u32, [f32; 8])> {
    let [x, y] = tile.coordinates();
    let mut behind = Behind::all(picture, light);
    // The light that splats behind add to each channel.
    let mut channels: Light<3> = picture.blocks.map(|column| column.map(|block| block.colour));
    summed(
        trace,
        tile,
        #[inline(always)]
        |splat, sums: &mut [Lanes; 8], [column, row], shares| {
            let power = power_by_size::<N>(splat, &x[column], &y[row]);
            add_carried::<N, 8, 4>(sums, splat, [column, row], shares, &power, &mut behind, light);
            sums[ROW_SUM] = products_added(&sums[ROW_SUM], &shares.weights, &light[column][row][3]);
            for (behind, colour) in channels[column][row].iter_mut().zip(splat.colour) {
                let of_channel = [&*behind, &shares.weights, &shares.odds];
                let by_opacity;
                [by_opacity, *behind] = each(of_channel, |[behind, weight, odds]| {
                    by_opacity_and_behind(weight * colour, odds, behind)
                });
                sums[OPACITY_SQUARES] = products_added(&sums[OPACITY_SQUARES], &by_opacity, &by_opacity);
                if N == WITH_SIZE {
                    let [by_size] = each([&by_opacity, &power], |[a, b]| [a * b]);
                    sums[SIZE_SQUARES] = products_added(&sums[SIZE_SQUARES], &by_size, &by_size);
                }
            }
        },
    )
}

/// Adds the products of one block's derivatives with the first three values of `light` to the first `N` of `sums`.
#[inline(always)]
fn add_carried<const N: usize, const SUMS: usize, const M: usize>(
    sums: &mut [Lanes; SUMS],
    splat: &Splat,
    block: [usize; 2],
    shares: &Shares,
    power_by_size: &Lanes,
    behind: &mut Behind,
    light: &Light<M>,
) {
    let own = &light[block[0]][block[1]];
    for channel in 0..3 {
        sums[channel] = products_added(&sums[channel], &shares.weights, &own[channel]);
    }
    if N >= WITH_OPACITY {
        let by_opacity = behind.pass(splat, block, shares, own);
        [sums[3]] = each([&sums[3], &by_opacity], |[sum, v]| [sum + v]);
        if N == WITH_SIZE {
            sums[N - 1] = products_added(&sums[N - 1], &by_opacity, power_by_size);
        }
    }
}

#[inline(always)]
fn products_added(sums: &Lanes, a: &Lanes, b: &Lanes) -> Lanes {
    let [sums] = each([sums, a, b], |[sum, a, b]| [sum + a * b]);
    sums
}

/// For each pixel of a tile, the light that a splat and all splats behind it add, times a value of the pixel, summed over
/// the channels.
pub(super) struct Behind([[Lanes; BLOCKS]; BLOCKS]);

impl Behind {
    /// Returns the light of all splats of `picture` times the first three values of `light`.
    #[inline(always)]
    pub(super) fn all<const M: usize>(picture: &Canvas, light: &Light<M>) -> Self {
        let mut all = [[[0.0; LANES]; BLOCKS]; BLOCKS];
        for (all, (block, light)) in all
            .as_flattened_mut()
            .iter_mut()
            .zip(picture.blocks.as_flattened().iter().zip(light.as_flattened()))
        {
            for (colour, light) in block.colour.iter().zip(light) {
                *all = products_added(all, colour, light);
            }
        }
        Self(all)
    }

    /// Passes `splat` in a block, from front to back. Returns the derivatives of the pixels by the logarithm of the
    /// splat's opacity, times the first three values of `light`, summed over the channels.
    #[inline(always)]
    pub(super) fn pass<const M: usize>(
        &mut self,
        splat: &Splat,
        block: [usize; 2],
        Shares { weights, odds }: &Shares,
        light: &[Lanes; M],
    ) -> Lanes {
        let [r, g, b] = splat.colour;
        let behind = &mut self.0[block[0]][block[1]];
        let inputs = [&*behind, weights, odds, &light[0], &light[1], &light[2]];
        let by_opacity;
        [by_opacity, *behind] = each(inputs, |[behind, weight, odds, red, green, blue]| {
            by_opacity_and_behind(weight * (r * red + g * green + b * blue), odds, behind)
        });
        by_opacity
    }
}

/// Returns the derivative of a pixel by the logarithm of a splat's opacity, and the light that the splats behind it add.
/// `own` is the light that the splat adds, and `behind` the light of the splat and of those behind it.
///
/// A splat of opacity `a` adds its weight times its colour, and passes `1 - a` of the light on to the splats behind it.
/// The derivative by the logarithm of `a` is therefore the splat's own light, less `a / (1 - a)` times the light behind it.
#[inline(always)]
fn by_opacity_and_behind(own: f32, odds: f32, behind: f32) -> [f32; 2] {
    let behind = behind - own;
    [where_moves(own, odds) - odds * behind, behind]
}

/// Returns `value` where `odds` are not 0, otherwise 0.
#[inline(always)]
fn where_moves(value: f32, odds: f32) -> f32 {
    f32::from_bits(value.to_bits() & mask(odds > 0.0))
}

/// Returns sums over the pixels of each splat in `trace`, with the index of its Gaussian. `add` adds the sums of one
/// block.
#[inline(always)]
pub(super) fn summed<const SUMS: usize>(
    trace: &Trace,
    tile: Tile,
    mut add: impl FnMut(&Splat, &mut [Lanes; SUMS], [usize; 2], &Shares),
) -> Vec<(u32, [f32; SUMS])> {
    let mut out: Vec<(u32, [f32; SUMS])> = Vec::with_capacity(trace.splats.len());
    let mut sums = [[0.0_f32; LANES]; SUMS];
    let mut last = None;
    each_mark(
        trace,
        tile,
        #[inline(always)]
        |splat, block, shares| {
            if last != Some(splat.gaussian) {
                out.extend(last.replace(splat.gaussian).map(|gaussian| (gaussian, take(&mut sums))));
            }
            add(splat, &mut sums, block, shares);
        },
    );
    out.extend(last.map(|gaussian| (gaussian, take(&mut sums))));
    out
}

/// Returns the sums over lanes, and sets them to 0.
#[inline(always)]
fn take<const N: usize>(sums: &mut [Lanes; N]) -> [f32; N] {
    std::mem::replace(sums, [[0.0; LANES]; N]).map(
        #[inline(always)]
        |mut lanes| {
            let mut half = LANES / 2;
            while half > 0 {
                (0..half).for_each(|lane| lanes[lane] += lanes[lane + half]);
                half /= 2;
            }
            lanes[0]
        },
    )
}

/// Shares of light that a splat takes in the pixels of a block. Both are 0 where the splat does not show.
pub(super) struct Shares {
    /// The share of all light that the splat takes: the derivatives of a colour channel by the same channel of the splat's
    /// colour.
    pub(super) weights: Lanes,
    /// `a / (1 - a)` for the splat's opacity `a`: the share of the light behind that is lost if the logarithm of `a` grows
    /// by 1. The odds are also 0 where the opacity is cut off at its largest value, because it does not grow there.
    pub(super) odds: Lanes,
}

/// Calls `with` for each mark of `trace`, from front to back, with the splat and the column and row of the block.
#[inline(always)]
fn each_mark(trace: &Trace, tile: Tile, mut with: impl FnMut(&Splat, [usize; 2], &Shares)) {
    let mut open: [[Lanes; BLOCKS]; BLOCKS] =
        std::array::from_fn(|column| std::array::from_fn(|row| tile.inside(column, row)));
    for mark in &trace.marks {
        let splat = &trace.splats[mark.splat as usize];
        let block = mark.block.map(|k| usize::from(k) % BLOCKS);
        let open = &mut open[block[0]][block[1]];
        let [weights, odds, left] = each([&mark.alpha, open], |[alpha, open]| {
            let left = open * (1.0 - alpha);
            let shows = mask(left >= TRANSMITTANCE_MIN);
            let moves = shows & mask(alpha < ALPHA_MAX);
            let [weight, odds] = [alpha * open, alpha / (1.0 - alpha)];
            [(weight, shows), (odds, moves), (left, shows)]
                .map(|(v, mask)| f32::from_bits(v.to_bits() & mask))
        });
        *open = left;
        with(splat, block, &Shares { weights, odds });
    }
}

/// Returns the derivatives of a splat's power at pixels by the logarithms of its three scales, which change alike:
/// `d^T C d - dilation * |C d|^2`, with the conic C and the distance d from the centre. The second term is there because
/// the dilation in the covariance does not grow. Returns 0 unless `N` is [`WITH_SIZE`].
#[inline(always)]
fn power_by_size<const N: usize>(splat: &Splat, x: &Lanes, y: &Lanes) -> Lanes {
    if N != WITH_SIZE {
        return [0.0; LANES];
    }
    let [a, b, c] = splat.conic;
    let [power] = each([x, y], |[x, y]| {
        let (dx, dy) = (splat.centre[0] - x, splat.centre[1] - y);
        let (across, down) = (a * dx + b * dy, b * dx + c * dy);
        [across * dx + down * dy - DILATION * (across * across + down * down)]
    });
    power
}

#[cfg(test)]
mod tests {
    use lexisplat::{Silent, Splats};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::cpu::{RenderOptions, render};
    use crate::orbit::orbit;
    use crate::tile_set::TileSet;

    /// The opacity of every Gaussian of the test's scenes is moved to below this, so that none is cut off.
    const MOST_OPAQUE: f32 = 0.9;

    fn drawn(splats: &Splats, cameras: &[Camera]) -> Vec<Image> {
        let picture = |camera| render(&Scene::from(splats), camera, &RenderOptions::default()).unwrap();
        cameras.iter().map(picture).collect()
    }

    fn logit(x: f32) -> f32 {
        (x / (1.0 - x)).ln()
    }

    fn opacity(logit: f32) -> f32 {
        1.0 / (1.0 + (-logit).exp())
    }

    /// `splats` with `share` of `changes` made to colours and opacities.
    fn with(splats: &Splats, changes: &[GaussianChange<5>], share: f32) -> Splats {
        let mut moved = splats.clone();
        let g = &mut moved.geometry;
        for (i, change) in changes.iter().enumerate() {
            g.dc[i].iter_mut().zip(change).for_each(|(dc, v)| *dc += share * v / lexisplat::sh::C0);
            g.opacities[i] = logit(opacity(g.opacities[i]) * (share * change[3]).exp());
            g.scales[i].iter_mut().for_each(|scale| *scale += share * change[4]);
        }
        moved
    }

    fn dot<const N: usize>(a: &[[f32; N]], b: &[[f32; N]]) -> f64 {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    }

    fn sample() -> (Splats, Vec<Camera>) {
        let mut splats = scene(&SampleOptions::new(400, 3));
        for i in 0..splats.len() {
            let g = &mut splats.geometry;
            g.opacities[i] = g.opacities[i].min(logit(MOST_OPAQUE));
            // Nothing is cut off at 0, and little of the pictures at 1.
            splats.geometry.dc[i] = splats.geometry.dc[i].map(|v| 0.4 * v);
        }
        let splats = splats.with_degree_cut(lexisplat::ShDegree::ZERO);
        let mut cameras = orbit(&splats.geometry, 3, 70, 50);
        cameras[1].background = Some([0.4, 0.1, 0.2]);
        (splats, cameras)
    }

    /// `<x, J* J y>` is the product of the changes of the pictures that x and y make, for changes of colours, of
    /// opacities, of sizes, and of all.
    #[test]
    fn products_agree_with_pictures() {
        let (splats, cameras) = sample();
        let wave = |i: usize, k: f32| ((i as f32) * k).sin() * 0.3;
        let changes = |colour: f32, opacity: f32, size: f32| -> Vec<GaussianChange<5>> {
            (0..splats.len())
                .map(|i| {
                    [
                        wave(i, 1.1) * colour,
                        wave(i, 2.3) * colour,
                        wave(i, 0.7) * colour,
                        wave(i, 1.7) * opacity,
                        wave(i, 1.3) * size,
                    ]
                })
                .collect()
        };
        let kinds = [
            changes(1.0, 0.0, 0.0),
            changes(0.0, 1.0, 0.0),
            changes(0.0, 0.0, 1.0),
            changes(0.6, -1.0, 0.0),
            changes(0.3, -0.5, 0.5),
        ];
        let moved = |changes: &[GaussianChange<5>]| -> Vec<[f32; 3]> {
            const STEP: f32 = 1.0 / 64.0;
            let [more, less] = [STEP, -STEP].map(|step| drawn(&with(&splats, changes, step), &cameras));
            let pixels = more.iter().zip(&less).flat_map(|(a, b)| a.pixels.iter().zip(&b.pixels));
            pixels.map(|(a, b)| std::array::from_fn(|c| (a[c] - b[c]) / (2.0 * STEP))).collect()
        };
        let pictures = kinds.each_ref().map(|changes| moved(changes));
        let mut adjoint = PictureAdjoint::new(Scene::from(&splats), &cameras, 0).unwrap();
        let pixels = f64::from(3 * 70 * 50);
        for (changes, picture) in kinds.iter().zip(&pictures) {
            let product = adjoint.of_changes(changes, &Silent).unwrap();
            if changes.iter().all(|change| change[4] == 0.0) {
                let first: Vec<GaussianChange<4>> =
                    changes.iter().map(|c| [c[0], c[1], c[2], c[3]]).collect();
                let found = adjoint.of_changes(&first, &Silent).unwrap();
                assert!(found.iter().zip(&product).all(|(four, five)| four == &five[..4]));
            }
            for (other, other_picture) in kinds.iter().zip(&pictures) {
                let (found, expected) = (dot(other, &product) * pixels, dot(other_picture, picture));
                let size = (dot(picture, picture) * dot(other_picture, other_picture)).sqrt();
                // Splats begin to show where their opacity rises above 1/255, which J does not know. With their sizes
                // that happens everywhere around them.
                let sizes = [changes, other].iter().any(|changes| changes.iter().any(|c| c[4] != 0.0));
                let off = if sizes { 0.1 } else { 0.02 };
                assert!((found - expected).abs() < off * size, "{found} {expected} {size}");
            }
        }
        assert!(adjoint.of_changes(&kinds[0][1..], &Silent).is_err());
    }

    /// Results do not depend on how many views are kept.
    #[test]
    fn kept_views_change_nothing() {
        let (splats, cameras) = sample();
        let set = TileSet::new(70, 50, |column, row| (column + row) % 2 == 0);
        let parts: Vec<Camera> =
            cameras.iter().map(|camera| camera.clone().with_tiles(set.clone())).collect();
        let changes = vec![[0.2, 0.1, -0.1, 0.3]; splats.len()];
        for cameras in [&cameras, &parts] {
            let targets = drawn(&with(&splats, &vec![[0.1; 5]; splats.len()], 0.5), cameras);
            let found = |most_bytes| {
                let mut adjoint = PictureAdjoint::new(Scene::from(&splats), cameras, most_bytes).unwrap();
                let errors = adjoint.of_errors::<4>(&targets, &Silent).unwrap();
                let products = [0, 1].map(|_| adjoint.of_changes(&changes, &Silent).unwrap());
                ((errors, products), adjoint.kept.len(), most_bytes - adjoint.room)
            };
            let (all, kept, bytes) = found(u64::MAX);
            assert_eq!(kept, cameras.len());
            let (some, kept, _) = found(2 * bytes / 3);
            assert!(0 < kept && kept < cameras.len(), "{kept}");
            let (none, kept, _) = found(0);
            assert!(kept == 0 && all == some && all == none);
        }
    }

    /// The adjoint of the errors of pictures is half the negative gradient of their squares.
    #[test]
    fn errors_are_carried_back() {
        let (splats, cameras) = sample();
        let changes: Vec<GaussianChange<5>> = (0..splats.len())
            .map(|i| [0.1, 0.05, -0.05, 0.1 * (i % 3) as f32, 0.02 * (i % 5) as f32])
            .collect();
        let targets = drawn(&with(&splats, &changes, 0.5), &cameras);
        let mut adjoint = PictureAdjoint::new(Scene::from(&splats), &cameras, 0).unwrap();
        let PictureErrors { errors, row_sums, opacity_squares, size_squares } =
            adjoint.of_errors::<5>(&targets, &Silent).unwrap();
        let squares = |share: f32| -> f64 {
            let pictures = drawn(&with(&splats, &changes, share), &cameras);
            let pairs = pictures.iter().zip(&targets).flat_map(|(a, b)| a.pixels.iter().zip(&b.pixels));
            let off = |(a, b): (&[f32; 3], &[f32; 3])| -> f64 {
                (0..3).map(|c| f64::from(a[c].clamp(0.0, 1.0) - b[c].clamp(0.0, 1.0)).powi(2)).sum()
            };
            pairs.map(off).sum()
        };
        let slope = (squares(-1.0 / 64.0) - squares(1.0 / 64.0)) * 32.0 / 2.0 / f64::from(3 * 70 * 50);
        let found = dot(&errors, &changes);
        assert!((found / slope - 1.0).abs() < 0.02, "{found} {slope}");
        let colours = vec![[1.0, 1.0, 1.0, 0.0]; splats.len()];
        for (found, row) in row_sums.iter().zip(adjoint.of_changes(&colours, &Silent).unwrap()) {
            // The last light of a finished pixel, 1e-4 at most, counts as a weight.
            assert!((found - row[0]).abs() <= 1e-3 * row[0], "{found} {row:?}");
        }
        // One Gaussian at a time finds the diagonal.
        for gaussian in (0..splats.len()).step_by(37) {
            for (k, squares) in [(3, &opacity_squares), (4, &size_squares)] {
                let mut one = vec![[0.0; 5]; splats.len()];
                one[gaussian][k] = 1.0;
                let diagonal = adjoint.of_changes(&one, &Silent).unwrap()[gaussian][k];
                assert!((squares[gaussian] - diagonal).abs() <= 1e-4 * diagonal, "{gaussian}");
            }
        }
        assert!(adjoint.of_errors::<4>(&targets[1..], &Silent).is_err());
        // Two halves of the tiles carry back together as much as whole pictures.
        let halves = [0, 1].map(|odd| {
            let set = TileSet::new(70, 50, |column, row| (column + row) % 2 == odd);
            let cameras: Vec<Camera> =
                cameras.iter().map(|camera| camera.clone().with_tiles(set.clone())).collect();
            let targets = drawn(&with(&splats, &changes, 0.5), &cameras);
            let mut adjoint = PictureAdjoint::new(Scene::from(&splats), &cameras, 0).unwrap();
            let found = adjoint.of_errors::<5>(&targets, &Silent).unwrap();
            (set.pixels() as f32 / (70.0 * 50.0), found.errors)
        });
        for (i, whole) in errors.iter().enumerate() {
            for (k, &whole) in whole.iter().enumerate() {
                let sum: f32 = halves.iter().map(|(share, errors)| share * errors[i][k]).sum();
                assert!((sum - whole).abs() < 1e-5 * errors[i][k].abs() + 1e-9, "{sum} {whole}");
            }
        }
    }
}
