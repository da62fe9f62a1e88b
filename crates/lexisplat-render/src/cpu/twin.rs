//! The steps of this renderer, one by one, for tests of the GPU to compare with.

use crate::camera::Camera;
use crate::conventions::TILE;
use crate::radiance::Radiance;
use crate::scene::Scene;
use lexisplat::simd::Simd;

use super::project::{Projection, Splat, Visible};
use super::{blend, order, project};

/// A Gaussian on screen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) gaussian: u32,
    pub(crate) centre: [f32; 2],
    pub(crate) conic: [f32; 3],
    pub(crate) opacity: f32,
    pub(crate) colour: [f32; 3],
    /// Bits of the view-space z.
    pub(crate) depth: u32,
    /// INRIA's tiles: the first, and the first after the last, as (column, row).
    pub(crate) tiles: [[u16; 2]; 2],
}

/// Powers above this are within the range of `exp`.
const CUTOFF: f32 = -80.0;

/// Returns what INRIA's rules draw, with the nearest first.
pub(crate) fn seen(scene: &Scene<'_>, camera: &Camera) -> Vec<Seen> {
    let projection = Projection::new(camera, scene.meta().antialiased).untightened();
    let splats = order::by_depth(project::project(scene.geometry(), &Radiance::new(scene), &projection));
    splats
        .into_iter()
        .map(|Visible { splat, depth, rect, gaussian }| Seen {
            gaussian,
            centre: splat.centre,
            conic: splat.conic,
            opacity: splat.opacity,
            colour: splat.colour,
            depth,
            tiles: rect.corners(),
        })
        .collect()
}

/// Returns the pixels of the tile at `[column, row]`, row by row, drawn with `splats` from front to back.
pub(crate) fn tile(splats: &[Seen], at: [usize; 2], background: [f32; 3]) -> Vec<[f32; 3]> {
    let pixels = [[0, u16::MAX]; 2];
    let visible: Vec<Visible> = splats
        .iter()
        .map(|&Seen { centre, conic, opacity, colour, .. }| Visible {
            splat: Splat { centre, conic, opacity, colour, cutoff: CUTOFF, pixels },
            ..Visible::default()
        })
        .collect();
    let list = (0..).take(visible.len());
    let pixels = blend::tile(Simd::current(), &visible, list, at, background);
    (0..TILE * TILE).map(|k| pixels.pixel(k % TILE, k / TILE)).collect()
}
