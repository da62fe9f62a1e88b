//! Values that are not finite or huge, in every property: the GPU leaves out what the processor does.

use crate::adapter::gpu;
use crate::{made, twins};
use lexisplat::sh::rest_basis;
use lexisplat::{ShDegree, Splats};
use lexisplat_render::gpu::{Gpu, GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Camera, RenderOptions, Scene, render};

const VALUES: [f32; 12] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    1e30,
    -1e30,
    1e18,
    1e10,
    -1e10,
    1e-45,
    -0.0,
];

fn compare(gpu: &Gpu, renderer: &mut GpuRenderer, splats: &Splats, camera: &Camera, case: &str) {
    let scene = Scene::from(splats);
    let options = RenderOptions::default().with_background([0.3, 0.6, 0.9]);
    let uploaded = GpuScene::new(gpu, &scene, ShPath::DenseF32).unwrap();
    let found = renderer.render(&uploaded, camera, &options).unwrap().0;
    twins::check(&found, &render(&scene, camera, &options).unwrap(), case);
}

/// A function that puts one value into one property of a Gaussian.
type Change = fn(&mut Splats, usize, usize, f32);

#[test]
fn broken_gaussians_are_left_out() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let changes: [(&str, Change); 10] = [
        ("a position", |s, i, k, v| s.geometry.positions[i][k % 3] = v),
        ("positions", |s, i, _, v| s.geometry.positions[i] = [v; 3]),
        ("a scale", |s, i, k, v| s.geometry.scales[i][k % 3] = v),
        ("scales", |s, i, _, v| s.geometry.scales[i] = [v; 3]),
        ("a rotation", |s, i, k, v| s.geometry.rotations[i][k % 4] = v),
        ("rotations", |s, i, _, v| s.geometry.rotations[i] = [v; 4]),
        ("opacity", |s, i, _, v| s.geometry.opacities[i] = v),
        ("a base colour", |s, i, k, v| s.geometry.dc[i][k % 3] = v),
        ("base colours", |s, i, _, v| s.geometry.dc[i] = [v; 3]),
        ("SH", |s, i, k, v| s.sh_rest[i * 45 + k % 45] = v),
    ];
    for (name, change) in changes {
        for value in VALUES {
            let mut splats = made::scene(3, 120, ShDegree::THREE, value > 0.0);
            for (k, i) in (0..60).step_by(4).enumerate() {
                change(&mut splats, i, k, value);
            }
            for seed in 0..2 {
                let camera = made::camera(seed, 90, 60);
                compare(&gpu, &mut renderer, &splats, &camera, &format!("{value} as {name}, camera {seed}"));
            }
        }
    }
}

#[test]
fn any_size_looks_the_same() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    for antialiased in [false, true] {
        for power in -9..=9 {
            let mut splats = made::scene(4, 30, ShDegree::ZERO, antialiased);
            // From below what f32 holds to beyond where everything overflows.
            for scales in splats.geometry.scales.iter_mut().step_by(2) {
                *scales = scales.map(|s| s + 10.0 * power as f32);
            }
            let camera = made::camera(0, 90, 60);
            compare(&gpu, &mut renderer, &splats, &camera, &format!("e^{power}0, {antialiased}"));
        }
    }
}

#[test]
fn colours_that_overflow_are_left_out() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let mut splats = made::scene(3, 120, ShDegree::THREE, false);
    // Each coefficient is finite; their sum is not.
    let camera = made::camera(0, 90, 60);
    for (i, row) in splats.sh_rest.chunks_exact_mut(45).enumerate().step_by(5) {
        let offset = glam::Vec3::from(splats.geometry.positions[i]) - glam::Vec3::from(camera.position);
        let basis = rest_basis(ShDegree::THREE, offset.normalize().to_array());
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        for (k, value) in row.iter_mut().enumerate() {
            *value = 3e38_f32.copysign(sign * basis[k % 15]);
        }
    }
    compare(&gpu, &mut renderer, &splats, &camera, "finite coefficients, infinite colour");
}
