//! A packed scene of which a page draws what a view shows, within a budget.

use std::ops::Range;

use lexisplat::lexi::{DrawnChunks, LexiFeed};
use lexisplat::packed::{Budget, Eye, Selection};
use serde_json::json;
use wasm_bindgen::prelude::*;

use crate::{Feed, job, thrown};

/// Largest number of bytes of a request, unless a single range has more. A view that moves on waits for requests under way.
const LONGEST_RUN: u64 = 512 << 10;

/// Takes the ranges of a packed file that a view needs, and tells which chunks to draw. It decodes nothing itself.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Stream {
    feed: LexiFeed,
    drawn: DrawnChunks,
    /// The chunks that are drawn after the last change.
    bases: Vec<usize>,
    /// The runs of bytes that were asked for and did not come yet.
    asked: Vec<Range<u64>>,
}

#[wasm_bindgen]
impl Stream {
    /// Returns the stream of a file whose start has come to `feed`. It wants nothing until it looks.
    #[wasm_bindgen(constructor)]
    #[must_use]
    pub fn new(feed: Feed) -> Self {
        let feed = feed.into_inner();
        Self { feed, drawn: DrawnChunks::default(), bases: Vec::new(), asked: Vec::new() }
    }

    /// Asks for the first layer alone, at most `splats` Gaussians, as long as there is no view. Returns their number and the
    /// number of bytes.
    pub fn begin(&mut self, splats: f64) -> Vec<f64> {
        let first = self.feed.outline().and_then(|outline| outline.layers.first());
        let first = first.map_or(0, |layer| layer.gaussians);
        self.choose(&Eye::at([0.0; 3]), &Budget::default().with_splats(whole(splats).min(first)))
    }

    /// Asks for what a view shows, with at most `splats` Gaussians and `bytes` bytes of the file. `eye` has the position, the
    /// direction of view, half the angle of the cone that holds the picture, and the angle of a pixel, in radians. Returns the
    /// number of Gaussians and of bytes that were chosen.
    pub fn look(&mut self, eye: &[f32], splats: f64, bytes: f64) -> Vec<f64> {
        let &[x, y, z, right, down, forward, half_angle, pixel] = eye else { return Vec::new() };
        let eye = Eye::at([x, y, z])
            .with_forward([right, down, forward])
            .with_half_angle(half_angle)
            .with_pixel(pixel);
        self.choose(&eye, &Budget::default().with_splats(whole(splats)).with_bytes(whole(bytes)))
    }

    #[expect(clippy::cast_precision_loss, reason = "numbers below 2^53")]
    fn choose(&mut self, eye: &Eye, budget: &Budget) -> Vec<f64> {
        let Selection { splats, bytes, .. } = self.feed.look(eye, budget).unwrap_or_default();
        vec![splats as f64, bytes as f64]
    }

    /// Returns the bytes to fetch besides those that were asked for, so that at most `most` requests run at the same time: of
    /// each run the first byte and the byte after the last.
    #[expect(clippy::cast_precision_loss, reason = "files are far below 2^53 bytes")]
    pub fn wants(&mut self, most: usize) -> Vec<f64> {
        let runs = self.feed.wanted_runs(most, LONGEST_RUN);
        let is_new = |run: &Range<u64>, asked: &[Range<u64>]| {
            asked.iter().all(|asked| asked.end <= run.start || run.end <= asked.start)
        };
        let mut out = Vec::new();
        for run in runs {
            if self.asked.len() < most && is_new(&run, &self.asked) {
                out.extend([run.start as f64, run.end as f64]);
                self.asked.push(run);
            }
        }
        out
    }

    /// Takes the bytes of a request, which are at `at` in the file. Bytes that no view needs any more are dropped.
    ///
    /// # Errors
    /// An error that tells what is wrong with the bytes.
    pub fn feed(&mut self, at: f64, bytes: &[u8]) -> Result<(), JsError> {
        let at = whole(at);
        self.asked.retain(|asked| asked.start != at);
        self.feed.feed(at, bytes).map_err(thrown)
    }

    /// Returns the next change of the chunks that are drawn, as JSON: `removed` and `decoded` are lists of chunks. It is taken
    /// for done. At most `most` chunks are new, and at most `most` are finer than before. `None` if nothing changes.
    pub fn change(&mut self, most: usize) -> Option<String> {
        let change = self.drawn.update(&self.feed, most);
        let text = json!({ "removed": change.removed, "decoded": change.decoded }).to_string();
        let is_empty = change.is_empty();
        self.bases = change.drawn;
        (!is_empty).then_some(text)
    }

    /// Returns the job of a chunk that the last change decodes, for a [`Decoder`](crate::Decoder).
    #[must_use]
    pub fn job(&self, chunk: usize) -> Vec<u8> {
        job::write(&self.feed, chunk, &self.bases)
    }

    /// Returns the number of bytes of the file that are held.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
    pub fn held(&self) -> f64 {
        self.feed.held_bytes() as f64
    }
}

/// Returns a number from JavaScript as an integer. It saturates.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(number: f64) -> u64 {
    number as u64
}
