//! Surveys of the rows of a tile, from which a scene is planned.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::message::messages;
use crate::packed::encode::canonical::Bounds;
use crate::scene::extra::ScalarType;
use crate::scene::sensitivity::guessed_total;
use crate::scene::sh::ShDegree;
use crate::scene::source::SplatSource;
use crate::scene::splats::{SceneMeta, Splats};
use crate::stream::each_part;
use crate::support::error::{Error, Result};
use crate::support::maths::Vec3;
use crate::support::progress::Progress;
use crate::support::rng::SplitMix64;

/// Most rows of a survey.
pub const BLOCK: usize = 262_144;
/// Number of rows of which the position of one is kept. The grid and the buckets depend on these positions.
pub(super) const STRIDE: usize = 128;
/// Mixed into the seed with which rows are chosen.
const LOOK_STREAM: u64 = 0x6c_6f_6f_6b;

/// A survey of a block of rows of a tile.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Survey {
    pub(super) gaussians: u64,
    pub(super) bounds: Option<Bounds>,
    /// Sum of the guessed weights of all Gaussians of the block.
    pub(super) guessed_total: f64,
    /// The number in the block, and the position, of one of every [`STRIDE`] rows.
    pub(super) positions: Vec<(u32, Vec3)>,
    pub(super) like: Like,
}
messages!(Survey => "survey");

/// The properties in which all tiles of a scene agree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Like {
    pub(super) degree: ShDegree,
    pub(super) meta: SceneMeta,
    pub(super) extras: Vec<(String, ScalarType)>,
}

impl Like {
    pub(super) fn of(empty: &Splats) -> Self {
        let extras = &empty.geometry.extras;
        Self {
            degree: empty.degree,
            meta: empty.meta.clone(),
            extras: extras.iter().map(|extra| (extra.name.clone(), extra.values.scalar_type())).collect(),
        }
    }

    /// Refuses a tile that has no Gaussians, or that does not agree with `before`. `gaussians` is the number of Gaussians
    /// of the tile.
    pub(super) fn check(&self, name: &str, before: Option<&Self>, gaussians: u64) -> Result<()> {
        let wrong = match before.and_then(|before| before.difference(self)) {
            _ if gaussians == 0 => "no Gaussians".to_owned(),
            Some(difference) => difference,
            None => return Ok(()),
        };
        Err(Error::malformed(name, format!("the tile has {wrong}")))
    }

    /// Returns a description of the first property in which `next` does not agree with `self`; `None` if they agree.
    pub(super) fn difference(&self, next: &Self) -> Option<String> {
        if self.degree != next.degree {
            let (own, other) = (self.degree.get(), next.degree.get());
            return Some(format!("SH degree {other}, where the tiles before have degree {own}"));
        }
        if self.meta.antialiased != next.meta.antialiased {
            return Some("another antialiasing mark than the tiles before".to_owned());
        }
        let names = |extras: &[(String, ScalarType)]| {
            let all = extras.iter().map(|(name, kind)| format!("{name} ({})", kind.name()));
            if extras.is_empty() { "none".to_owned() } else { all.collect::<Vec<_>>().join(", ") }
        };
        (self.extras != next.extras).then(|| {
            format!(
                "the extra properties {}, where the tiles before have {}; leave extras out to go on",
                names(&next.extras),
                names(&self.extras)
            )
        })
    }
}

impl Survey {
    /// Surveys `rows` of `tile`: at most [`BLOCK`] rows, which begin at a multiple of it. Reports their bytes to
    /// `progress`.
    ///
    /// # Errors
    /// Those of reading the tile, and [`crate::Error::Cancelled`].
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
            like: Like::of(&part),
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
    /// [`Error::Format`] that names the tile.
    pub fn check(&self, name: &str, before: Option<&Self>) -> Result<()> {
        self.like.check(name, before.map(|before| &before.like), self.gaussians)
    }

    /// Refuses the tile `name` if it has no Gaussians, or if it does not agree with `before`, an empty scene with the
    /// properties of earlier tiles.
    pub(crate) fn check_tile(
        name: &str,
        before: Option<&Splats>,
        own: &Splats,
        gaussians: usize,
    ) -> Result<()> {
        Like::of(own).check(name, before.map(Like::of).as_ref(), gaussians as u64)
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
