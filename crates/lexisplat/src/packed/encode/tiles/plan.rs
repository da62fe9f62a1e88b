//! The plan of a scene of tiles: its grid, and its division into buckets.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::message::messages;
use super::survey::{BLOCK, Survey, stride};
use super::{BUCKET, message};
use crate::packed::curve::{Bounds, Grid, MortonKey};
use crate::packed::encode::options::PackOptions;
use crate::packed::encode::pack::expected_step;
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

/// Most groups of buckets from whose samples the dictionary is learned.
const GROUPS: usize = 2;
/// Most buckets that are sampled. They are evenly spread over all buckets, so that drawing samples takes as long in any
/// scene.
const SAMPLED: usize = 32;

/// Number of rows of a piece of a tile. A bucket reads a piece as a whole if one of its rows is of the bucket.
const RUN: usize = 4096;

/// Everything that is settled about a scene before its Gaussians are measured.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Plan {
    /// Identifies the plan: a checksum of everything else in it.
    id: u32,
    pub(super) options: PackOptions,
    /// The overall step for which the scene is packed.
    pub(super) step: f64,
    /// The number of Gaussians before each tile, followed by the number of all Gaussians.
    firsts: Vec<u64>,
    pub(super) grid: Grid,
    /// Sum of the guessed weights of all Gaussians.
    pub(super) guessed_total: f64,
    pub(super) kind: TileKind,
    /// The end of each bucket but the last, in one list for all tiles, or in one list for each tile.
    ends: Vec<Vec<MortonKey>>,
}
messages!(Plan => "plan");

impl Plan {
    /// Plans a scene for pictures of about `decibels` dB. `tiles` has the name of each tile and the surveys of its blocks,
    /// in order. With `one_each`, every tile becomes a file of its own. All files then have the same steps, dictionary and
    /// tables.
    ///
    /// # Errors
    /// [`Error::Parameter`] if options are out of range or there are no tiles. [`Error::Format`] that names a tile without
    /// Gaussians, or with another SH degree, other extra properties or another antialiasing mark than the first.
    /// [`Error::Limit`] if there are too many Gaussians.
    pub fn new(
        tiles: &[(String, Vec<Survey>)],
        options: &PackOptions,
        decibels: f64,
        one_each: bool,
    ) -> Result<Self> {
        Self::with_bucket(tiles, options, decibels, one_each, BUCKET)
    }

