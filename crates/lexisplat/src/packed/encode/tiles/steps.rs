//! The steps of a scene, from the statistics of all of its buckets.

use serde::{Deserialize, Serialize};

use super::look::LookStatistics;
use super::message::messages;
use super::plan::Plan;
use crate::packed::encode::fit;
use crate::packed::encode::settled::Begun;
use crate::support::error::{Error, Result};

/// The steps of a scene, without predictors and without the dictionary.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Steps {
    pub(super) plan_id: u32,
    pub(super) steps: fit::Steps,
    pub(super) begun: Begun,
    /// Number of Gaussians of each bucket that stay.
    pub(super) kept: Vec<u64>,
    /// Numbers of the buckets whose first Gaussian stays although it is not worth its bits. If no Gaussian of a file would
    /// stay, its first bucket with Gaussians is one of them.
    first_stays: Vec<usize>,
}
messages!(Steps => "steps");

impl Steps {
    /// Computes the steps of a scene. `buckets` holds the statistics of all buckets, in order.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `buckets` are not the statistics of all buckets, in order.
    pub fn new(plan: &Plan, buckets: &[LookStatistics]) -> Result<Self> {
        plan.check("look statistics", buckets.iter().map(|bucket| bucket.plan_id), Some(plan.buckets()))?;
        let in_order = buckets.iter().enumerate().all(|(number, bucket)| bucket.bucket == number);
        let Some((first, rest)) = buckets.split_first().filter(|_| in_order) else {
            return Err(Error::parameter("look statistics", "in another order", "in the order of buckets"));
        };
        let mut all = first.clone();
        rest.iter().for_each(|next| all.merge(next));
        let mut kept: Vec<u64> = buckets.iter().map(|bucket| bucket.kept).collect();
        let mut first_stays = Vec::new();
        for file in plan.files() {
            let some = file.clone().find(|&bucket| buckets[bucket].gaussians > 0);
            if let Some(bucket) = some.filter(|_| kept[file].iter().sum::<u64>() == 0) {
                first_stays.push(bucket);
                kept[bucket] = 1;
            }
        }
        let steps = fit::Steps::new(&plan.grid, &all.sums);
        let of_file = kept.iter().sum::<u64>() / plan.files().len().max(1) as u64;
        let of_file = usize::try_from(of_file).unwrap_or(usize::MAX);
        let begun = Begun::new(&steps, (plan.step, true), &plan.options, of_file, all.energies.iter());
        Ok(Self { plan_id: plan.id(), steps, begun, kept, first_stays })
    }

    /// Returns the number of Gaussians of the scene that stay.
    #[must_use]
    pub fn kept(&self) -> usize {
        usize::try_from(self.kept.iter().sum::<u64>()).unwrap_or(usize::MAX)
    }

    /// Returns whether the first Gaussian of a bucket stays in any case.
    pub(super) fn first_stays(&self, bucket: usize) -> bool {
        self.first_stays.contains(&bucket)
    }
}
