//! Sorting of Gaussians into the buckets of a packed file, through temporary files.

use std::path::Path;

use super::buckets::Buckets;
use super::rows::RowLayout;
use crate::packed::MortonKey;
use crate::packed::tiles::{Bucket, BucketReader, Plan, Survey};
use crate::scene::source::SplatSource;
use crate::support::error::Result;
use crate::support::progress::{Progress, Stage};

/// Number of bytes of a record before the values: the cell, and the number in the source.
const KEY_BYTES: usize = 12;

/// The Gaussians of a scene, by bucket.
pub(super) struct Ordered {
    rows: RowLayout,
    buckets: Buckets,
}

/// Surveys all tiles, block by block. Reports their rows to `progress`.
pub(super) fn survey(
    tiles: &[&dyn SplatSource],
    seed: u64,
    progress: &dyn Progress,
) -> Result<Vec<(String, Vec<Survey>)>> {
    let of = |(number, tile): (usize, &&dyn SplatSource)| {
        let blocks = Plan::blocks(tile.len()).map(|rows| Survey::of(*tile, rows, seed, progress));
        Ok((format!("tile {number}"), blocks.collect::<Result<_>>()?))
    };
    tiles.iter().enumerate().map(of).collect()
}

impl Ordered {
    /// Reads all tiles and fills the buckets. Reports their rows to `progress`.
    pub(super) fn new(
        plan: &Plan,
        tiles: &[&dyn SplatSource],
        folder: &Path,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let rows = RowLayout::new(plan.empty());
        let mut buckets = Buckets::new(folder, plan.buckets())?;
        let mut bytes = Vec::new();
        for (number, tile) in tiles.iter().enumerate() {
            let of_tile = plan.buckets_of(number);
            plan.each(number, *tile, 0..tile.len(), progress, &mut |splats, keys| {
                rows.pack(splats, &mut bytes);
                for (key, row) in keys.iter().zip(bytes.chunks_exact(rows.bytes())) {
                    let record = [&key.cell.to_le_bytes()[..], &key.source.to_le_bytes(), row];
                    buckets.push(of_tile.of(*key), &record)?;
                }
                Ok(())
            })?;
        }
        Ok(Self { rows, buckets })
    }

    /// Returns bucket `number`. With `last`, the bucket is removed; such calls must be in the order of buckets.
    pub(super) fn bucket(&mut self, plan: &Plan, number: usize, last: bool) -> Result<Bucket> {
        let records = if last { self.buckets.take(number)? } else { self.buckets.read(number)? };
        let width = KEY_BYTES + self.rows.bytes();
        let count = records.len() / width;
        let (mut rows, mut keys) = (Vec::with_capacity(count * self.rows.bytes()), Vec::with_capacity(count));
        for record in records.chunks_exact(width) {
            let (key, row) = record.split_at(KEY_BYTES);
            keys.push(MortonKey {
                cell: key.first_chunk().map_or(0, |c| u64::from_le_bytes(*c)),
                source: key[8..].first_chunk().map_or(0, |s| u32::from_le_bytes(*s)),
            });
            rows.extend_from_slice(row);
        }
        drop(records);
        let mut reader = BucketReader::new(plan, number);
        reader.add_rows(&self.rows, &rows, keys);
        drop(rows);
        Ok(reader.finish())
    }
}

/// Begins the stage of reading. Surveying `tiles` and filling buckets reads all of them twice.
pub(super) fn begin_reading(tiles: &[&dyn SplatSource], progress: &dyn Progress) {
    let bytes: u64 = tiles.iter().map(|tile| tile.len() as u64 * tile.row_bytes()).sum();
    progress.begin(Stage::Read, 2 * bytes);
}
