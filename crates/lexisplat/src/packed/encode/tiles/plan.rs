//! How a scene of tiles is divided into buckets.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::message::messages;
use super::survey::{BLOCK, Survey};
use super::{BUCKET, message};
use crate::packed::curve::{Bounds, Grid, MortonKey};
use crate::packed::encode::pack::{PackOptions, expected_step};
use crate::scene::extra::{Extra, ExtraValues};
use crate::scene::offset::{Offset, shift};
use crate::scene::source::SplatSource;
use crate::scene::splats::{Geometry, Splats};
use crate::scene::tile_kind::TileKind;
use crate::stream::{RowLayout, each_part};
use crate::support::crc32;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_GAUSSIANS};
use crate::support::maths::Vec3;
use crate::support::progress::Progress;

/// Most groups of buckets whose samples are learned from. Every group sends a sum in every round, and rounds take a second in all.
const GROUPS: usize = 2;
/// Most buckets that are sampled, evenly spread, so that drawing samples takes as long in any scene.
const SAMPLED: usize = 32;

/// Rows of a piece of a tile that a bucket reads whole if one of them is its own.
const RUN: usize = 4096;

/// What is settled of a scene before any of it is looked at.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Plan {
    /// What tells the plan from others: a checksum of all else, with the usual step.
    scene: u32,
    pub(super) options: PackOptions,
    /// The overall step.
    pub(super) step: f64,
    /// Of each tile the number of Gaussians before it; then their number in all.
    firsts: Vec<u64>,
    pub(super) grid: Grid,
    /// Sum of the expected weights of all Gaussians.
    pub(super) guessed_total: f64,
    pub(super) kind: TileKind,
    /// Where buckets end but the last: of all tiles, or of each on its own.
    ends: Vec<Vec<MortonKey>>,
}
messages!(Plan => "plan");

impl Plan {
    /// Plans a scene for pictures of about `decibels`. `tiles` has the name of each tile and the surveys of its blocks, in order.
    /// With `one_each` every tile becomes a file of its own, with the steps, the dictionary and the tables of all.
    ///
    /// # Errors
    /// [`Error::Parameter`] for options out of range and no tiles, [`Error::Format`] that names a tile without Gaussians or with
    /// another degree, other extras or another mark than the first, [`Error::Limit`] for too many Gaussians.
    pub fn new(
        tiles: &[(String, Vec<Survey>)],
        options: &PackOptions,
        decibels: f64,
        one_each: bool,
    ) -> Result<Self> {
        Self::with_bucket(tiles, options, decibels, one_each, BUCKET)
    }

