//! Culling and compaction.

use lexisplat::ShDegree;

use super::super::constants::{Counter, GROUP};
use super::{View, gpu, made};
use crate::camera::Camera;
use crate::cpu::{RenderOptions, twin};
use crate::scene::Scene;

/// Checks one view; how many Gaussians it has and how many are marked.
fn check(view: &View, scene: &Scene<'_>, camera: &Camera) -> [usize; 2] {
    let masks: Vec<u32> = view.gpu.read_back(&view.work().masks);
    let marked = |i: usize| masks[i / 32] >> (i % 32) & 1 == 1;
    for seen in twin::seen(scene, camera) {
        // The near limit is rounded otherwise.
        if f32::from_bits(seen.depth) > camera.near * 1.001 {
            assert!(marked(seen.gaussian as usize), "lost {seen:?}");
        }
    }
    let all: Vec<u32> = (0..scene.len() as u32).filter(|&i| marked(i as usize)).collect();
    assert_eq!(view.gaussians(), all, "slots in order of index");
    assert_eq!(view.counter(Counter::Found), all.len());
    let block = GROUP as usize;
    let starts: Vec<u32> = view.gpu.read_back(&view.work().starts);
    for (b, start) in starts.iter().take(scene.len().div_ceil(block) + 1).enumerate() {
        let before = all.partition_point(|&i| (i as usize) < b * block);
        assert_eq!(*start as usize, before, "block {b}");
    }
    for i in scene.len()..scene.len().next_multiple_of(block) {
        assert!(!marked(i), "{i} is beyond the scene");
    }
    [scene.len(), all.len()]
}

#[test]
fn culling_loses_nothing_and_slots_keep_order() {
    let Some(gpu) = gpu() else { return };
    let mut total = [0; 2];
    for count in [1, 255, 256, 257, 3000] {
        for seed in 0..4 {
            let splats = made::scene(seed, count, ShDegree::ZERO, seed % 2 == 0);
            let scene = Scene::from(&splats);
            // From within the scene and narrow, so that much is beside, behind and close.
            let mut camera = made::camera(seed, 90, 50);
            camera.position = camera.position.map(|v| v * [1.0, 0.4, 0.1][seed as usize % 3]);
            camera.fx *= 2.0;
            let view = View::new(&gpu, &scene, &camera, &RenderOptions::default());
            let counts = check(&view, &scene, &camera);
            total = [total[0] + counts[0], total[1] + counts[1]];
        }
    }
    let [all, marked] = total;
    assert!(marked < all * 3 / 4 && marked > all / 20, "{marked} of {all} marked: no test of culling");
}
