//! The steps of this renderer one by one, for comparison with the GPU in tests.

use lexisplat::simd::Simd;

use crate::camera::Camera;
use crate::conventions::TILE;
use crate::radiance::Radiance;
use crate::scene::Scene;

use super::blend::{Canvas, Tile};
use super::project::Projection;
use super::splat::{PixelRect, Splat};
use super::workspace::Workspace;

/// A Gaussian on screen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) gaussian: u32,
    pub(crate) centre: [f32; 2],
    pub(crate) conic: [f32; 3],
    pub(crate) opacity: f32,
    pub(crate) colour: [f32; 3],
    /// Bits of the view-space z, as an integer.
    pub(crate) depth: u32,
    /// INRIA's tiles: the first tile, and the first tile after the last, as (column, row).
    pub(crate) tiles: [[u16; 2]; 2],
}

/// A cutoff within the range of `exp`.
const CUTOFF: f32 = -80.0;

/// Returns the Gaussians that INRIA's rules draw, the nearest first.
pub(crate) fn seen(scene: &Scene<'_>, camera: &Camera) -> Vec<Seen> {
    let projection = Projection::new(camera, scene.meta().antialiased).untightened();
    let mut workspace = Workspace::default();
    workspace.project(scene, &Radiance::new(scene), &projection);
    let Workspace { visible, mut order, .. } = workspace;
    order.sort(&visible);
    order
        .keys
        .iter()
        .map(|&(depth, slot)| {
            let Splat { gaussian, centre, conic, opacity, colour, pixels, .. } = visible.slots[slot as usize];
            let (columns, rows) = (pixels.columns(), pixels.rows());
            let corners = [[columns.start, rows.start], [columns.end, rows.end]];
            let tiles = corners.map(|corner| corner.map(|k| u16::try_from(k).unwrap_or(u16::MAX)));
            Seen { gaussian, centre, conic, opacity, colour, depth, tiles }
        })
        .collect()
}

/// Returns the pixels of the tile at `[column, row]`, row by row, drawn with `splats` from front to back.
pub(crate) fn tile(splats: &[Seen], at: [usize; 2], background: [f32; 3]) -> Vec<[f32; 3]> {
    let pixels = PixelRect { min: [0; 2], max: [u16::MAX; 2] };
    let splats: Vec<Splat> = splats
        .iter()
        .map(|&Seen { centre, conic, opacity, colour, .. }| Splat {
            centre,
            conic,
            opacity,
            colour,
            cutoff: CUTOFF,
            pixels,
            ..Splat::default()
        })
        .collect();
    let list: Vec<u32> = (0..).take(splats.len()).collect();
    let whole = Tile::new(at, [usize::MAX; 2]);
    let mut canvas = Canvas::default();
    canvas.draw(Simd::current(), &splats, std::iter::once(&*list), whole, background);
    (0..TILE * TILE).map(|k| canvas.pixel(k % TILE, k / TILE, background)).collect()
}
