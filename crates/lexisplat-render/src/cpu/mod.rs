//! The reference rasteriser: 3DGS's rules on the processor.
//!
//! `project` turns Gaussians into ellipses on screen, `order` sorts them by depth, `tiles` lists for
//! every tile what may touch it, and `blend` draws the tiles. Every step works in parallel on pieces
//! whose borders and order do not depend on the number of threads, and uses only operations that round
//! the same everywhere, so a picture is the same bit for bit on any machine.

mod blend;
mod math;
mod order;
mod project;
mod tiles;

use rayon::prelude::*;

use crate::camera::Camera;
use crate::conventions::TILE;
use crate::image::Image;
use crate::radiance::Radiance;
use crate::scene::Scene;

/// How to draw. Whether the anti-aliased rules apply is the scene's own mark.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RenderOptions {
    /// Colour behind the scene, 0 to 1 in each channel. Default black.
    pub background: [f32; 3],
}

/// Draws `scene` as `camera` sees it.
///
/// Gaussians with values that are not finite, or that overflow on the way to the screen, are left out.
///
/// # Panics
/// If the scene's arrays differ in length (see `Splats::validate`) or the picture does not fit in
/// memory (see [`Camera::validate`]).
#[must_use]
pub fn render(scene: &Scene<'_>, camera: &Camera, options: &RenderOptions) -> Image {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let mut pixels = vec![options.background; width * height];
    let grid = tiles::Grid::new(width, height);
    let projection = project::Projection::new(camera, grid, scene.meta().antialiased);
    let visible = project::project(scene.geometry(), &Radiance::new(scene), &projection);
    let (splats, rects) = order::by_depth(visible);
    for band in tiles::bands(&rects, grid) {
        let lists = tiles::TileLists::new(&rects, grid, band.clone());
        let count = band.len() * grid.columns;
        let drawn: Vec<blend::TilePixels> = (0..count)
            .into_par_iter()
            .map(|tile| {
                let (column, row) = (tile % grid.columns, band.start + tile / grid.columns);
                blend::tile(&splats, lists.of(tile), [column, row], options.background)
            })
            .collect();
        let rows = &mut pixels[band.start * TILE * width..(band.end * TILE).min(height) * width];
        rows.par_chunks_mut(width * TILE).enumerate().for_each(|(row, rows)| {
            for (y, line) in rows.chunks_mut(width).enumerate() {
                let tiles = &drawn[row * grid.columns..(row + 1) * grid.columns];
                for (piece, tile) in line.chunks_mut(TILE).zip(tiles) {
                    for (x, pixel) in piece.iter_mut().enumerate() {
                        *pixel = tile.pixel(x, y);
                    }
                }
            }
        });
    }
    Image { width: camera.width, height: camera.height, pixels }
}
