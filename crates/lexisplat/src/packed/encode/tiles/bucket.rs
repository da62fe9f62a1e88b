//! The Gaussians of a bucket, in the order of the file.

use std::ops::Range;

use super::plan::{Piece, Plan};
use crate::packed::curve::MortonKey;
use crate::packed::decode::reorder::{gather, gather_geometry};
use crate::scene::source::SplatSource;
use crate::scene::splats::Splats;
use crate::stream::RowLayout;
use crate::support::error::{Error, Result};
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
        let Piece { plan_id, bucket, keys, rows } = Piece::from_bytes(bytes)?;
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