    /// Plans a scene as [`Self::new`] does, with buckets of about `bucket` Gaussians.
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
        // A position of any tile stands for the same number of rows.
        let common = tiles.iter().map(|(_, blocks)| stride(rows(blocks))).max().unwrap_or(1);
        for (number, (name, blocks)) in tiles.iter().enumerate() {
            let Some(first) = blocks.first() else {
                return Err(Error::malformed(name, "the tile has no Gaussians"));
            };
            first.kind.check(name, kind.as_ref(), first.gaussians)?;
            kind.get_or_insert_with(|| first.kind.clone()).meta.join(&first.kind.meta);
            let every = common / stride(rows(blocks));
            for block in blocks {
                let from = first.kind.meta.offset;
                for &(row, mut position) in block.positions.iter().step_by(every) {
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
            let count = usize::try_from(gaussians).unwrap_or(usize::MAX).div_ceil(bucket);
            (1..count).filter_map(|k| own.get(k * own.len() / count)).map(|key| key.1).collect()
        };
        let ends = (0..count).map(ends_of).collect();
        let step = expected_step(gaussians, decibels);
        let mut plan =
            Self { id: 0, options: options.clone(), step, firsts, grid, guessed_total, kind, ends };
        // The bytes of a message end with their own checksum. A checksum over all of them would be the same for any
        // message.
        let bytes = plan.to_bytes();
        plan.id = crc32::hash(bytes.split_last_chunk::<{ message::CHECKSUM }>().map_or(&[], |b| b.0));
        Ok(plan)
    }

    /// Returns the options with which the scene is packed.
    #[must_use]
    pub fn options(&self) -> &PackOptions {
        &self.options
    }

    /// Returns the number that identifies the plan. Every message that is made by the plan holds it.
    pub(super) fn id(&self) -> u32 {
        self.id
    }

    /// Refuses messages of the type `kind` if one of `plan_ids` is of another plan, or if their number is not `expected`.
    pub(super) fn check(
        &self,
        kind: &'static str,
        plan_ids: impl IntoIterator<Item = u32>,
        expected: Option<usize>,
    ) -> Result<()> {
        let plan_ids: Vec<u32> = plan_ids.into_iter().collect();
        if plan_ids.iter().any(|&id| id != self.id) {
            return Err(Error::parameter(kind, "of another scene", "of this scene"));
        }
        match expected.filter(|&expected| expected != plan_ids.len()) {
            Some(expected) => Err(Error::parameter(kind, plan_ids.len(), format!("all {expected}"))),
            None => Ok(()),
        }
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        usize::try_from(self.firsts.last().copied().unwrap_or(0)).unwrap_or(usize::MAX)
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the number of tiles.
    #[must_use]
    pub fn tiles(&self) -> usize {
        self.firsts.len() - 1
    }

    /// Returns whether every tile becomes a file of its own. For a scene of one tile it makes no difference, and the result
    /// is false.
    #[must_use]
    pub fn is_one_each(&self) -> bool {
        self.ends.len() > 1
    }

    /// Returns the number of buckets.
    #[must_use]
    pub fn buckets(&self) -> usize {
        self.ends.iter().map(|ends| ends.len() + 1).sum()
    }

    /// Returns the numbers of the buckets of each file, in order.
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

    /// Returns the number of groups of buckets. Each group has a sample of its own.
    #[must_use]
    pub fn groups(&self) -> usize {
        self.buckets().min(GROUPS)
    }

    /// Returns the numbers of the buckets of a group. The buckets of all groups are evenly spread over the scene. Empty if
    /// there is no such group.
    #[must_use]
    pub fn group(&self, group: usize) -> Vec<usize> {
        let (groups, sampled, buckets) = (self.groups(), self.sampled(), self.buckets());
        let own = group * sampled / groups.max(1)..(group + 1) * sampled / groups.max(1);
        own.filter(|_| group < groups).map(|k| k * buckets / sampled).collect()
    }

    /// Returns the number of buckets that are sampled.
    pub(super) fn sampled(&self) -> usize {
        self.buckets().min(SAMPLED)
    }

    /// Returns the ranges of rows of the blocks of a tile of `gaussians` Gaussians.
    pub fn blocks(gaussians: usize) -> impl Iterator<Item = Range<usize>> {
        (0..gaussians).step_by(BLOCK).map(move |start| start..gaussians.min(start + BLOCK))
    }

    /// Returns, by the number of each bucket, the rows among `rows` of a tile that the bucket has to read. They are runs of
    /// whole pieces of `RUN` rows, and at least one row of each piece is of the bucket. Reports the bytes of the rows to
    /// `progress`.
    ///
    /// # Errors
    /// As [`Survey::of`], and [`Error::Parameter`] if there is no such tile or it is not as it was when it was
    /// surveyed.
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

    /// Returns the rows among `rows` of a tile that are of each bucket: the number of the bucket, and the bytes of a piece
    /// for [`BucketReader::add_piece`]. It is for tiles whose rows are spread over the scene, since every bucket would have
    /// to read all of such a tile.
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
                piece.keys.push(*key);
                piece.rows.extend_from_slice(row);
            }
            Ok(())
        })?;
        let of = |(bucket, piece)| (bucket, Piece { plan_id: self.id, bucket, ..piece }.to_bytes());
        Ok(pieces.into_iter().map(of).collect())
    }

    /// Calls `take` with successive parts of `rows` of a tile, and with the key of each Gaussian.
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

    /// Returns the buckets of the Gaussians of a tile.
    pub(crate) fn buckets_of(&self, tile: usize) -> Buckets<'_> {
        let list = if self.is_one_each() { tile } else { 0 };
        let before = self.ends.iter().take(list).map(|ends| ends.len() + 1).sum();
        Buckets { before, ends: self.ends.get(list).map_or(&[], Vec::as_slice) }
    }

    /// Returns the number of the first Gaussian of the file that has bucket `bucket`.
    pub(super) fn first_of_file(&self, bucket: usize) -> u64 {
        let files = self.files();
        let file = files.partition_point(|file| file.end <= bucket);
        if self.is_one_each() { self.firsts.get(file).copied().unwrap_or(0) } else { 0 }
    }

    /// Returns the number of Gaussians of the source of a file.
    pub(super) fn gaussians_of_file(&self, file: usize) -> u64 {
        match self.firsts.get(file..file + 2) {
            Some(&[first, end]) if self.is_one_each() => end - first,
            _ => self.firsts.last().copied().unwrap_or(0),
        }
    }

    /// Returns a scene without Gaussians that has all properties that the tiles have in common.
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

/// The ends of the buckets of one tile, or of all tiles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Buckets<'p> {
    /// Number of buckets of earlier tiles.
    before: usize,
    ends: &'p [MortonKey],
}

impl Buckets<'_> {
    /// Returns the number of the bucket that a Gaussian is of.
    pub(crate) fn of(&self, key: MortonKey) -> usize {
        self.before + self.ends.partition_point(|end| *end <= key)
    }
}

/// The rows of one bucket that are in one block of a tile.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Piece {
    pub(super) plan_id: u32,
    pub(super) bucket: usize,
    pub(super) keys: Vec<MortonKey>,
    pub(super) rows: Vec<u8>,
}

impl Piece {
    /// The name of the type in messages.
    const KIND: &'static str = "piece";

    fn to_bytes(&self) -> Vec<u8> {
        message::to_bytes(Self::KIND, self)
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self> {
        message::from_bytes(Self::KIND, bytes)
    }
}

/// Returns the number of rows of a tile of these blocks.
fn rows(blocks: &[Survey]) -> u64 {
    blocks.iter().map(|block| block.gaussians).fold(0, u64::saturating_add)
}

/// Returns the offset of the scene of `tiles`. Joining the same tiles gives the same offset.
fn shared_offset(tiles: &[(String, Vec<Survey>)]) -> Option<Offset> {
    let of = |blocks: &Vec<Survey>| Some((blocks.first()?.kind.meta.offset, rows(blocks)));
    let offsets: Vec<_> = tiles.iter().filter_map(|(_, blocks)| of(blocks)).collect();
    Offset::shared(&offsets)
}

pub(super) fn placed(grid: &Grid, position: Vec3, row: u64) -> MortonKey {
    // Scenes have at most 2^32 - 2 Gaussians.
    MortonKey { cell: grid.cell(position), source: u32::try_from(row).unwrap_or(u32::MAX) }
}
