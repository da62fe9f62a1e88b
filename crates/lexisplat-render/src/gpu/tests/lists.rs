//! The tiles' lists.

use std::collections::{HashMap, HashSet};

use lexisplat::ShDegree;

use super::{View, gpu, made};
use crate::camera::Camera;
use crate::conventions::{ALPHA_MIN, TILE};
use crate::cpu::{RenderOptions, twin};
use crate::scene::Scene;

/// Opacities this close to the least, relatively, may fall on either side.
const ALPHA_ROUNDING: f64 = 1e-3;

/// The largest opacity of a splat in the pixels of a tile.
fn most_alpha(seen: &twin::Seen, [column, row]: [usize; 2], size: [usize; 2]) -> f64 {
    let [a, b, c] = seen.conic.map(f64::from);
    let mut most = 0.0_f64;
    for y in row * TILE..((row + 1) * TILE).min(size[1]) {
        for x in column * TILE..((column + 1) * TILE).min(size[0]) {
            let (dx, dy) = (f64::from(seen.centre[0]) - x as f64, f64::from(seen.centre[1]) - y as f64);
            let power = -0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy;
            if power <= 0.0 {
                most = most.max(f64::from(seen.opacity) * power.exp());
            }
        }
    }
    most
}

/// Checks the lists of one view; how many entries they and INRIA's have, and how many are needed.
fn check(view: &View, scene: &Scene<'_>, camera: &Camera) -> [usize; 3] {
    let seen = twin::seen(scene, camera);
    let by_gaussian: HashMap<u32, &twin::Seen> = seen.iter().map(|s| (s.gaussian, s)).collect();
    let (gaussians, entries) = (view.gaussians(), view.entries());
    let columns = view.shape().columns as usize;
    let tiles = columns * view.shape().rows as usize;
    assert_eq!(view.shape().band_rows, view.shape().rows);

    // The ranges cut the sorted entries into the tiles' lists.
    let ranges: Vec<[u32; 2]> = view.gpu.read_back(&view.work().ranges);
    let mut lists: Vec<Vec<u32>> = vec![Vec::new(); tiles];
    for &(tile, slot) in &entries {
        // Entries of no tile come last.
        if (tile as usize) < tiles {
            lists[tile as usize].push(slot);
        }
    }
    assert!(entries.is_sorted_by_key(|entry| entry.0));
    for (tile, list) in lists.iter().enumerate() {
        let [first, end] = ranges[tile].map(|v| v as usize);
        let found: Vec<u32> = entries[first..end].iter().map(|entry| entry.1).collect();
        assert_eq!(&found, list, "tile {tile}");
    }

    // Each is in order of depth and holds no splat twice.
    let mut rank = vec![0; gaussians.len()];
    for (position, slot) in view.order().into_iter().enumerate() {
        rank[slot as usize] = position;
    }
    let (mut listed, mut needed, mut outside) = (0, 0, 0);
    for (tile, list) in lists.iter().enumerate() {
        assert!(list.is_sorted_by(|&p, &q| rank[p as usize] < rank[q as usize]), "tile {tile}");
        let at = [tile % columns, tile / columns];
        let own: HashSet<u32> = list.iter().map(|&slot| gaussians[slot as usize]).collect();
        listed += own.len();
        for s in &seen {
            let inside =
                (0..2).all(|k| (usize::from(s.tiles[0][k])..usize::from(s.tiles[1][k])).contains(&at[k]));
            let size = [camera.width as usize, camera.height as usize];
            if inside && most_alpha(s, at, size) >= f64::from(ALPHA_MIN) * (1.0 + ALPHA_ROUNDING) {
                needed += 1;
                assert!(own.contains(&s.gaussian), "tile {at:?} lacks {s:?}");
            }
        }
        outside += own
            .iter()
            .filter(|g| {
                by_gaussian.get(g).is_none_or(|s| {
                    (0..2).any(|k| !(usize::from(s.tiles[0][k])..usize::from(s.tiles[1][k])).contains(&at[k]))
                })
            })
            .count();
    }
    // Rounding moves a border between tiles now and then.
    assert!(outside * 500 <= listed, "{outside} of {listed} are not in INRIA's rectangles");
    let inria =
        seen.iter().map(|s| (0..2).map(|k| usize::from(s.tiles[1][k] - s.tiles[0][k])).product::<usize>());
    [listed, inria.sum(), needed]
}

#[test]
fn lists_hold_all_that_counts_and_little_else() {
    let Some(gpu) = gpu() else { return };
    let mut total = [0; 3];
    for seed in 0..6 {
        let mut splats = made::scene(seed, 700, ShDegree::ZERO, seed % 2 == 0);
        // Long and thin in all directions, where ellipses and rectangles differ most.
        for scales in splats.geometry.scales.iter_mut().skip(3).step_by(4) {
            *scales = [-0.5, -6.0, -7.0];
        }
        let scene = Scene::from(&splats);
        let mut camera =
            made::camera(seed, [150, 16, 17][seed as usize % 3], [110, 16, 200][seed as usize % 3]);
        camera.position = camera.position.map(|v| v * [1.0, 0.3][seed as usize / 3]);
        let view = View::new(&gpu, &scene, &camera, &RenderOptions::default());
        let counts = check(&view, &scene, &camera);
        total = std::array::from_fn(|k| total[k] + counts[k]);
    }
    let [listed, inria, needed] = total;
    assert!(needed > 3000 && listed <= inria, "{listed} entries, {needed} needed, {inria} of INRIA's");
    assert!(listed * 10 < needed * 14, "{listed} entries where {needed} are needed");
}
