//! Sorts Gaussians into the order of a packed file by way of temporary files.

use std::path::Path;

use super::buckets::Buckets;
use super::each_part;
use super::importance::Importance;
use super::rows::RowLayout;
use crate::packed::{Bounds, Grid, MortonKey, Part, check};
use crate::scene::sensitivity::{Sensitivity, heuristic_total};
use crate::scene::source::SplatSource;
use crate::scene::splats::Splats;
use crate::support::error::{Error, Result};
use crate::support::progress::{Progress, Stage};
use crate::support::rng::SplitMix64;
use crate::support::spill::{Spill, SpillTo, Spilled};

/// Numbers of Gaussians that are held or sampled. The file does not depend on `at_once`, and on `bucket` only
/// with [`Importance::Judge`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// Gaussians read together.
    pub(super) at_once: usize,
    /// Approximate number of Gaussians of a bucket.
    pub(super) bucket: usize,
    /// Gaussians whose cells decide where buckets end.
    pub(super) looked_at: usize,
    /// Approximate number of Gaussians that steps and predictors are fitted to.
    pub(super) sample: usize,
    /// Approximate number of Gaussians of a run of the sample. They are neighbours in the file.
    pub(super) run: usize,
}

/// Bytes of a record before the values: cell and index in the source.
const KEY_BYTES: usize = 12;
/// Mixed into the seed of the Gaussians whose cells are looked at.
const LOOK_STREAM: u64 = 0x6c_6f_6f_6b;

/// Takes a part of the scene.
type Take<'a, E> = dyn FnMut(Part<'_>) -> Result<(), E> + 'a;
/// Says which Gaussians of a part of the scene stay.
type Stays<'a> = dyn Fn(&Splats, &Sensitivity) -> Vec<bool> + 'a;

/// A scene distributed over buckets in the order of a packed file.
pub(super) struct Ordered {
    pub(super) grid: Grid,
    /// The [`heuristic_total`] of all Gaussians.
    pub(super) heuristic_total: f64,
    rows: RowLayout,
    buckets: Buckets,
    gaussians: usize,
    /// The ends of runs, and the number of runs of which one is part of the sample.
    runs: (Vec<MortonKey>, usize),
}

/// The sensitivity of all Gaussians.
pub(super) struct Judged {
    /// Some of the Gaussians, in order.
    pub(super) sample: Splats,
    /// The sensitivity of the sample.
    pub(super) sensitivity: Sensitivity,
    /// What is known of all of them.
    pub(super) rows: Rows,
}

/// What is known of all Gaussians, in order.
pub(super) struct Rows {
    /// Number of Gaussians that stay.
    pub(super) kept: usize,
    /// Whether no Gaussian is worth its bits. Then the first stays.
    none_stays: bool,
    /// Sensitivities to colour and opacity, as pairs of f32.
    weights: Spilled,
    /// One byte for each: 1 if it stays.
    stays: Spilled,
}

impl Ordered {
    /// Reads all of `source` twice: for the grid and the borders of buckets, and to fill the buckets.
    pub(super) fn new(
        source: &dyn SplatSource,
        sizes: Sizes,
        seed: u64,
        folder: &Path,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let n = source.len();
        progress.begin(Stage::Read, 2 * n as u64 * source.row_bytes());
        let mut splats = source.empty();
        let (mut bounds, mut total) = (None::<Bounds>, 0.0);
        let mut looked = Vec::with_capacity(sizes.looked_at.min(n));
        let mut look = stratified(n, sizes.looked_at, seed).peekable();
        each_part(source, sizes.at_once, &mut splats, progress, &mut |start, splats| {
            let geometry = &splats.geometry;
            let part = Bounds::of(&geometry.positions);
            bounds.get_or_insert(part).add(part);
            total = heuristic_total(total, geometry);
            while let Some(i) = look.next_if(|&i| i < start + splats.len()) {
                looked.push((geometry.positions[i - start], i));
            }
            Ok(())
        })?;
        let positions: Vec<[f32; 3]> = looked.iter().map(|l| l.0).collect();
        let bounds = bounds.unwrap_or_else(|| Bounds::of(&[]));
        let grid = Grid::fit_sample(&positions, bounds, n);
        let mut keys: Vec<MortonKey> = looked.iter().map(|&(p, i)| placed(&grid, p, i)).collect();
        drop((looked, positions));
        keys.sort_unstable();
        let ends = |parts: usize| -> Vec<MortonKey> {
            (1..parts).filter_map(|k| keys.get(k * keys.len() / parts)).copied().collect()
        };
        let (bucket_ends, run_ends) = (ends(n.div_ceil(sizes.bucket)), ends(n.div_ceil(sizes.run)));
        drop(keys);
        // Of so many runs one is part of the sample.
        let every = n.div_ceil(sizes.sample).max(1);

        let rows = RowLayout::new(source.empty());
        let mut buckets = Buckets::new(folder, bucket_ends.len() + 1)?;
        let mut bytes = Vec::new();
        each_part(source, sizes.at_once, &mut splats, progress, &mut |start, splats| {
            rows.pack(splats, &mut bytes);
            for (i, row) in bytes.chunks_exact(rows.bytes()).enumerate() {
                let key = placed(&grid, splats.geometry.positions[i], start + i);
                let record = [&key.cell.to_le_bytes()[..], &key.source.to_le_bytes(), row];
                buckets.push(bucket_ends.partition_point(|end| *end <= key), &record)?;
            }
            Ok(())
        })?;
        progress.end();
        Ok(Self { grid, heuristic_total: total, rows, buckets, gaussians: n, runs: (run_ends, every) })
    }

