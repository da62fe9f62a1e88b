//! Sensitivities measured on the GPU against those of the processor.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::adapter::{best, gpu, opened};
use crate::made;
use lexisplat::{Progress, Sensitivity, ShDegree, Silent, Splats};
use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Camera, Error, Scene, sensitivity, surround};
use lexisplat_sample::{SampleOptions, scene};

/// Largest difference of a sum, relative to its own size and the mean of all Gaussians'.
const SUM_TOLERANCE: f32 = 2e-3;
/// Largest difference of a change of colour, in units of colour.
const REMOVAL_TOLERANCE: f32 = 1e-3;

/// Counts views.
#[derive(Default)]
struct Views(AtomicU64);

impl Progress for Views {
    fn advance(&self, units: u64) {
        self.0.fetch_add(units, Relaxed);
    }
}

fn measure(gpu: &Gpu, splats: &Splats, cameras: &[Camera]) -> Sensitivity {
    let scene = GpuScene::new(gpu, &Scene::from(splats), ShPath::DenseF32).unwrap();
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let views = Views::default();
    let found = renderer.sensitivity(&scene, &splats.geometry, cameras, &views).unwrap();
    assert_eq!(views.0.load(Relaxed), cameras.len() as u64);
    found
}

/// Asserts that `found` is `expected` within `tolerance` times its size or the mean's.
fn near(name: &str, found: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(found.len(), expected.len());
    let mean = expected.iter().map(|v| v.abs()).sum::<f32>() / expected.len() as f32;
    assert!(mean > 0.0, "{name}: nothing shows");
    for (i, (&a, &b)) in found.iter().zip(expected).enumerate() {
        let off = (a - b).abs() / (mean + b.abs());
        assert!(off < tolerance, "{name}[{i}]: {a} instead of {b}: off by {off} where {mean} is the mean");
    }
}

fn compare(gpu: &Gpu, splats: &Splats, cameras: &[Camera]) {
    let found = measure(gpu, splats, cameras);
    let expected = sensitivity(&Scene::from(splats), cameras, &Silent).unwrap();
    near("colour", &found.colour, &expected.colour, SUM_TOLERANCE);
    near("opacity", &found.opacity, &expected.opacity, SUM_TOLERANCE);
    near("removal from a view", &found.removal_view, &expected.removal_view, SUM_TOLERANCE);
    let [a, b] = [&found, &expected].map(|s| s.position.as_flattened());
    near("position", a, b, SUM_TOLERANCE);
    let [a, b] = [&found, &expected].map(|s| s.scale.as_flattened());
    near("scale", a, b, SUM_TOLERANCE);
    let [a, b] = [&found, &expected].map(|s| s.rotation.as_flattened());
    near("rotation", a, b, SUM_TOLERANCE);
    for (i, (a, b)) in found.removal.iter().zip(&expected.removal).enumerate() {
        assert!((a - b).abs() < REMOVAL_TOLERANCE, "removal[{i}]: {a} instead of {b}");
    }
}

#[test]
fn random_scenes_are_as_on_the_processor() {
    let Some(gpu) = gpu() else { return };
    for (seed, antialiased) in [(1, false), (2, true)] {
        let splats = made::scene(seed, 1500, ShDegree::ONE, antialiased);
        // No side a multiple of a tile's, one picture smaller than one, and others of other sizes.
        let cameras = [(150, 100), (7, 5), (333, 41), (150, 100)]
            .iter()
            .zip(0..)
            .map(|(&(width, height), k)| {
                made::camera(seed + k, width, height).with_background((k % 2 == 0).then_some([1.0, 0.5, 0.2]))
            })
            .collect::<Vec<_>>();
        compare(&gpu, &splats, &cameras);
    }
}

#[test]
fn views_along_the_axes_are_as_on_the_processor() {
    let Some(gpu) = gpu() else { return };
    let splats = made::scene(3, 800, ShDegree::ZERO, false);
    let ahead = Camera { position: [0.0, 0.0, -4.0], ..made::straight(160, 96, 140.0) };
    // Forward along world x, -x and y.
    let turned = |position, rotation| Camera { position, rotation, ..ahead.clone() };
    let cameras = [
        turned([-4.0, 0.0, 0.0], [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
        turned([4.0, 0.0, 0.0], [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
        turned([0.0, -4.0, 0.0], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
        ahead,
    ];
    compare(&gpu, &splats, &cameras);
}

#[test]
fn the_sample_is_as_on_the_processor() {
    let Some(gpu) = gpu() else { return };
    let splats = scene(&SampleOptions::new(6000, 1));
    let cameras = surround(&splats.geometry, 4, [192, 128], [1.0, 6.0]);
    compare(&gpu, &splats, &cameras);
}

#[test]
fn twice_is_the_same() {
    let Some(gpu) = gpu() else { return };
    let splats = scene(&SampleOptions::new(3000, 2));
    let cameras = surround(&splats.geometry, 2, [200, 150], [1.0, 4.0]);
    assert!(measure(&gpu, &splats, &cameras) == measure(&gpu, &splats, &cameras));
}

#[test]
fn nothing_gives_nothing() {
    let Some(gpu) = gpu() else { return };
    let camera = made::straight(40, 30, 40.0);
    let empty = made::scene(1, 0, ShDegree::ZERO, false);
    assert_eq!(measure(&gpu, &empty, std::slice::from_ref(&camera)), Sensitivity::zeros(0));
    let splats = made::scene(1, 30, ShDegree::ONE, false);
    assert_eq!(measure(&gpu, &splats, &[]), Sensitivity::zeros(30));
    // All behind the camera.
    let away = Camera { position: [0.0, 0.0, 1000.0], ..camera };
    assert_eq!(measure(&gpu, &splats, &[away]), Sensitivity::zeros(30));
}

#[test]
fn buffers_are_given_back_and_other_geometry_is_refused() {
    // One of its own: the other tests' buffers would be counted too.
    let Some(gpu) = opened(best()) else { return };
    let splats = made::scene(4, 300, ShDegree::ONE, false);
    let cameras = [made::camera(4, 80, 60)];
    let scene = GpuScene::new(&gpu, &Scene::from(&splats), ShPath::DenseF32).unwrap();
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let before = gpu.bytes();
    renderer.sensitivity(&scene, &splats.geometry, &cameras, &Silent).unwrap();
    assert_eq!(gpu.bytes(), before);
    assert!(gpu.most_bytes() > before);
    let other = made::scene(4, 299, ShDegree::ONE, false);
    let refused = renderer.sensitivity(&scene, &other.geometry, &cameras, &Silent);
    assert!(matches!(refused, Err(Error::Parameter { name: "geometry", .. })));
}
