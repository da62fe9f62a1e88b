//! Ellipses, Gaussian by Gaussian.

use std::collections::HashMap;

use lexisplat::ShDegree;

use super::{View, gpu, made};
use crate::cpu::{RenderOptions, twin};
use crate::scene::Scene;

/// Relative error of a conic's entries, by its largest: exponentials and quotients of graphics drivers.
const CONIC_ERROR: f32 = 2e-4;
/// Error of opacities.
const OPACITY_ERROR: f32 = 1e-5;
/// Error of centres in pixels, for each pixel from the origin, and at least.
const CENTRE_ERROR: [f32; 2] = [4e-6, 1e-4];
/// Units in the last place by which depths may differ.
const DEPTH_ERROR: u32 = 16;

#[test]
fn ellipses_are_the_processors() {
    let Some(gpu) = gpu() else { return };
    let (mut compared, mut extra, mut behind) = (0, 0, 0);
    for seed in 0..6 {
        let splats = made::scene(seed, 2000, ShDegree::ZERO, seed % 2 == 0);
        let scene = Scene::from(&splats);
        let mut camera = made::camera(seed, 150, 110);
        camera.position = camera.position.map(|v| v * [1.0, 0.5][seed as usize / 3]);
        let seen: HashMap<u32, twin::Seen> =
            twin::seen(&scene, &camera).into_iter().map(|s| (s.gaussian, s)).collect();
        let view = View::new(&gpu, &scene, &camera, &RenderOptions::default());
        let centres: Vec<[f32; 4]> = gpu.read_back(&view.work().centres);
        let conics: Vec<[f32; 4]> = gpu.read_back(&view.work().conics);
        let rects: Vec<[u32; 2]> = gpu.read_back(&view.work().rects);
        let order = view.order();
        let gaussians = view.gaussians();
        let mut last = (0, 0);
        for slot in order {
            let s = slot as usize;
            if rects[s] == [0, 0] {
                behind += 1;
                continue;
            }
            let Some(twin) = seen.get(&gaussians[s]) else {
                extra += 1;
                continue;
            };
            let [x, y, a, b] = centres[s];
            let [c, det, opacity, level] = conics[s];
            for (found, expected) in [x, y].into_iter().zip(twin.centre) {
                let error = CENTRE_ERROR[0] * expected.abs() + CENTRE_ERROR[1];
                assert!((found - expected).abs() <= error, "centre {found}, {twin:?}");
            }
            let most = CONIC_ERROR * twin.conic[0].max(twin.conic[2]);
            for (found, expected) in [a, b, c].into_iter().zip(twin.conic) {
                assert!((found - expected).abs() <= most, "conic {:?}, {twin:?}", [a, b, c]);
            }
            let [xx, xy, yy] = [a, b, c].map(f64::from);
            let expected = xx * yy - xy * xy;
            // Of entries in single precision, the determinant has lost what cancels.
            let lost = 1e-6 * xx * yy + f64::from(CONIC_ERROR) * expected.abs();
            assert!((f64::from(det) - expected).abs() <= lost, "determinant {det}, {expected}, {twin:?}");
            assert!((opacity - twin.opacity).abs() <= OPACITY_ERROR, "opacity {opacity}, {twin:?}");
            // Below the level opacity reaches 1/255.
            let at_level = opacity * (-0.5 * level).exp();
            assert!((0.999..=1.0).contains(&(at_level * 255.0)), "level {level}, {twin:?}");
            // Nearest first, ties in order of index: by the GPU's own depths, which are about the twin's.
            let key = (twin.depth, gaussians[s]);
            assert!(key.0 + DEPTH_ERROR >= last.0, "{twin:?} comes after {last:?}");
            last = key;
            assert!(twin.depth >= camera.near.to_bits());
            compared += 1;
        }
    }
    assert!(compared > 4000, "{compared}");
    // Rounding decides a few at the limits.
    assert!(extra * 500 < compared && behind > 10, "{extra} of {compared}; {behind}");
}

#[test]
fn equal_depths_keep_the_order_of_index() {
    let Some(gpu) = gpu() else { return };
    let mut splats = made::scene(4, 3000, ShDegree::ZERO, false);
    for (i, position) in splats.geometry.positions.iter_mut().enumerate() {
        position[2] = 2.0 + (i % 5) as f32;
    }
    let scene = Scene::from(&splats);
    let camera = made::straight(150, 110, 60.0);
    let view = View::new(&gpu, &scene, &camera, &RenderOptions::default());
    let rects: Vec<[u32; 2]> = gpu.read_back(&view.work().rects);
    let gaussians = view.gaussians();
    let keys: Vec<(u32, u32)> = view
        .order()
        .into_iter()
        .filter(|&slot| rects[slot as usize] != [0, 0])
        .map(|slot| gaussians[slot as usize])
        .map(|g| (g % 5, g))
        .collect();
    assert!(keys.len() > 1000 && keys.is_sorted());
}
