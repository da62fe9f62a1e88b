//! Pixels from given splats and lists.

use lexisplat::ShDegree;

use super::{View, gpu, made};
use crate::conventions::TILE;
use crate::cpu::{RenderOptions, twin};
use crate::scene::Scene;

/// Largest difference of all but one pixel in 1000: exponentials are rounded otherwise.
const USUAL: f32 = 2e-5;
/// Of any: an opacity at the least falls on either side, times the brightest colours of the scene.
const MOST: f32 = 2.5 / 255.0;

#[test]
fn tiles_are_blended_as_on_the_processor() {
    let Some(gpu) = gpu() else { return };
    let background = [0.2, 0.5, 1.0];
    let (mut pixels, mut unusual, mut full) = (0, 0, 0);
    for seed in 0..4 {
        let mut splats = made::scene(seed, 3000, ShDegree::ONE, seed % 2 == 0);
        // Many opaque ones, so that pixels finish before their lists do, and lists longer than a batch.
        for opacity in splats.geometry.opacities.iter_mut().step_by(3) {
            *opacity += 3.0 * (seed % 2) as f32;
        }
        let scene = Scene::from(&splats);
        let camera = made::camera(seed, 75, 50);
        let options = RenderOptions::default().with_background(background);
        let view = View::new(&gpu, &scene, &camera, &options);
        let centres: Vec<[f32; 4]> = gpu.read_back(&view.work().centres);
        let conics: Vec<[f32; 4]> = gpu.read_back(&view.work().conics);
        let colours: Vec<f32> = gpu.read_back(&view.work().colours);
        let entries = view.entries();
        let columns = view.shape().columns as usize;
        for tile in 0..columns * view.shape().rows as usize {
            let list: Vec<twin::Seen> = entries
                .iter()
                .filter(|entry| entry.0 as usize == tile)
                .map(|&(_, slot)| {
                    let s = slot as usize;
                    let ([x, y, a, b], [c, _, opacity, _]) = (centres[s], conics[s]);
                    twin::Seen {
                        gaussian: slot,
                        centre: [x, y],
                        conic: [a, b, c],
                        opacity,
                        colour: std::array::from_fn(|k| colours[3 * s + k]),
                        depth: 0,
                        tiles: [[0; 2]; 2],
                    }
                })
                .collect();
            full += usize::from(list.len() > TILE * TILE);
            let at = [tile % columns, tile / columns];
            let expected = twin::tile(&list, at, background);
            for (k, expected) in expected.into_iter().enumerate() {
                let (x, y) = (at[0] * TILE + k % TILE, at[1] * TILE + k / TILE);
                if x >= camera.width as usize || y >= camera.height as usize {
                    continue;
                }
                let found = view.image.pixels[y * camera.width as usize + x];
                let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(off <= MOST, "pixel {x}, {y}: {found:?} for {expected:?}");
                unusual += usize::from(off > USUAL);
                pixels += 1;
            }
        }
    }
    assert!(unusual * 1000 <= pixels, "{unusual} of {pixels}");
    assert!(full > 10, "{full} lists of more than one batch");
}