    /// The same with buckets of about `bucket` Gaussians.
    pub(crate) fn with_bucket(
        tiles: &[(String, Vec<Survey>)],
        options: &PackOptions,
        decibels: f64,
        one_each: bool,
        bucket: usize,
    ) -> Result<Self> {
        options.check()?;
        let mut kind: Option<TileKind> = None;
        let offset = shared_offset(tiles);
        let mut firsts = vec![0_u64];
        let mut bounds: Option<Bounds> = None;
        let mut guessed_total = 0.0;
        let mut looked: Vec<(usize, Vec3, u64)> = Vec::new();
        let mut total = 0_u64;
        for (number, (name, blocks)) in tiles.iter().enumerate() {
            let Some(first) = blocks.first() else {
                return Err(Error::malformed(name, "the tile has no Gaussians"));
            };
            first.kind.check(name, kind.as_ref(), first.gaussians)?;
            kind.get_or_insert_with(|| first.kind.clone()).meta.join(&first.kind.meta);
            for block in blocks {
                let from = first.kind.meta.offset;
                for &(row, mut position) in &block.positions {
                    shift(std::slice::from_mut(&mut position), from, offset);
                    looked.push((number, position, total + u64::from(row)));
                }
                if let Some(own) = block.bounds.map(|own| own.rebased(from, offset)) {
                    bounds.get_or_insert(own).add(own);
                }
                guessed_total += block.guessed_total;
                total = total.saturating_add(block.gaussians);
            }
            firsts.push(total);
        }
        let Some(mut kind) = kind else { return Err(Error::parameter("tiles", 0, "at least one")) };
        kind.meta.offset = offset;
        Limits::check("Gaussians", total, MAX_GAUSSIANS)?;
        let gaussians = usize::try_from(total).unwrap_or(usize::MAX);
        let positions: Vec<Vec3> = looked.iter().map(|l| l.1).collect();
        let bounds = bounds.unwrap_or_else(|| Bounds::of(&[]));
        let grid = Grid::fit_sample(&positions, bounds, gaussians);
        drop(positions);
        let mut keys: Vec<(usize, MortonKey)> = looked
            .iter()
            .map(|&(tile, position, row)| (if one_each { tile } else { 0 }, placed(&grid, position, row)))
            .collect();
        keys.sort_unstable();
        let count = if one_each { tiles.len() } else { 1 };
        let ends_of = |list: usize| -> Vec<MortonKey> {
            let gaussians = if one_each { firsts[list + 1] - firsts[list] } else { total };
            let from = keys.partition_point(|key| key.0 < list);
            let own = &keys[from..keys.partition_point(|key| key.0 <= list)];
            let parts = usize::try_from(gaussians).unwrap_or(usize::MAX).div_ceil(bucket);
            (1..parts).filter_map(|k| own.get(k * own.len() / parts)).map(|key| key.1).collect()
        };
        let ends = (0..count).map(ends_of).collect();
        let step = expected_step(gaussians, decibels);
        let mut plan =
            Self { scene: 0, options: options.clone(), step, firsts, grid, guessed_total, kind, ends };
        // With its own checksum at the end, the checksum of any message is the same.
        let bytes = plan.to_bytes();
        plan.scene = crc32::hash(bytes.split_last_chunk::<{ message::CHECKSUM }>().map_or(&[], |b| b.0));
        Ok(plan)
    }

    /// How the scene is packed.
    #[must_use]
    pub fn options(&self) -> &PackOptions {
        &self.options
    }

    /// What tells the plan from others. What is made by it holds this.
    pub(super) fn scene(&self) -> u32 {
        self.scene
    }

    /// Refuses `found` things called `kind` if they are of another scene or are not `expected` ones.
    pub(super) fn check(
        &self,
        kind: &'static str,
        scenes: impl IntoIterator<Item = u32>,
        expected: Option<usize>,
    ) -> Result<()> {
        let scenes: Vec<u32> = scenes.into_iter().collect();
        if scenes.iter().any(|&scene| scene != self.scene) {
            return Err(Error::parameter(kind, "of another scene", "of this scene"));
        }
        match expected.filter(|&expected| expected != scenes.len()) {
            Some(expected) => Err(Error::parameter(kind, scenes.len(), format!("all {expected}"))),
            None => Ok(()),
        }
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        usize::try_from(self.firsts.last().copied().unwrap_or(0)).unwrap_or(usize::MAX)
    }

    /// Whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of tiles.
    #[must_use]
    pub fn tiles(&self) -> usize {
        self.firsts.len() - 1
    }

    /// Whether every tile becomes a file of its own.
    #[must_use]
    pub fn is_one_each(&self) -> bool {
        self.ends.len() > 1
    }

    /// Number of buckets.
    #[must_use]
    pub fn buckets(&self) -> usize {
        self.ends.iter().map(|ends| ends.len() + 1).sum()
    }

    /// The buckets of each file, in order.
    #[must_use]
    pub fn files(&self) -> Vec<Range<usize>> {
        let mut start = 0;
        let of = |ends: &Vec<MortonKey>| {
            let own = start..start + ends.len() + 1;
            start = own.end;
            own
        };
        self.ends.iter().map(of).collect()
    }

    /// Number of groups of buckets, each with a sample of its own.
    #[must_use]
    pub fn groups(&self) -> usize {
        self.buckets().min(GROUPS)
    }

