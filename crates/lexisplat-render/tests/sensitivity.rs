//! Sensitivities against finite differences of the rasteriser itself.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use lexisplat::{Progress, Silent, Splats, Stage, sh};
use lexisplat_render::{
    Camera, Error, Image, RenderOptions, Scene, TileSet, orbit, render, sensitivity, surround,
};
use lexisplat_sample::{SampleOptions, scene};

const GAUSSIANS: usize = 120;
/// Step of a difference, in the value's own unit: large enough that pixels that appear or vanish, at 1/255,
/// matter little.
const STEP: f32 = 2e-2;
/// Gaussians whose pictures change by less than this share of the largest change are left out: what
/// crosses a threshold of the rasteriser there is larger than the change.
const LEAST_SHARE: f64 = 1e-3;

fn draw(splats: &Splats, camera: &Camera) -> Image {
    render(&Scene::from(splats), camera, &RenderOptions::default()).unwrap()
}

/// Squared derivative of the pictures, averaged over pixels, channels and cameras, by what `change` does
/// for a parameter of plus and minus [`STEP`].
fn measured(splats: &Splats, cameras: &[Camera], change: impl Fn(&mut Splats, f32)) -> f64 {
    let mut sum = 0.0;
    for camera in cameras {
        let [more, less] = [STEP, -STEP].map(|h| {
            let mut changed = splats.clone();
            change(&mut changed, h);
            draw(&changed, camera)
        });
        let pairs = more.pixels.as_flattened().iter().zip(less.pixels.as_flattened());
        let squares = pairs.map(|(a, b)| (f64::from(a - b) / f64::from(2.0 * STEP)).powi(2));
        sum += squares.sum::<f64>() / (3 * more.pixels.len() * cameras.len()) as f64;
    }
    sum
}

