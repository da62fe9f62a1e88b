//! The Gaussians of a bucket, in the order of the file.

use std::ops::Range;

use super::plan::{Piece, Plan, placed};
use crate::packed::curve::MortonKey;
use crate::packed::decode::reorder::{gather, gather_geometry};
use crate::scene::source::SplatSource;
use crate::scene::splats::Splats;
use crate::stream::RowLayout;
use crate::support::error::{Error, Result};
use crate::support::maths::Vec3;
use crate::support::parallel::map_vec;
use crate::support::progress::Progress;

/// The Gaussians of a bucket, sorted along the Morton curve.
#[derive(Debug, Clone)]
pub struct Bucket {
    pub(super) number: usize,
    pub(super) splats: Splats,
    /// The cell of each Gaussian, and its number in the source.
    pub(super) keys: Vec<MortonKey>,
}

/// A reader that collects the Gaussians of one bucket from blocks of tiles.
#[derive(Debug)]
pub struct BucketReader<'p> {
    plan: &'p Plan,
    bucket: Bucket,
}

impl<'p> BucketReader<'p> {
    /// Creates a reader for bucket `number`.
    #[must_use]
    pub fn new(plan: &'p Plan, number: usize) -> Self {
        Self { plan, bucket: Bucket { number, splats: plan.empty(), keys: Vec::new() } }
    }

    /// Adds the Gaussians of the bucket that are among `rows` of tile `number`. Rows may come in any order.
    ///
    /// # Errors
    /// As [`Plan::runs`].
    pub fn add(
        &mut self,
        number: usize,
        tile: &dyn SplatSource,
        rows: Range<usize>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let Bucket { number: wanted, splats, keys } = &mut self.bucket;
        let plan = self.plan;
        let buckets = plan.buckets_of(number);
        plan.each(number, tile, rows, progress, &mut |part, own_keys| {
            let keep: Vec<bool> = own_keys.iter().map(|key| buckets.of(*key) == *wanted).collect();
            keys.extend(own_keys.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(key, _)| *key));
            part.retain(&keep);
            let mut own = tile.empty();
            std::mem::swap(&mut own, part);
            splats.append(own);
            Ok(())
        })
    }

    /// Adds a piece that [`Plan::scatter`] made for the bucket.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `bytes` are not a piece of this bucket and this scene.
    pub fn add_piece(&mut self, bytes: &[u8]) -> Result<()> {
        self.add_read(Piece::from_bytes(bytes)?)
    }

    /// Adds a piece of the bucket.
    ///
    /// # Errors
    /// As [`Self::add_piece`].
    pub(super) fn add_read(&mut self, Piece { plan_id, bucket, keys, rows }: Piece) -> Result<()> {
        self.plan.check("piece", [plan_id], None)?;
        if bucket != self.bucket.number {
            return Err(Error::parameter(
                "piece",
                format!("of bucket {bucket}"),
                self.bucket.number.to_string(),
            ));
        }
        let layout = RowLayout::new(self.plan.empty());
        if rows.len() != keys.len() * layout.bytes() {
            let expected = format!("{} rows of {} bytes", keys.len(), layout.bytes());
            return Err(Error::parameter("piece", rows.len(), expected));
        }
        self.add_rows(&layout, &rows, keys);
        Ok(())
    }

    /// Adds rows that all are of the bucket. `keys` holds the key of each row.
    pub(crate) fn add_rows(&mut self, layout: &RowLayout, rows: &[u8], mut keys: Vec<MortonKey>) {
        self.bucket.splats.append(layout.unpack(rows));
        self.bucket.keys.append(&mut keys);
    }

    /// Returns the bucket, sorted along the Morton curve.
    #[must_use]
    pub fn finish(self) -> Bucket {
        let Bucket { number, mut splats, mut keys } = self.bucket;
        let mut order: Vec<usize> = (0..keys.len()).collect();
        order.sort_unstable_by_key(|&i| keys[i]);
        gather(&mut keys, order.iter().copied());
        gather_geometry(&mut splats.geometry, &order);
        let dim = splats.degree.rest();
        let mut rest = Vec::with_capacity(splats.sh_rest.len());
        order.iter().for_each(|&i| rest.extend_from_slice(&splats.sh_rest[i * dim..(i + 1) * dim]));
        splats.sh_rest = rest;
        Bucket { number, splats, keys }
    }
}

impl Bucket {
    /// Returns the cell of each Gaussian, and its number in the bucket.
    pub(super) fn keys(&self) -> Vec<MortonKey> {
        (0..).zip(&self.keys).map(|(source, key)| MortonKey { source, ..*key }).collect()
    }

    /// Returns a bucket of the same number with `splats` in the order of the file, and the index that each of them had before.
    /// `splats` are near the Gaussians of the bucket. One of them whose cell is before or after all cells of the bucket gets the
    /// cell of the nearest Gaussian of the bucket, because the cells of a file rise from bucket to bucket.
    pub(super) fn with(&self, plan: &Plan, splats: &Splats) -> (Self, Vec<u32>) {
        let cells = self.keys.first().map_or(0, |key| key.cell)..=self.keys.last().map_or(0, |key| key.cell);
        let key = |(i, &position)| {
            let key = placed(&plan.grid, position, i);
            let cell = if cells.contains(&key.cell) { key.cell } else { self.nearest_cell(position) };
            MortonKey { cell, ..key }
        };
        let mut keys: Vec<MortonKey> = map_vec((0..).zip(&splats.geometry.positions).collect(), key);
        keys.sort_unstable();
        let order: Vec<u32> = keys.iter().map(|key| key.source).collect();
        (0..).zip(&mut keys).for_each(|(i, key)| key.source = i);
        (Self { number: self.number, splats: splats.gathered(&order), keys }, order)
    }

    /// Returns the cell of the Gaussian nearest to `position`.
    fn nearest_cell(&self, position: Vec3) -> u64 {
        let squared = |own: &Vec3| (0..3).map(|k| (own[k] - position[k]).powi(2)).sum::<f32>();
        let distances = self.splats.geometry.positions.iter().map(squared).zip(&self.keys);
        distances.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, key)| key.cell)
    }

    /// Returns the number of the bucket among all buckets.
    #[must_use]
    pub fn number(&self) -> usize {
        self.number
    }

    /// Returns the Gaussians of the bucket.
    #[must_use]
    pub fn splats(&self) -> &Splats {
        &self.splats
    }
}