    /// The buckets of a group: of all buckets some, evenly spread. None if there is no such group.
    #[must_use]
    pub fn group(&self, group: usize) -> Vec<usize> {
        let (groups, sampled, buckets) = (self.groups(), self.sampled(), self.buckets());
        let own = group * sampled / groups.max(1)..(group + 1) * sampled / groups.max(1);
        own.filter(|_| group < groups).map(|k| k * buckets / sampled).collect()
    }

    /// Number of buckets that are sampled.
    pub(super) fn sampled(&self) -> usize {
        self.buckets().min(SAMPLED)
    }

    /// The blocks of a tile of `gaussians` Gaussians.
    pub fn blocks(gaussians: usize) -> impl Iterator<Item = Range<usize>> {
        (0..gaussians).step_by(BLOCK).map(move |start| start..gaussians.min(start + BLOCK))
    }

    /// Returns the rows, of `rows` of a tile, that each bucket has to read, by the bucket's number: runs of whole pieces of `RUN`
    /// rows of which some are its own. Reports the bytes of the rows to `progress`.
    ///
    /// # Errors
    /// As [`Survey::of`], and [`Error::Parameter`] if there is no such tile.
    pub fn runs(
        &self,
        number: usize,
        tile: &dyn SplatSource,
        rows: Range<usize>,
        progress: &dyn Progress,
    ) -> Result<BTreeMap<usize, Vec<Range<usize>>>> {
        let mut runs: BTreeMap<usize, Vec<Range<usize>>> = BTreeMap::new();
        let buckets = self.buckets_of(number);
        let mut row = rows.start;
        self.each(number, tile, rows.clone(), progress, &mut |_, keys| {
            for key in keys {
                let start = rows.start + (row - rows.start) / RUN * RUN;
                let end = rows.end.min(start + RUN);
                row += 1;
                let own = runs.entry(buckets.of(*key)).or_default();
                match own.last_mut() {
                    Some(last) if last.end >= start => last.end = end,
                    _ => own.push(start..end),
                }
            }
            Ok(())
        })?;
        Ok(runs)
    }

    /// The rows of a tile that each bucket gets, in pieces: of which bucket, and bytes for [`BucketReader::add_piece`]. For tiles that
    /// lie all over the scene, which every bucket would have to read otherwise.
    ///
    /// [`BucketReader::add_piece`]: super::BucketReader::add_piece
    ///
    /// # Errors
    /// As [`Self::runs`].
    pub fn scatter(
        &self,
        number: usize,
        tile: &dyn SplatSource,
        rows: Range<usize>,
        progress: &dyn Progress,
    ) -> Result<Vec<(usize, Vec<u8>)>> {
        let layout = RowLayout::new(self.empty());
        let mut pieces: BTreeMap<usize, Piece> = BTreeMap::new();
        let buckets = self.buckets_of(number);
        let mut bytes = Vec::new();
        self.each(number, tile, rows, progress, &mut |splats, keys| {
            layout.pack(splats, &mut bytes);
            for (key, row) in keys.iter().zip(bytes.chunks_exact(layout.bytes())) {
                let piece = pieces.entry(buckets.of(*key)).or_default();
                piece.places.push(*key);
                piece.rows.extend_from_slice(row);
            }
            Ok(())
        })?;
        let of = |(bucket, piece)| (bucket, Piece { scene: self.scene, bucket, ..piece }.to_bytes());
        Ok(pieces.into_iter().map(of).collect())
    }

