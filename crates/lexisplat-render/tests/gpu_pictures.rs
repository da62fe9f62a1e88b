//! Whole pictures of the GPU against the processor's.

use crate::adapter::gpu;
use crate::{adapter, common, made, twins};
use lexisplat::{Geometry, SceneMeta, ShDegree, Splats};
use lexisplat_render::gpu::{GpuRenderer, GpuScene, ShPath};
use lexisplat_render::{Camera, Image, RenderOptions, Scene, render};

/// Gaussians of any size, place and opacity, with any SH up to `degree`.
fn wild(random: &mut made::Random, count: usize, degree: ShDegree) -> Splats {
    let mut geometry = Geometry::default();
    for _ in 0..count {
        geometry.positions.push([
            random.within(-3.0, 3.0),
            random.within(-3.0, 3.0),
            random.within(-0.5, 8.0),
        ]);
        geometry.dc.push(std::array::from_fn(|_| random.within(-2.0, 2.0)));
        geometry.scales.push(std::array::from_fn(|_| random.within(-9.0, 2.5)));
        geometry.rotations.push(std::array::from_fn(|_| random.within(-1.0, 1.0)));
        geometry.opacities.push(random.within(-6.0, 9.0));
    }
    let sh_rest = (0..count * degree.rest()).map(|_| random.within(-0.3, 0.3)).collect();
    let meta = SceneMeta { antialiased: random.unit() < 0.5, ..SceneMeta::default() };
    Splats { geometry, degree, sh_rest, meta }
}

/// One picture by the GPU.
fn draw(
    renderer: &mut GpuRenderer,
    gpu: &lexisplat_render::gpu::Gpu,
    splats: &Splats,
    camera: &Camera,
) -> Image {
    let scene = GpuScene::new(gpu, &Scene::from(splats), ShPath::DenseF32).unwrap();
    renderer.render(&scene, camera, &RenderOptions::default()).unwrap().0
}

#[test]
fn random_scenes_look_the_same() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let sides = [(1, 1), (16, 16), (17, 15), (100, 1), (1, 90), (64, 64), (203, 77), (320, 200), (1000, 30)];
    for case in 0..60 {
        let mut random = made::Random::new(case);
        let degree = ShDegree::new((case % 5) as u8).unwrap();
        let count = (random.unit() * 400.0) as usize;
        let splats = wild(&mut random, count, degree);
        let scene = Scene::from(&splats);
        let (width, height) = sides[case as usize % sides.len()];
        let focal = random.within(2.0, 8.0).exp();
        let camera = Camera { fy: focal * random.within(0.8, 1.2), ..made::straight(width, height, focal) };
        let background = std::array::from_fn(|_| random.unit());
        let max_degree = (case % 3 == 0).then(|| ShDegree::new((random.unit() * 5.0) as u8).unwrap());
        let options = RenderOptions::default().with_background(background).with_max_degree(max_degree);
        let uploaded = GpuScene::new(&gpu, &scene, ShPath::DenseF32).unwrap();
        let (found, stats) = renderer.render(&uploaded, &camera, &options).unwrap();
        let expected = render(&scene, &camera, &options).unwrap();
        let antialiased = splats.meta.antialiased;
        let case =
            format!("case {case}: {count} of degree {degree}, {antialiased}, {width}x{height}, {stats:?}");
        twins::check(&found, &expected, &case);
    }
}

#[test]
fn odd_gaussians_look_the_same() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    for seed in 0..10 {
        let degree = ShDegree::new((seed % 5) as u8).unwrap();
        let splats = made::scene(seed, 600, degree, seed % 2 == 0);
        // From outside, close, and inside of some.
        for closer in [1.0, 0.5, 0.1] {
            let mut camera = made::camera(seed, 150, 110);
            camera.position = camera.position.map(|v| v * closer);
            let found = draw(&mut renderer, &gpu, &splats, &camera);
            let expected = render(&Scene::from(&splats), &camera, &RenderOptions::default()).unwrap();
            twins::check(&found, &expected, &format!("seed {seed}, {closer} of the distance"));
        }
    }
}

