//! What is known of some rows of a tile before the scene is planned.

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

/// Rows that are surveyed and counted together.
pub const BLOCK: usize = 262_144;
/// Of so many rows the position of one is kept. Grid and buckets depend on these.
pub(super) const STRIDE: usize = 128;
/// Mixed into the seed of the choice of rows.
const LOOK_STREAM: u64 = 0x6c_6f_6f_6b;

/// What is known of a block of rows of a tile.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Survey {
    pub(super) gaussians: u64,
    pub(super) bounds: Option<Bounds>,
    /// Sum of the expected weights of all.
    pub(super) guessed_total: f64,
    /// Rows of the block and their positions, one of every [`STRIDE`] rows.
    pub(super) positions: Vec<(u32, Vec3)>,
    pub(super) kind: TileKind,
}
messages!(Survey => "survey");

impl Survey {
    /// Looks at `rows` of `tile`, at most [`BLOCK`] of them, which begin at a multiple of it. Reports their bytes to
    /// `progress`.
    ///
    /// # Errors
    /// Those of reading, and [`crate::Error::Cancelled`].
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
            positions: Vec::with_capacity(rows.len().div_ceil(STRIDE)),
            kind: TileKind::of(&part),
        };
        let mut random = SplitMix64::new(seed ^ LOOK_STREAM ^ rows.start as u64);
        let chosen = rows.clone().step_by(STRIDE);
        let mut chosen = chosen.map(|row| row + random.below(STRIDE.min(rows.end - row))).peekable();
        each_part(tile, rows.clone(), &mut part, progress, &mut |start, part| {
            let (own, geometry) = (start..start + part.len(), &part.geometry);
            let bounds = Bounds::of(&geometry.positions);
            survey.bounds.get_or_insert(bounds).add(bounds);
            survey.guessed_total = guessed_total(survey.guessed_total, geometry);
            while let Some(row) = chosen.next_if(|row| own.contains(row)) {
                // Blocks have few rows.
                let number = u32::try_from(row - rows.start).unwrap_or(u32::MAX);
                survey.positions.push((number, geometry.positions[row - own.start]));
            }
            Ok(())
        })?;
        Ok(survey)
    }

    /// Refuses the tile `name` that this block is of, if it has no Gaussians or does not go together with the tile that `before` is
    /// of.
    ///
    /// # Errors
    /// [`Error::Format`] that names the tile.
    pub fn check(&self, name: &str, before: Option<&Self>) -> Result<()> {
        self.kind.check(name, before.map(|before| &before.kind), self.gaussians)
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        usize::try_from(self.gaussians).unwrap_or(usize::MAX)
    }

    /// Whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.gaussians == 0
    }
}
