//! A sample of the Gaussians of a group of buckets, from which predictors and the dictionary are found.

use serde::{Deserialize, Serialize};

use super::bucket::Bucket;
use super::look::Looked;
use super::message::messages;
use super::plan::Plan;
use super::steps::Steps;
use crate::packed::bitstream::PointsOfView;
use crate::packed::curve::MortonKey;
use crate::packed::encode::coder::SAMPLE;
use crate::packed::encode::sample_sums::SampleSums;
use crate::scene::sensitivity::AppearanceSensitivity;
use crate::scene::splats::{Splats, filter};
use crate::support::error::{Error, Result};

/// Approximate number of Gaussians to which predictors are fitted.
const FITTED: usize = 1 << 19;
/// Number of Gaussians of a run of the sample. They follow one another in the file.
const RUN: usize = 2048;

/// A sample of the Gaussians of a group of buckets.
#[derive(Debug, Default)]
pub struct Sample {
    buckets: Vec<BucketSample>,
}

/// The sample of one bucket.
#[derive(Debug)]
struct BucketSample {
    number: usize,
    splats: Splats,
    /// The cell of each Gaussian, and its number in `splats`.
    keys: Vec<MortonKey>,
    sensitivities: Vec<AppearanceSensitivity>,
    stays: Vec<bool>,
}

/// Sums over the sample of a group, and the rows that a dictionary is learned from.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SampleStatistics {
    plan_id: u32,
    sums: SampleSums,
}

messages!(SampleStatistics => "sample statistics");

impl Sample {
    /// Creates an empty sample.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds Gaussians of the next bucket of the group.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `looked` is of another bucket.
    pub fn add(&mut self, plan: &Plan, bucket: &Bucket, looked: &Looked) -> Result<()> {
        let bucket = &*looked.packed(plan, bucket)?;
        let n = bucket.splats.len();
        let (sensitivities, stays) = looked.of_each(plan, bucket, false)?;
        // One of `every` runs is taken. In the next bucket it is the next run.
        let share = plan.sampled() as f64 / plan.buckets().max(1) as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
        let every = ((plan.len() as f64 * share / FITTED as f64).ceil() as usize).max(1);
        let is_taken = |i: usize| (i / RUN + bucket.number).is_multiple_of(every);
        let keep: Vec<bool> = (0..n).map(is_taken).collect();
        let mut splats = bucket.splats.clone();
        splats.geometry.extras = Vec::new();
        splats.retain(&keep);
        splats.shrink_to_fit();
        let taken = || (0..n).filter(|&i| keep[i]);
        let keys = (0..).zip(taken()).map(|(source, i)| MortonKey { source, ..bucket.keys[i] }).collect();
        self.buckets.push(BucketSample {
            number: bucket.number,
            splats,
            keys,
            sensitivities: taken().map(|i| sensitivities[i]).collect(),
            stays: taken().map(|i| stays[i]).collect(),
        });
        Ok(())
    }

    /// Sums up the sample.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `steps` are of another scene.
    pub fn statistics(&self, plan: &Plan, steps: &Steps) -> Result<SampleStatistics> {
        plan.check("steps", [steps.plan_id], None)?;
        let mut sums = SampleSums::default();
        let points_of_view = PointsOfView::new(&plan.options.points_of_view);
        let kept = |bucket: usize| steps.kept.get(bucket).copied().unwrap_or(0) as f64;
        let sampled = (0..plan.groups()).flat_map(|group| plan.group(group));
        let all_kept = sampled.map(kept).sum::<f64>().max(1.0);
        for BucketSample { number, splats, keys, sensitivities, stays } in &self.buckets {
            let dc = points_of_view.colours(splats);
            sums.add_values(&splats.geometry, &dc, keys, sensitivities, &steps.steps);
            let (mut keys, mut sensitivities) = (keys.clone(), sensitivities.clone());
            filter(&mut keys, stays);
            filter(&mut sensitivities, stays);
            // The number of rows of each bucket is proportional to the Gaussians of it that stay.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share")]
            let wanted = (SAMPLE as f64 * kept(*number) / all_kept).round() as usize;
            let seed = plan.options.seed ^ *number as u64;
            sums.add_kept(splats, &keys, &sensitivities, (&steps.steps, &steps.begun), (wanted, seed));
        }
        Ok(SampleStatistics { plan_id: plan.id(), sums })
    }
}

impl SampleStatistics {
    /// Returns the sums and the rows of all groups, which are in order.
    pub(super) fn sum(plan: &Plan, groups: &[Self]) -> Result<SampleSums> {
        plan.check("sample statistics", groups.iter().map(|group| group.plan_id), Some(plan.groups()))?;
        let mut sums = SampleSums::default();
        groups.iter().for_each(|group| sums.merge(&group.sums));
        match sums.is_of(plan.kind.degree.rest()) {
            true => Ok(sums),
            false => Err(Error::parameter("sample statistics", "rows of other lengths", "rows of the scene")),
        }
    }
}