    /// Finds the sensitivity to all Gaussians, bucket by bucket, and which of them stay.
    pub(super) fn judge<E: From<Error>>(
        &mut self,
        importance: &mut Importance<'_, E>,
        stays: &Stays<'_>,
        folder: &Path,
        progress: &dyn Progress,
    ) -> Result<Judged, E> {
        let (mut sample, mut sensitivity) = (Vec::new(), Sensitivity::default());
        let mut weights = Spill::new(SpillTo::Folder(folder))?;
        let mut stay = Spill::new(SpillTo::Folder(folder))?;
        let mut kept = 0;
        progress.begin(Stage::Look, self.gaussians as u64);
        for bucket in 0..self.buckets.len() {
            progress.check()?;
            let (mut bytes, mut places) = (Vec::new(), Vec::new());
            in_order(&self.buckets.read(bucket)?, &self.rows, &mut bytes, &mut places);
            let splats = self.rows.unpack(&bytes);
            let mut found = importance.of(&splats, self.gaussians, self.heuristic_total)?;
            check(&splats, &found)?;
            weights.push(&found.appearances())?;
            let marks: Vec<u8> = stays(&splats, &found).into_iter().map(u8::from).collect();
            kept += marks.iter().filter(|&&mark| mark == 1).count();
            stay.push(&marks)?;
            let (ends, every) = &self.runs;
            let sampled = |key: &MortonKey| ends.partition_point(|end| end <= key).is_multiple_of(*every);
            let keep: Vec<bool> = places.iter().map(sampled).collect();
            for (row, _) in bytes.chunks_exact(self.rows.bytes()).zip(&keep).filter(|(_, keep)| **keep) {
                sample.extend_from_slice(row);
            }
            found.retain(&keep);
            sensitivity.append(found);
            progress.advance(splats.len() as u64);
        }
        progress.end();
        let sample = self.rows.unpack(&sample);
        let none_stays = kept == 0 && self.gaussians > 0;
        let kept = kept + usize::from(none_stays);
        let rows = Rows { kept, none_stays, weights: weights.finish()?, stays: stay.finish()? };
        Ok(Judged { sample, sensitivity, rows })
    }

    /// Hands all Gaussians to `take` in order. Each time but the last the number of those that stay is a multiple of
    /// `chunk`.
    pub(super) fn each<E: From<Error>>(
        mut self,
        mut rows: Rows,
        chunk: usize,
        take: &mut Take<'_, E>,
    ) -> Result<(), E> {
        let width = self.rows.bytes();
        let (mut bytes, mut places) = (Vec::new(), Vec::new());
        let (mut weights, mut stays) = (Vec::new(), Vec::new());
        let mut none_stays = rows.none_stays;
        let count = self.buckets.len();
        for bucket in 0..count {
            let before = places.len();
            in_order(&self.buckets.take(bucket)?, &self.rows, &mut bytes, &mut places);
            weights.append(&mut rows.weights.take::<[f32; 2]>(places.len() - before)?);
            stays.extend(rows.stays.take::<u8>(places.len() - before)?.into_iter().map(|mark| mark == 1));
            if let Some(first) = stays.first_mut().filter(|_| std::mem::take(&mut none_stays)) {
                *first = true;
            }
            let kept: Vec<usize> = (0..stays.len()).filter(|&i| stays[i]).collect();
            let whole = match kept.len() / chunk * chunk {
                _ if bucket + 1 == count => places.len(),
                0 => 0,
                whole => kept[whole - 1] + 1,
            };
            if whole > 0 {
                let splats = self.rows.unpack(&bytes[..whole * width]);
                let (weights, places, stays) = (&weights[..whole], &places[..whole], &stays[..whole]);
                take(Part { splats: &splats, weights, places, stays })?;
            }
            bytes.drain(..whole * width);
            weights.drain(..whole);
            places.drain(..whole);
            stays.drain(..whole);
        }
        Ok(())
    }
}

fn placed(grid: &Grid, position: [f32; 3], source: usize) -> MortonKey {
    // Scenes have at most 2^32 - 2 Gaussians.
    MortonKey { cell: grid.cell(position), source: u32::try_from(source).unwrap_or(u32::MAX) }
}

/// Appends the rows of `records` in order to `bytes`, and their places to `places`.
fn in_order(records: &[u8], rows: &RowLayout, bytes: &mut Vec<u8>, places: &mut Vec<MortonKey>) {
    let records: Vec<&[u8]> = records.chunks_exact(KEY_BYTES + rows.bytes()).collect();
    let key = |record: &[u8]| MortonKey {
        cell: record.first_chunk().map_or(0, |c| u64::from_le_bytes(*c)),
        source: record[8..].first_chunk().map_or(0, |s| u32::from_le_bytes(*s)),
    };
    let mut order: Vec<(MortonKey, &[u8])> = records.into_iter().map(|r| (key(r), r)).collect();
    order.sort_unstable_by_key(|o| o.0);
    bytes.reserve(order.len() * rows.bytes());
    for (place, record) in order {
        places.push(place);
        bytes.extend_from_slice(&record[KEY_BYTES..]);
    }
}

/// Divides the numbers below `n` into about `count` equal parts, and returns one random number of each,
/// ascending.
fn stratified(n: usize, count: usize, seed: u64) -> impl Iterator<Item = usize> {
    let stride = n.div_ceil(count).max(1);
    let mut random = SplitMix64::new(seed ^ LOOK_STREAM);
    (0..n).step_by(stride).map(move |start| start + random.below(stride.min(n - start)))
}
