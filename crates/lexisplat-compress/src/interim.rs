//! Fits the first layer of a file to the pictures of the whole scene, for the time until the second layer has arrived.
//!
//! Pictures are linear in colours, and nearly linear in small changes of opacities and sizes. Files hold opacities and
//! scales in large steps. Colours are therefore solved for last, with opacities and scales rounded as in the file
//! (docs/METHOD.md, "Layers").

use lexisplat::packed::AppearanceChange;
use lexisplat::sh::C0;
use lexisplat::{Progress, Splats, Stage};
use lexisplat_render::{Camera, GaussianChange, Image, PictureAdjoint, PictureErrors, Scene};

use crate::error::Result;
use crate::one_step::OneStep;
use crate::solve::{KEPT_BYTES, ROW, kinds, solve};

/// Number of solutions: for sizes, for opacities and for colours.
const SOLUTIONS: usize = 3;
/// The first layer is fitted to every `VIEW_SHARE`-th view. With every fourth view its pictures are 0.7 dB worse
/// (bonsai-3dgs, room).
const VIEW_SHARE: usize = 2;
/// Number of conjugate-gradient steps of each solution.
const STEPS: usize = 3;
/// The ridge of a value is `RIDGE * (own + RIDGE_MEAN * mean)`: `own` is half of the sum of the value's row for colours,
/// and its diagonal entry for opacities and sizes. `mean` is the mean of `own` over all Gaussians, without the half.
const RIDGE: f32 = 0.1;
const RIDGE_MEAN: f32 = 0.1;
/// Factor on the diagonal of the matrix in the preconditioner of opacities and sizes.
const DIAGONAL: f32 = 2.0;
/// Largest changes of the logarithms of opacities and of scales.
const MOST_LOG_OPACITY: f32 = 1.0;
const MOST_LOG_SCALE: f32 = 0.8;

/// Returns the changes of the Gaussians of `splats`, the first layer of a file, with which its pictures are nearest to
/// `targets`. There is one target for each of `cameras`. Reports [`Stage::Draw`] to `progress`, in views.
///
/// # Errors
/// Errors of drawing; [`lexisplat::Error::Cancelled`] within [`crate::Error::Codec`].
pub(crate) fn interim_changes(
    mut splats: Splats,
    cameras: &[Camera],
    targets: &[Image],
    progress: &dyn Progress,
) -> Result<Vec<AppearanceChange>> {
    // The first layer alone has no finer detail, and is fitted in a quarter of the time.
    let shrink = |(target, camera): (&Image, &Camera)| {
        let smaller = camera.halved();
        (shrunk(target, camera, &smaller), smaller)
    };
    let some = targets.iter().zip(cameras).step_by(VIEW_SHARE);
    let (targets, cameras): (Vec<Image>, Vec<Camera>) = some.map(shrink).unzip();
    // The views are drawn once for the errors and once in each step.
    progress.begin(Stage::Draw, (SOLUTIONS * (1 + STEPS) * cameras.len()) as u64);
    let rounds = &OneStep(progress);
    let mut changes = vec![AppearanceChange::default(); splats.len()];
    let make = |splats: &mut Splats, i: usize, change: AppearanceChange| -> AppearanceChange {
        let change = change.rounded();
        change.make(&mut splats.geometry, i);
        change
    };
    let sizes = nearest::<5>(&splats, &cameras, &targets, rounds)?;
    for (i, found) in sizes.iter().enumerate() {
        let log_scale = found[4].clamp(-MOST_LOG_SCALE, MOST_LOG_SCALE);
        changes[i] = make(&mut splats, i, AppearanceChange { log_scale, ..Default::default() });
    }
    let opacities = nearest::<4>(&splats, &cameras, &targets, rounds)?;
    for (i, found) in opacities.iter().enumerate() {
        let log_opacity = found[3].clamp(-MOST_LOG_OPACITY, MOST_LOG_OPACITY);
        let change = make(&mut splats, i, AppearanceChange { log_opacity, ..Default::default() });
        changes[i].log_opacity = change.log_opacity;
    }
    let colours = nearest::<3>(&splats, &cameras, &targets, rounds)?;
    for (change, found) in changes.iter_mut().zip(&colours) {
        change.dc = found.map(|v| v / C0);
    }
    progress.end();
    Ok(changes)
}

/// Returns the changes with which pictures of `splats`, the first layer of a file, are nearest to the targets, if pictures
/// are linear in the changes.
fn nearest<const N: usize>(
    splats: &Splats,
    cameras: &[Camera],
    targets: &[Image],
    progress: &dyn Progress,
) -> Result<Vec<GaussianChange<N>>> {
    let mut adjoint = PictureAdjoint::new(Scene::from(splats), cameras, KEPT_BYTES)?;
    let found = adjoint.of_errors(targets, progress)?;
    let PictureErrors { errors, row_sums, opacity_squares, size_squares, .. } = found;
    let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len().max(1) as f32;
    let means = [&row_sums, &opacity_squares, &size_squares].map(|values| mean(values));
    let (mut ridge, mut diagonal) = (Vec::new(), Vec::new());
    for ((row, opacity), size) in row_sums.iter().zip(&opacity_squares).zip(&size_squares) {
        let own: [f32; 3] =
            std::array::from_fn(|k| RIDGE * ([0.5 * row, *opacity, *size][k] + RIDGE_MEAN * means[k]));
        let scale = [ROW * row, DIAGONAL * opacity, DIAGONAL * size];
        ridge.push(kinds(own));
        diagonal.push(kinds([0, 1, 2].map(|k| scale[k] + own[k])));
    }
    solve(&mut adjoint, errors, &ridge, &diagonal, STEPS, progress)
}

