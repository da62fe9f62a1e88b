//! A sample of the Gaussians of a group of buckets, from which predictors and the dictionary are found.

use half::f16;
use serde::{Deserialize, Serialize};

use super::bucket::Bucket;
use super::look::Looked;
use super::message::messages;
use super::plan::Plan;
use super::steps::Steps;
use crate::packed::bitstream::PointsOfView;
use crate::packed::curve::MortonKey;
use crate::packed::encode::coder::{OrderedGaussians, SAMPLE, SAMPLE_STREAM};
use crate::packed::encode::fit::Predictors;
use crate::packed::encode::octaves::Histogram;
use crate::scene::sensitivity::AppearanceSensitivity;
use crate::scene::splats::Splats;
use crate::support::error::{Error, Result};
use crate::support::rng::SplitMix64;

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
    pub(super) predictors: Predictors,
    /// Most octaves by which the shape of a Gaussian asks for smaller steps than those of class 0.
    pub(super) over: f32,
    /// Histogram of the largest coordinate of each base colour.
    pub(super) dc: Histogram,
    /// Rows in units of their value steps, as bytes of 16-bit floats. They differ from the exact rows by far less than a
    /// step.
    rows: Vec<u8>,
    /// The colour class of each row.
    classes: Vec<u8>,
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
        let mut out = SampleStatistics::none(plan);
        let points_of_view = PointsOfView::new(&plan.options.points_of_view);
        let parameters = &steps.floor.parameters;
        for bucket in &self.buckets {
            let dc = points_of_view.colours(&bucket.splats);
            let classes = steps.steps.classes_of(&bucket.sensitivities);
            out.predictors.add(&bucket.splats.geometry, &dc, &bucket.keys, &classes, parameters);
            let kept: Vec<MortonKey> = bucket.kept().map(|i| bucket.keys[i]).collect();
            out.over = out.over.max(steps.floor.over(&bucket.splats.geometry, &kept));
            for dc in &dc {
                let largest = parameters.dc_coordinates(*dc).into_iter();
                out.dc.add(largest.fold(0.0_f32, |most, x| most.max(x.abs())));
            }
        }
        self.add_rows(&mut out, plan, steps);
        Ok(out)
    }

    /// Adds rows to learn the dictionary from. The number of rows of each bucket is proportional to the Gaussians of it
    /// that stay.
    fn add_rows(&self, out: &mut SampleStatistics, plan: &Plan, steps: &Steps) {
        let kept = |bucket: usize| steps.kept.get(bucket).copied().unwrap_or(0) as f64;
        let sampled = (0..plan.groups()).flat_map(|group| plan.group(group));
        let all_kept = sampled.map(kept).sum::<f64>().max(1.0);
        let parameters = steps.floor.parameters.for_learning();
        for bucket in &self.buckets {
            let keys: Vec<MortonKey> = bucket.kept().map(|i| bucket.keys[i]).collect();
            let sensitivities: Vec<_> = bucket.kept().map(|i| bucket.sensitivities[i]).collect();
            let free = steps.steps.classes_of(&sensitivities);
            let classes = steps.floor.classes(&free, &bucket.splats.geometry, &keys);
            let ordered = OrderedGaussians::new(&bucket.splats, &keys, &classes);
            let share = kept(bucket.number) / all_kept;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share")]
            let wanted = (SAMPLE as f64 * share).round() as usize;
            let seed = plan.options.seed ^ SAMPLE_STREAM ^ bucket.number as u64;
            let chosen = SplitMix64::new(seed).shuffled(keys.len()).take(wanted);
            let (rows, mut classes) = ordered.scaled(chosen, &parameters);
            out.rows.extend(rows.into_iter().flat_map(half_bytes));
            out.classes.append(&mut classes);
        }
    }
}

/// Returns the bytes of the finite 16-bit float nearest to `x`.
fn half_bytes(x: f32) -> [u8; 2] {
    let most = f16::MAX.to_f32();
    f16::from_f32(x.clamp(-most, most)).to_le_bytes()
}

impl BucketSample {
    fn kept(&self) -> impl Iterator<Item = usize> {
        (0..self.keys.len()).filter(|&i| self.stays[i])
    }
}

impl SampleStatistics {
    fn none(plan: &Plan) -> Self {
        Self {
            plan_id: plan.id(),
            predictors: Predictors::default(),
            over: 0.0,
            dc: Histogram::default(),
            rows: Vec::new(),
            classes: Vec::new(),
        }
    }

    /// Returns the sums and the rows of all groups, which are in order.
    pub(super) fn sum(plan: &Plan, groups: &[Self]) -> Result<Self> {
        plan.check("sample statistics", groups.iter().map(|group| group.plan_id), Some(plan.groups()))?;
        let mut out = Self::none(plan);
        for group in groups {
            out.predictors.merge(&group.predictors);
            out.over = out.over.max(group.over);
            out.dc.merge(&group.dc);
            out.rows.extend_from_slice(&group.rows);
            out.classes.extend_from_slice(&group.classes);
        }
        let expected = out.classes.len() * plan.kind.degree.rest() * size_of::<f16>();
        if out.rows.len() != expected {
            return Err(Error::parameter(
                "sample statistics",
                out.rows.len(),
                format!("{expected} bytes of rows"),
            ));
        }
        Ok(out)
    }

    /// Returns the rows in random order, and their classes in the same order.
    pub(super) fn shuffled(&self, plan: &Plan) -> (Vec<f32>, Vec<u8>) {
        let bytes = plan.kind.degree.rest() * size_of::<f16>();
        let (mut rows, mut classes) = (Vec::new(), Vec::new());
        for i in SplitMix64::new(plan.options.seed ^ SAMPLE_STREAM).shuffled(self.classes.len()) {
            let row = self.rows[i * bytes..(i + 1) * bytes].chunks_exact(size_of::<f16>());
            rows.extend(row.map(|x| f16::from_le_bytes([x[0], x[1]]).to_f32()));
            classes.push(self.classes[i]);
        }
        (rows, classes)
    }
}