#[test]
fn the_comparison_would_notice() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let splats = made::scene(1, 300, ShDegree::THREE, false);
    let camera = made::camera(1, 150, 110);
    let expected = render(&Scene::from(&splats), &camera, &RenderOptions::default()).unwrap();
    let mut other = splats.clone();
    other.meta.antialiased = true;
    let mut darker = splats.clone();
    darker.sh_rest.iter_mut().for_each(|v| *v *= 0.9);
    let mut shifted = camera.clone();
    shifted.position[0] += 0.005;
    for (splats, camera) in [(&other, &camera), (&darker, &camera), (&splats, &shifted)] {
        let found = draw(&mut renderer, &gpu, splats, camera);
        assert!(common::psnr(&found, &expected, true) < twins::TWIN_DB);
    }
}

#[test]
fn nothing_in_view_is_background() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let options = RenderOptions::default().with_background([0.1, 0.2, 0.3]);
    let mut behind = made::scene(2, 300, ShDegree::ONE, false);
    for position in &mut behind.geometry.positions {
        position[2] = -1.0 - position[2].abs();
    }
    for splats in [made::scene(0, 0, ShDegree::THREE, false), behind] {
        let scene = GpuScene::new(&gpu, &Scene::from(&splats), ShPath::DenseF32).unwrap();
        assert_eq!(scene.is_empty(), splats.is_empty());
        let (image, stats) = renderer.render(&scene, &made::straight(17, 50, 10.0), &options).unwrap();
        assert_eq!(image.pixels, vec![options.background; 850]);
        assert_eq!((stats.visible, stats.entries), (0, 0));
    }
}

#[test]
fn a_picture_does_not_depend_on_those_before() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let upload = |seed, count, degree| {
        let splats = made::scene(seed, count, degree, seed % 2 == 0);
        GpuScene::new(&gpu, &Scene::from(&splats), ShPath::DenseF16).unwrap()
    };
    let scenes =
        [upload(5, 3000, ShDegree::THREE), upload(6, 100, ShDegree::ZERO), upload(7, 6000, ShDegree::ONE)];
    let cameras = [made::camera(1, 130, 90), made::camera(2, 40, 200), made::camera(3, 300, 20)];
    let options = RenderOptions::default();
    let fresh: Vec<Vec<u32>> = (0..9)
        .map(|k| {
            let mut renderer = GpuRenderer::new(&gpu).unwrap();
            twins::bits(&renderer.render(&scenes[k / 3], &cameras[k % 3], &options).unwrap().0)
        })
        .collect();
    // Each after each of several others, and after itself.
    for k in [0, 0, 4, 8, 8, 1, 3, 2, 2, 7, 0, 5, 6, 4, 1, 8, 0] {
        let (image, _) = renderer.render(&scenes[k / 3], &cameras[k % 3], &options).unwrap();
        assert!(twins::bits(&image) == fresh[k], "scene {}, camera {}", k / 3, k % 3);
    }
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let Some(gpu) = gpu() else { return };
    let splats = made::scene(1, 10, ShDegree::ZERO, false);
    let scene = GpuScene::new(&gpu, &Scene::from(&splats), ShPath::DenseF32).unwrap();
    let mut renderer = GpuRenderer::new(&gpu).unwrap();
    let bad = Camera { fx: f32::NAN, ..made::straight(8, 8, 8.0) };
    let refused = renderer.render(&scene, &bad, &RenderOptions::default()).unwrap_err();
    assert!(refused.to_string().starts_with("fx"), "{refused}");
    let other = adapter::opened(adapter::best()).unwrap();
    let elsewhere = GpuScene::new(&other, &Scene::from(&splats), ShPath::DenseF32).unwrap();
    let refused = renderer.render(&elsewhere, &made::straight(8, 8, 8.0), &RenderOptions::default());
    assert!(refused.unwrap_err().to_string().starts_with("scene"));
    // After a refusal it still draws.
    assert!(renderer.render(&scene, &made::straight(8, 8, 8.0), &RenderOptions::default()).is_ok());
}
