//! Surveys of the rows of a tile, from which a scene is planned.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::message::messages;
use crate::packed::curve::Bounds;
use crate::scene::sensitivity::guessed_total;
use crate::scene::source::SplatSource;
use crate::scene::tile_kind::TileKind;
use crate::stream::each_part;
use crate::support::error::Result;
use crate::support::maths::Vec3;
use crate::support::progress::Progress;
use crate::support::rng::SplitMix64;

/// Most rows of a survey.
pub const BLOCK: usize = 262_144;
/// Largest number of rows for each kept position. The grid and the buckets depend on these positions.
const MOST_STRIDE: usize = 128;
/// Least number of positions that are kept of a tile. Of a tile of less than twice as many rows all are kept. More gain
/// nothing (docs/METHOD.md, "More positions").
const LEAST_POSITIONS: u64 = 8192;
/// Mixed into the seed with which rows are chosen.
const LOOK_STREAM: u64 = 0x6c_6f_6f_6b;

/// A survey of a block of rows of a tile.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Survey {
    pub(super) gaussians: u64,
    pub(super) bounds: Option<Bounds>,
    /// Sum of the guessed weights of all Gaussians of the block.
    pub(super) guessed_total: f64,
    /// The number in the block, and the position, of one of every [`stride`] rows.
    pub(super) positions: Vec<(u32, Vec3)>,
    pub(super) kind: TileKind,
}
messages!(Survey => "survey");

impl Survey {
    /// Surveys `rows` of `tile`: at most [`BLOCK`] rows, which begin at a multiple of it. Reports their bytes to
    /// `progress`.
    ///
    /// # Errors
    /// Errors of reading the tile, and [`crate::Error::Cancelled`].
    pub fn of(
        tile: &dyn SplatSource,
        rows: Range<usize>,
        seed: u64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut part = tile.empty();
        let mut survey = Self {
            gaussians: rows.len() as u64,
            bounds: None,
            guessed_total: 0.0,
            positions: Vec::new(),
            kind: TileKind::of(&part),
        };
        let mut chosen = surveyed(tile.len(), rows.clone(), seed).peekable();
        each_part(tile, rows.clone(), &mut part, progress, &mut |start, part| {
            let (own, geometry) = (start..start + part.len(), &part.geometry);
            let bounds = Bounds::of(&geometry.positions);
            survey.bounds.get_or_insert(bounds).add(bounds);
            survey.guessed_total = guessed_total(survey.guessed_total, geometry);
            while let Some(row) = chosen.next_if(|row| own.contains(row)) {
                // A block has at most [`BLOCK`] rows.
                let number = u32::try_from(row - rows.start).unwrap_or(u32::MAX);
                survey.positions.push((number, geometry.positions[row - own.start]));
            }
            Ok(())
        })?;
        Ok(survey)
    }

    /// Refuses the tile `name` of this block if the block has no Gaussians, or if the tile does not agree with the tile of
    /// `before`.
    ///
    /// # Errors
    /// [`crate::Error::Format`] that names the tile.
    pub fn check(&self, name: &str, before: Option<&Self>) -> Result<()> {
        self.kind.check(name, before.map(|before| &before.kind), self.gaussians)
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        usize::try_from(self.gaussians).unwrap_or(usize::MAX)
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.gaussians == 0
    }
}

/// Returns the rows whose positions are kept of the block `rows` of a tile of `all` rows.
pub(in crate::packed) fn surveyed(all: usize, rows: Range<usize>, seed: u64) -> impl Iterator<Item = usize> {
    let (stride, end) = (stride(all as u64), rows.end);
    let mut random = SplitMix64::new(seed ^ LOOK_STREAM ^ rows.start as u64);
    rows.step_by(stride).map(move |row| row + random.below(stride.min(end - row)))
}

/// Returns the number of rows for each kept position of a tile of `rows` rows: a power of two.
pub(super) fn stride(rows: u64) -> usize {
    1 << (rows / LEAST_POSITIONS).max(1).ilog2().min(MOST_STRIDE.ilog2())
}
