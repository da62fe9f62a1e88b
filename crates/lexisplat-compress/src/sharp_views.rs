//! Squares of sharp pictures, which stand for whole pictures.
//!
//! Sharp pictures have so many pixels that drawing all of every view takes minutes. Whole pictures of fewer pixels show
//! another scene: small Gaussians blur, and their errors average out. Some squares of each sharp picture are therefore
//! drawn. The squares lie evenly over a picture, and at other places in the next view. On average over all places, the mean
//! squared error of the squares is the mean squared error of whole pictures.

use std::ops::RangeInclusive;

use lexisplat_render::conventions::TILE;
use lexisplat_render::{Camera, PLASTIC, TileSet};

/// Side of a square, in tiles. Two tiles of a picture are one tile of the picture at half its size.
const SQUARE: u32 = 2;
/// Side of a tile, in pixels.
#[expect(clippy::cast_possible_truncation, reason = "16")]
const TILE_PIXELS: u32 = TILE as u32;
/// The golden ratio less 1: the step from the phases of one view to those of the next.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Returns the cameras, restricted to squares so that they draw about `pixels` pixels in all. If their whole pictures have
/// no more pixels, they stay as they are.
pub(crate) fn sampled(cameras: Vec<Camera>, pixels: u64) -> Vec<Camera> {
    let all: u64 = cameras.iter().map(Camera::drawn_pixels).sum();
    if all <= pixels {
        return cameras;
    }
    let share = pixels as f64 / all as f64;
    cameras.into_iter().enumerate().map(|(k, camera)| squares_of(camera, 0.0..=share, k)).collect()
}

/// Returns the cameras as [`sampled`] does, and then again with other squares, until these draw about `most` pixels in all or
/// every square once.
pub(crate) fn sampled_again(cameras: Vec<Camera>, pixels: u64, most: u64) -> Vec<Camera> {
    let all: u64 = cameras.iter().map(Camera::drawn_pixels).sum();
    let rounds = (most.min(all) + pixels / 2) / pixels.max(1);
    let mut some = sampled(cameras.clone(), pixels);
    let share = |round: u64| (pixels * round) as f64 / all as f64;
    for round in 1..rounds {
        let phases = share(round)..=share(round + 1);
        let squares = |(k, camera): (usize, &Camera)| squares_of(camera.clone(), phases.clone(), k);
        some.extend(cameras.iter().enumerate().map(squares));
    }
    some
}

/// Returns `camera`, the `k`-th, restricted to the squares with these phases, from 0 to 1.
fn squares_of(camera: Camera, phases: RangeInclusive<f64>, k: usize) -> Camera {
    let begin = (k as f64 * GOLDEN).fract();
    let phase = |x: u32, y: u32| (begin + f64::from(x) * PLASTIC[0] + f64::from(y) * PLASTIC[1]).fract();
    let chosen = |phases: RangeInclusive<f64>| {
        TileSet::new(camera.width, camera.height, |x, y| phases.contains(&phase(x / SQUARE, y / SQUARE)))
    };
    let mut set = chosen(phases);
    if set.tiles().is_empty() {
        // A small picture has at least one square: that with the lowest phase.
        let squares = |side: u32| 0..side.div_ceil(SQUARE * TILE_PIXELS);
        let phases = squares(camera.width).flat_map(|x| squares(camera.height).map(move |y| phase(x, y)));
        set = chosen(0.0..=phases.fold(1.0, f64::min));
    }
    camera.with_tiles(set)
}

#[cfg(test)]
mod tests {
    use lexisplat::Silent;
    use lexisplat_render::{Renderer, Scene, orbit};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;
    use crate::Judge;

    #[test]
    fn squares_are_as_many_as_asked_for() {
        let splats = scene(&SampleOptions::new(50, 1));
        let cameras = orbit(&splats.geometry, 20, 640, 400);
        let all: u64 = 20 * 640 * 400;
        assert_eq!(sampled(cameras.clone(), all), cameras);
        for pixels in [all / 2, all / 7, all / 40] {
            let some = sampled(cameras.clone(), pixels);
            let found: u64 = some.iter().map(Camera::drawn_pixels).sum();
            assert!((found as f64 / pixels as f64 - 1.0).abs() < 0.05, "{found} {pixels}");
            assert!(some.windows(2).all(|pair| pair[0].tiles != pair[1].tiles));
        }
        assert!(sampled(cameras, 1).iter().all(|camera| camera.drawn_pixels() > 0));
    }

    #[test]
    fn later_rounds_draw_other_squares() {
        let splats = scene(&SampleOptions::new(50, 1));
        let cameras = orbit(&splats.geometry, 4, 640, 400);
        let all: u64 = 4 * 640 * 400;
        assert_eq!(sampled_again(cameras.clone(), all, 2 * all), cameras);
        let first = sampled(cameras.clone(), all / 5);
        assert_eq!(sampled_again(cameras.clone(), all / 5, 0), first);
        // Three rounds draw three fifths of the tiles, each tile once; five rounds draw all.
        for (most, share) in [(3 * all / 5, 0.6), (2 * all, 1.0)] {
            let some = sampled_again(cameras.clone(), all / 5, most);
            assert_eq!(some[..4], first[..]);
            let mut tiles: Vec<u32> =
                some.iter().step_by(4).flat_map(|c| c.tiles.as_ref().unwrap().tiles().to_vec()).collect();
            let drawn = tiles.len();
            tiles.sort_unstable();
            tiles.dedup();
            assert_eq!(tiles.len(), drawn);
            assert!((drawn as f64 / (40.0 * 25.0) - share).abs() < 0.03, "{drawn}");
        }
    }

    #[test]
    fn squares_score_as_whole_pictures_do() {
        let splats = scene(&SampleOptions::new(1500, 3));
        let mut other = splats.clone();
        other.geometry.dc.iter_mut().enumerate().for_each(|(i, dc)| dc[i % 3] += 0.2 * (i as f32).sin());
        let cameras = orbit(&splats.geometry, 12, 640, 400);
        let score = |cameras: &[Camera]| {
            let mut judge = Judge::new(Renderer::cpu(), &splats, cameras, true, &Silent).unwrap();
            judge.score(Scene::from(&other), &Silent).unwrap()
        };
        let whole = score(&cameras);
        let some = score(&sampled(cameras, 12 * 640 * 400 / 5));
        assert!((some.mean - whole.mean).abs() < 0.3, "{some:?} {whole:?}");
    }
}
