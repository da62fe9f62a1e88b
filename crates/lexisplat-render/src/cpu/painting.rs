//! A picture that is being drawn, some rows at a time.

use std::ops::Range;

use lexisplat::simd::Simd;
use web_time::Instant;

use crate::conventions::TILE;
use crate::image::Image;
use crate::parallel::*;

use super::blend::{Canvas, Tile};
use super::project::Projection;
use super::tiles;
use super::workspace::Workspace;
use super::{Drawn, RenderOptions};

/// Times the stages of a picture.
#[derive(Debug)]
pub(super) struct StageTimer {
    start: Instant,
    times: Vec<(&'static str, f64)>,
}

impl StageTimer {
    pub(super) fn start() -> Self {
        Self { start: Instant::now(), times: Vec::new() }
    }

    /// Begins a stage anew, so that the time since the last call belongs to none.
    fn resume(&mut self) {
        self.start = Instant::now();
    }

    /// Adds the time since the last call to the duration of `stage`.
    pub(super) fn end(&mut self, stage: &'static str) {
        let now = Instant::now();
        let milliseconds = now.duration_since(self.start).as_secs_f64() * 1e3;
        match self.times.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += milliseconds,
            None => self.times.push((stage, milliseconds)),
        }
        self.start = now;
    }
}

/// A picture whose Gaussians are projected and sorted in a [`Workspace`], which must not be used for another picture
/// until this one is whole or dropped.
#[derive(Debug)]
pub(super) struct Painting {
    projection: Projection,
    background: [f32; 3],
    image: Image,
    /// Number of pixels that are drawn. They are the first of the picture.
    done: usize,
    bands: std::vec::IntoIter<Range<usize>>,
    gaussians: usize,
    stages: StageTimer,
}

impl Painting {
    /// Begins the picture of the Gaussians that were projected in `workspace`. The lists of tiles that are in memory at
    /// once have at most `max_entries` entries, or are of one row of tiles.
    pub(super) fn begin(
        workspace: &mut Workspace,
        projection: Projection,
        options: &RenderOptions,
        max_entries: u64,
        mut stages: StageTimer,
    ) -> Self {
        stages.end("project");
        let Workspace { visible, order, .. } = workspace;
        order.sort(visible);
        stages.end("sort");
        let [width, height] = projection.camera.picture_size();
        let background = options.behind(&projection.camera);
        let pixels = vec![background; width as usize * height as usize];
        let bands = tiles::bands(order, projection.grid, max_entries).into_iter();
        stages.end("tiles");
        Self {
            bands,
            projection,
            background,
            image: Image { width, height, pixels },
            done: 0,
            gaussians: order.keys.len(),
            stages,
        }
    }

    /// Draws the next rows. Returns whether there were any left.
    pub(super) fn advance(&mut self, workspace: &mut Workspace) -> bool {
        let Some(band) = self.bands.next() else { return false };
        self.stages.resume();
        let Workspace { visible, order, lists, .. } = workspace;
        let Self { projection, background, image, .. } = self;
        let (simd, background) = (Simd::current(), *background);
        lists.fill(order, projection.grid, projection.chosen.as_ref(), &band);
        self.stages.end("tiles");
        let tiles = projection.tiles(&band);
        // Tiles that lie side by side in the drawn picture: a row of tiles, or one tile of a set.
        let rows: Vec<&[(usize, Tile)]> = tiles.chunk_by(|a, b| a.1.drawn()[1] == b.1.drawn()[1]).collect();
        let side = image.width as usize;
        let rest = image.pixels.get_mut(self.done..).unwrap_or_default();
        let own = (rows.len() * TILE * side).min(rest.len());
        let drawn = &mut rest[..own];
        self.done += own;
        drawn.par_chunks_mut(side * TILE).zip(rows).for_each(|(lines, row)| {
            let mut canvas = Canvas::default();
            for &(tile, place) in row {
                canvas.draw(simd, &visible.slots, lists.of(tile), place, background);
                for (y, line) in lines.chunks_mut(side).enumerate() {
                    let line = line[place.drawn()[0]..].iter_mut().take(TILE);
                    line.enumerate().for_each(|(x, pixel)| *pixel = canvas.pixel(x, y, background));
                }
            }
        });
        self.stages.end("blend");
        true
    }

    /// Returns the picture. Rows that were not drawn have the colour of the background.
    pub(super) fn finish(self) -> Drawn {
        Drawn { image: self.image, gaussians: self.gaussians, stage_times: self.stages.times }
    }
}