/// The quaternion product a b.
fn product(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// Asserts that most of `pairs` (predicted, measured) agree well, and their sums closely.
fn agree(name: &str, mut pairs: Vec<(f64, f64)>) {
    let most = pairs.iter().map(|p| p.1).fold(0.0, f64::max);
    pairs.retain(|p| p.1 > LEAST_SHARE * most);
    assert!(pairs.len() > 15, "{name}: only {} Gaussians matter", pairs.len());
    let sums = pairs.iter().fold([0.0; 2], |s, p| [s[0] + p.0, s[1] + p.1]);
    let ratio = sums[0] / sums[1];
    assert!((0.9..1.1).contains(&ratio), "{name}: predicted {ratio} of what was measured");
    let mut off: Vec<f64> = pairs.iter().map(|p| (p.0 / p.1).ln().abs()).collect();
    off.sort_by(f64::total_cmp);
    let (median, tenth) = (off[off.len() / 2], off[off.len() * 9 / 10]);
    assert!(median < 0.05 && tenth < 0.4, "{name}: median {median}, nine tenths below {tenth}");
}

#[test]
fn derivatives_are_those_of_the_pictures() {
    let mut splats = scene(&SampleOptions::new(GAUSSIANS, 5));
    // Transparent, so that many matter and overlap; bright, so that none is clamped at 0.
    for i in 0..splats.len() {
        let g = &mut splats.geometry;
        g.scales[i] = g.scales[i].map(|s| s.clamp(-3.5, -1.5));
        g.opacities[i] = g.opacities[i].min(1.0);
        g.dc[i] = g.dc[i].map(|v| v + 2.0);
    }
    let mut cameras = surround(&splats.geometry, 3, [96, 64], [2.0, 4.0]);
    cameras[1].background = Some([0.9, 0.1, 0.5]);
    let s = sensitivity(&Scene::from(&splats), &cameras, &Silent).unwrap();
    let of = |predicted: &dyn Fn(usize) -> f32, change: &dyn Fn(&mut Splats, usize, f32)| {
        (0..splats.len())
            .map(|i| (f64::from(predicted(i)), measured(&splats, &cameras, |s, h| change(s, i, h))))
            .collect::<Vec<_>>()
    };
    agree("colour", of(&|i| s.colour[i], &|s, i, h| s.geometry.dc[i][1] += h / sh::C0));
    agree(
        "opacity",
        of(&|i| s.opacity[i], &|s, i, h| {
            let o = &mut s.geometry.opacities[i];
            let alpha = h.exp() / (1.0 + (-*o).exp());
            *o = (alpha / (1.0 - alpha)).ln();
        }),
    );
    agree("scale", of(&|i| s.scale[i][i % 3], &|s, i, h| s.geometry.scales[i][i % 3] += h));
    agree(
        "rotation",
        of(&|i| s.rotation[i][i % 3], &|s, i, h| {
            let mut turn = [1.0, 0.0, 0.0, 0.0];
            turn[1 + i % 3] = 0.5 * h;
            s.geometry.rotations[i] = product(s.geometry.rotations[i], turn);
        }),
    );
}

#[test]
fn moving_is_shifting_on_screen() {
    // Small and without view-dependent colour: how the shape on screen and the colour change with the place
    // is not counted.
    let mut splats = scene(&SampleOptions::new(GAUSSIANS, 5));
    splats.sh_rest.fill(0.0);
    for i in 0..splats.len() {
        let g = &mut splats.geometry;
        g.scales[i] = g.scales[i].map(|s| s.clamp(-3.5, -2.5));
        g.opacities[i] = g.opacities[i].min(1.0);
    }
    let cameras = surround(&splats.geometry, 3, [96, 64], [3.0, 5.0]);
    let s = sensitivity(&Scene::from(&splats), &cameras, &Silent).unwrap();
    // Along a direction the change is the matrix's quadratic form.
    let pair = |i: usize| {
        let even = i.is_multiple_of(2);
        let [xx, xy, _, yy, _, zz] = s.position[i];
        let predicted = if even { zz } else { 0.36 * xx + 0.96 * xy + 0.64 * yy };
        let found = measured(&splats, &cameras, |s, h| {
            let p = &mut s.geometry.positions[i];
            let along = if even { [0.0, 0.0, 1.0] } else { [0.6, 0.8, 0.0] };
            *p = std::array::from_fn(|k| p[k] + h * along[k]);
        });
        (f64::from(predicted), found)
    };
    agree("position", (0..splats.len()).map(pair).collect());
}

#[test]
fn long_thin_ones_do_not_drown_in_rounding() {
    // Needles longer than the picture and far thinner than a pixel, in all directions.
    let mut splats = scene(&SampleOptions::new(GAUSSIANS, 5));
    for i in 0..splats.len() {
        let g = &mut splats.geometry;
        g.scales[i] = [-8.0; 3];
        g.scales[i][i % 3] = 1.0;
        g.opacities[i] = g.opacities[i].clamp(-1.0, 1.0);
        g.dc[i] = g.dc[i].map(|v| v + 2.0);
    }
    let cameras = surround(&splats.geometry, 3, [96, 64], [2.0, 4.0]);
    let s = sensitivity(&Scene::from(&splats), &cameras, &Silent).unwrap();
    let along = |i: usize| {
        let found = measured(&splats, &cameras, |s, h| s.geometry.scales[i][i % 3] += h);
        (f64::from(s.scale[i][i % 3]), found)
    };
    agree("length", (0..splats.len()).map(along).collect());
}

#[test]
fn removal_is_what_the_pictures_lose() {
    let splats = scene(&SampleOptions::new(GAUSSIANS, 6));
    let mut cameras = surround(&splats.geometry, 2, [96, 64], [2.0, 4.0]);
    cameras[1].background = Some([1.0; 3]);
    let s = sensitivity(&Scene::from(&splats), &cameras, &Silent).unwrap();
    let mut seen = 0;
    for i in 0..splats.len() {
        let mut keep = vec![true; splats.len()];
        keep[i] = false;
        let mut without = splats.clone();
        without.retain(&keep);
        let (mut largest, mut squares) = (0.0_f32, 0.0_f32);
        for camera in &cameras {
            let (a, b) = (draw(&splats, camera), draw(&without, camera));
            let mut sum = 0.0;
            for (a, b) in a.pixels.as_flattened().iter().zip(b.pixels.as_flattened()) {
                largest = largest.max((a - b).abs());
                sum += (a - b).powi(2);
            }
            squares = squares.max(sum / a.pixels.as_flattened().len() as f32);
        }
        assert!((s.removal_view[i] - squares).abs() < 1e-6 + 0.02 * squares, "Gaussian {i}: {squares}");
        // Splats behind a finished pixel are not drawn, so their return is not known: at most the
        // light a finished pixel has left, 1e-4 over 1 - 0.99.
        assert!((s.removal[i] - largest).abs() < 2e-2, "Gaussian {i}: {} {largest}", s.removal[i]);
        seen += usize::from(largest > 0.05);
    }
    assert!(seen > 20, "{seen}");
}

/// Two halves of the tiles measure together as much as the whole picture.
#[test]
fn tiles_measure_their_share() {
    let splats = scene(&SampleOptions::new(300, 5));
    let [whole] = &orbit(&splats.geometry, 1, 100, 70)[..] else { panic!() };
    let measured =
        |camera: &Camera| sensitivity(&Scene::from(&splats), std::slice::from_ref(camera), &Silent).unwrap();
    let all = measured(whole);
    let half = |odd: u32| TileSet::new(100, 70, |column, row| (column + row) % 2 == odd);
    let [a, b] = [0, 1].map(|odd| {
        let camera = whole.clone().with_tiles(half(odd));
        (camera.drawn_pixels() as f32 / 7000.0, measured(&camera))
    });
    let close = |whole: f32, [x, y]: [f32; 2]| {
        let sum = a.0 * x + b.0 * y;
        assert!((sum - whole).abs() <= 1e-4 * whole.abs() + 1e-12, "{sum} {whole}");
    };
    for i in 0..splats.len() {
        close(all.colour[i], [a.1.colour[i], b.1.colour[i]]);
        close(all.opacity[i], [a.1.opacity[i], b.1.opacity[i]]);
        for k in 0..6 {
            close(all.position[i][k], [a.1.position[i][k], b.1.position[i][k]]);
        }
        assert_eq!(all.removal[i], a.1.removal[i].max(b.1.removal[i]));
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let splats = scene(&SampleOptions::new(3000, 1));
    let cameras = surround(&splats.geometry, 3, [200, 150], [2.0, 6.0]);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sensitivity(&Scene::from(&splats), &cameras, &Silent).unwrap())
    };
    let one = with(1);
    assert!(one == with(2) && one == with(7));
}

/// Cancels after one view.
#[derive(Default)]
struct OneView(AtomicU64);

impl Progress for OneView {
    fn begin(&self, stage: Stage, total: u64) {
        assert_eq!((stage, total), (Stage::Draw, 3));
    }

    fn advance(&self, units: u64) {
        self.0.fetch_add(units, Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.0.load(Relaxed) > 0
    }
}

#[test]
fn measuring_can_be_cancelled_between_views() {
    let splats = scene(&SampleOptions::new(GAUSSIANS, 1));
    let cameras = surround(&splats.geometry, 3, [32, 32], [1.0, 4.0]);
    let progress = OneView::default();
    let found = sensitivity(&Scene::from(&splats), &cameras, &progress);
    assert!(matches!(found, Err(Error::Codec(lexisplat::Error::Cancelled))), "{found:?}");
    assert_eq!(progress.0.load(Relaxed), 1);
}