/// Returns `image`, a picture from `camera`, at the size of `smaller`. Each pixel is the mean of the drawn pixels that it
/// covers.
fn shrunk(image: &Image, camera: &Camera, smaller: &Camera) -> Image {
    let covered = |k: usize, of: u32, from: u32| {
        let begin = |k: usize| (k * from as usize).div_ceil(of.max(1) as usize);
        begin(k)..begin(k + 1)
    };
    let [width, height] = smaller.picture_size();
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for drawn in 0..width as usize * height as usize {
        let mut sums = [0.0_f32; 4];
        if let Some([x, y]) = smaller.place_of_drawn(drawn) {
            for row in covered(y, smaller.height, camera.height) {
                for column in covered(x, smaller.width, camera.width) {
                    let Some(at) = camera.drawn_at([column, row]) else { continue };
                    (0..3).for_each(|c| sums[c] += image.pixels[at][c]);
                    sums[3] += 1.0;
                }
            }
        }
        pixels.push([0, 1, 2].map(|c| sums[c] / sums[3].max(1.0)));
    }
    Image { width, height, pixels }
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat::packed::{PackOptions, Packer};
    use lexisplat_render::{Renderer, TileSet};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::Looked;
    use crate::drawing::{DrawOptions, draw_views};
    use crate::views::Viewpoints;

    /// Changes of colours, opacities and sizes make up for what is missing, in views that they are not fitted to.
    #[test]
    fn a_first_layer_alone_is_fitted() {
        let splats = scene(&SampleOptions::new(3000, 1));
        let mut cpu = Renderer::cpu();
        let Looked { views, sensitivity } =
            Looked::at(&mut cpu, &splats, None, Viewpoints::Auto, &Silent).unwrap();
        let options = PackOptions::default().with_layers_from(1);
        let packer = Packer::new(&splats, &sensitivity, &options).unwrap();
        let quantised = packer.quantise(packer.step_for(34.0), true, &Silent).unwrap();
        let grown = quantised.finish(None, None, &Silent).unwrap().0.first_layer().unwrap().unwrap();
        let grown = grown.into_splats();
        let mut drawn = |splats: &Splats, cameras: &[Camera]| {
            draw_views(&mut cpu, &Scene::from(splats), cameras, &DrawOptions::default(), &Silent).unwrap()
        };
        let fitting = views.fitting(&splats);
        let originals = drawn(&splats, &fitting);
        let changes = interim_changes(grown.clone(), &fitting, &originals, &Silent).unwrap();
        assert!(changes.iter().any(|change| change.log_scale != 0.0));
        let mut fitted = grown.clone();
        for (i, change) in changes.iter().enumerate() {
            let AppearanceChange { log_opacity, log_scale, .. } = change.rounded();
            assert_eq!([log_opacity, log_scale], [change.log_opacity, change.log_scale]);
            change.make(&mut fitted.geometry, i);
        }
        let judging: Vec<Camera> = views.some_judging(12);
        let targets = drawn(&splats, &judging);
        let mut squares = |splats: &Splats| -> f64 {
            let pictures = drawn(splats, &judging);
            let pixels = pictures.iter().zip(&targets).flat_map(|(a, b)| a.pixels.iter().zip(&b.pixels));
            pixels.flat_map(|(a, b)| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2))).sum()
        };
        let [before, after] = [&grown, &fitted].map(&mut squares);
        assert!(after < 0.7 * before, "{after} {before}");
    }

    #[test]
    fn shrunk_pixels_are_means_of_those_they_cover() {
        let pixels = (0..15).map(|k| [k as f32, 0.0, 1.0]).collect();
        let image = Image { width: 5, height: 3, pixels };
        let camera = view(5, 3);
        let small = shrunk(&image, &camera, &camera.resized(2, 1));
        // Columns 0 to 2, and 3 and 4, of all rows.
        assert_eq!(small.pixels, [[6.0, 0.0, 1.0], [8.5, 0.0, 1.0]]);
        assert_eq!(shrunk(&image, &camera, &camera), image);
    }

    fn view(width: u32, height: u32) -> Camera {
        let rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Camera::rounded("view".into(), [width, height], [50.0; 2], [0.0; 3], rotation)
    }

    /// The picture that `camera` draws, cut out of `whole`.
    fn cut(whole: &Image, camera: &Camera) -> Image {
        let [width, height] = camera.picture_size();
        let at = |[x, y]: [usize; 2]| whole.pixels[y * whole.width as usize + x];
        let pixel = |drawn: u32| camera.place_of_drawn(drawn as usize).map_or([0.0; 3], at);
        Image { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    #[test]
    fn some_squares_shrink_as_in_the_whole_picture() {
        let camera = view(104, 72);
        let pixels = (0..104 * 72).map(|k| [k as f32 / 7488.0, (k % 13) as f32 / 13.0, 0.5]).collect();
        let whole = Image { width: 104, height: 72, pixels };
        let small = shrunk(&whole, &camera, &camera.halved());
        let some = camera.with_tiles(TileSet::new(104, 72, |x, y| (x / 2 + y / 2) % 2 == 1));
        let smaller = some.halved();
        assert_eq!(shrunk(&cut(&whole, &some), &some, &smaller), cut(&small, &smaller));
    }
}
