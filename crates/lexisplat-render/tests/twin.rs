//! The tile rasteriser against its naive f64 twin, on scenes made to hit every rule.

use crate::{common, made, naive};
use lexisplat::ShDegree;
use lexisplat_render::{RenderOptions, Scene, render};

/// Least PSNR, without clipping, between the two.
const TWIN_DB: f64 = 70.0;

#[test]
fn agrees_on_every_degree_and_both_rules() {
    for degree in 0..=4 {
        for antialiased in [false, true] {
            for seed in 0..6 {
                let splats = made::scene(seed, 300, ShDegree::new(degree).unwrap(), antialiased);
                let camera = made::camera(seed, 150, 110);
                let background = [0.2, 0.5, 1.0];
                let expected = naive::render(&splats, &camera, background);
                let found = render(
                    &Scene::from(&splats),
                    &camera,
                    &RenderOptions::default().with_background(background),
                )
                .unwrap();
                let db = common::psnr(&found, &expected, false);
                assert!(db >= TWIN_DB, "degree {degree}, antialiased {antialiased}, seed {seed}: {db:.1} dB");
            }
        }
    }
}

#[test]
fn the_comparison_would_notice() {
    let splats = made::scene(1, 300, ShDegree::THREE, false);
    let camera = made::camera(1, 150, 110);
    let expected = naive::render(&splats, &camera, [0.0; 3]);
    let mut other = splats.clone();
    other.meta.antialiased = true;
    let mut shifted = camera.clone();
    shifted.position[0] += 0.001;
    let mut darker = splats.clone();
    darker.sh_rest.iter_mut().for_each(|v| *v *= 0.98);
    let options = RenderOptions::default();
    for found in [
        render(&Scene::from(&other), &camera, &options).unwrap(),
        render(&Scene::from(&splats), &shifted, &options).unwrap(),
        render(&Scene::from(&darker), &camera, &options).unwrap(),
    ] {
        assert!(common::psnr(&found, &expected, false) < TWIN_DB);
    }
}

#[test]
fn one_splat_and_the_background_add_up() {
    // Odd sides put the optical axis on a pixel centre.
    let mut splats = made::scene(0, 1, ShDegree::ZERO, false);
    splats.geometry.positions = vec![[0.0, 0.0, 2.0]];
    splats.geometry.dc = vec![[1.0, 4.0, -4.0]];
    splats.geometry.scales = vec![[-2.0; 3]];
    for (opacity, alpha) in [(0.0, 0.5), (30.0, 0.99)] {
        splats.geometry.opacities = vec![opacity];
        let camera = made::straight(33, 21, 30.0);
        let options = RenderOptions::default().with_background([0.0, 0.5, 1.0]);
        let image = render(&Scene::from(&splats), &camera, &options).unwrap();
        let [red, green, blue] = image.pixels[10 * 33 + 16];
        let expected = [
            alpha * (0.5 + 0.282_094_8),
            alpha * (0.5 + 4.0 * 0.282_094_8) + (1.0 - alpha) * 0.5,
            1.0 - alpha,
        ];
        for (found, expected) in [red, green, blue].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
    }
}

#[test]
fn a_pixel_closes_before_the_splat_that_would_fill_it() {
    // Three splats of opacity 0.99, nearest first red, green, blue: after two, 1e-4 is left; rounding
    // in f32 leaves it just above or below, so the third is never added.
    let mut splats = made::scene(0, 3, ShDegree::ZERO, false);
    let colour = |c: usize| std::array::from_fn(|k| if k == c { 10.0 } else { -10.0 });
    splats.geometry.positions = vec![[0.0, 0.0, 4.0], [0.0, 0.0, 2.0], [0.0, 0.0, 3.0]];
    splats.geometry.dc = vec![colour(2), colour(0), colour(1)];
    splats.geometry.scales = vec![[-1.0; 3]; 3];
    splats.geometry.opacities = vec![30.0; 3];
    let image =
        render(&Scene::from(&splats), &made::straight(33, 21, 30.0), &RenderOptions::default()).unwrap();
    let [red, _, blue] = image.pixels[10 * 33 + 16];
    assert!((red - 0.99 * (0.5 + 2.820_948)).abs() < 1e-4);
    assert!(blue.abs() < 1e-9);
}

#[test]
fn broken_gaussians_never_reach_a_pixel() {
    let mut splats = made::scene(3, 400, ShDegree::THREE, false);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 1e30, -1e30, 1e-45];
    for (k, &value) in bad.iter().enumerate() {
        let g = &mut splats.geometry;
        g.positions[k * 40][k % 3] = value;
        g.scales[k * 40 + 1][k % 3] = value;
        g.rotations[k * 40 + 2][k % 4] = value;
        g.opacities[k * 40 + 3] = value;
        g.dc[k * 40 + 4][k % 3] = value;
        splats.sh_rest[(k * 40 + 5) * 45 + k] = value;
        g.positions[k * 40 + 6] = [value; 3];
        g.scales[k * 40 + 7] = [value; 3];
        g.rotations[k * 40 + 8] = [value; 4];
    }
    for antialiased in [false, true] {
        splats.meta.antialiased = antialiased;
        for seed in 0..4 {
            let image =
                render(&Scene::from(&splats), &made::camera(seed, 150, 110), &RenderOptions::default())
                    .unwrap();
            let wrong = image.pixels.as_flattened().iter().filter(|v| v.is_nan() || **v < 0.0).count();
            assert_eq!(wrong, 0);
        }
    }
}

#[test]
fn an_empty_scene_is_background() {
    let splats = made::scene(0, 0, ShDegree::THREE, false);
    let options = RenderOptions::default().with_background([0.1, 0.2, 0.3]);
    let image = render(&Scene::from(&splats), &made::straight(17, 5, 10.0), &options).unwrap();
    assert_eq!(image.pixels, vec![[0.1, 0.2, 0.3]; 85]);
}

#[test]
fn the_picture_does_not_depend_on_threads() {
    let splats = made::scene(5, 5000, ShDegree::THREE, false);
    let camera = made::camera(5, 200, 150);
    let draw = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&Scene::from(&splats), &camera, &RenderOptions::default()).unwrap())
    };
    let bits = |image: &lexisplat_render::Image| -> Vec<u32> {
        image.pixels.as_flattened().iter().map(|v| v.to_bits()).collect()
    };
    assert_eq!(bits(&draw(1)), bits(&draw(3)));
}