    /// Hands `rows` of a tile to `take`, some at a time, with their places.
    pub(crate) fn each(
        &self,
        number: usize,
        tile: &dyn SplatSource,
        rows: Range<usize>,
        progress: &dyn Progress,
        take: &mut dyn FnMut(&mut Splats, &[MortonKey]) -> Result<()>,
    ) -> Result<()> {
        let (first, end) = match self.firsts.get(number..number + 2) {
            Some(&[first, end]) => (first, end),
            _ => return Err(Error::parameter("tile", number, format!("below {}", self.tiles()))),
        };
        if tile.len() as u64 != end - first {
            let expected = format!("{} Gaussians, as when it was surveyed", end - first);
            return Err(Error::parameter("tile", format!("{} Gaussians", tile.len()), expected));
        }
        let mut part = tile.empty();
        let own_offset = part.meta.offset;
        if let Some(difference) = self.kind.difference(&TileKind::of(&part)) {
            return Err(Error::parameter("tile", difference, "what it was when it was surveyed"));
        }
        each_part(tile, rows, &mut part, progress, &mut |start, part| {
            part.geometry.normals = Vec::new();
            shift(&mut part.geometry.positions, own_offset, self.kind.meta.offset);
            let number = (first + start as u64)..;
            let keys = number.zip(&part.geometry.positions);
            let keys: Vec<MortonKey> = keys.map(|(row, &p)| placed(&self.grid, p, row)).collect();
            take(part, &keys)
        })
    }

    /// The buckets of the Gaussians of a tile.
    pub(crate) fn buckets_of(&self, tile: usize) -> Buckets<'_> {
        let list = if self.is_one_each() { tile } else { 0 };
        let before = self.ends.iter().take(list).map(|ends| ends.len() + 1).sum();
        Buckets { before, ends: self.ends.get(list).map_or(&[], Vec::as_slice) }
    }

    /// The number of the first Gaussian of the file that a bucket is of.
    pub(super) fn first_of_file(&self, bucket: usize) -> u64 {
        let files = self.files();
        let file = files.partition_point(|file| file.end <= bucket);
        if self.is_one_each() { self.firsts.get(file).copied().unwrap_or(0) } else { 0 }
    }

    /// Number of Gaussians of the source of a file.
    pub(super) fn gaussians_of_file(&self, file: usize) -> u64 {
        match self.firsts.get(file..file + 2) {
            Some(&[first, end]) if self.is_one_each() => end - first,
            _ => self.firsts.last().copied().unwrap_or(0),
        }
    }

    /// A scene without Gaussians that has everything that all tiles have in common.
    #[must_use]
    pub fn empty(&self) -> Splats {
        let extra =
            |(name, kind): &(String, _)| Extra { name: name.clone(), values: ExtraValues::none(*kind) };
        let extras = self.kind.extras.iter().map(extra).collect();
        Splats {
            geometry: Geometry { extras, ..Geometry::default() },
            degree: self.kind.degree,
            sh_rest: Vec::new(),
            meta: self.kind.meta.clone(),
        }
    }
}

/// Where buckets end, of a tile or of all.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Buckets<'p> {
    /// Number of the buckets of the tiles before.
    before: usize,
    ends: &'p [MortonKey],
}

impl Buckets<'_> {
    /// The bucket of a Gaussian.
    pub(crate) fn of(&self, key: MortonKey) -> usize {
        self.before + self.ends.partition_point(|end| *end <= key)
    }
}

/// Rows of a bucket.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Piece {
    pub(super) scene: u32,
    pub(super) bucket: usize,
    pub(super) places: Vec<MortonKey>,
    pub(super) rows: Vec<u8>,
}

impl Piece {
    /// What its bytes are called.
    const KIND: &'static str = "piece";

    fn to_bytes(&self) -> Vec<u8> {
        message::to_bytes(Self::KIND, self)
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self> {
        message::from_bytes(Self::KIND, bytes)
    }
}

/// The offset of a scene of `tiles`, which is that of the same tiles joined.
fn shared_offset(tiles: &[(String, Vec<Survey>)]) -> Option<Offset> {
    let of = |blocks: &Vec<Survey>| {
        let gaussians = blocks.iter().map(|block| block.gaussians).fold(0, u64::saturating_add);
        Some((blocks.first()?.kind.meta.offset, gaussians))
    };
    let offsets: Vec<_> = tiles.iter().filter_map(|(_, blocks)| of(blocks)).collect();
    Offset::shared(&offsets)
}

fn placed(grid: &Grid, position: Vec3, row: u64) -> MortonKey {
    // Scenes have at most 2^32 - 2 Gaussians.
    MortonKey { cell: grid.cell(position), source: u32::try_from(row).unwrap_or(u32::MAX) }
}
