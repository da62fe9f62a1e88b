//! The results of measuring a bucket: sensitivities of its Gaussians, and sums over them.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::bucket::{Bucket, BucketReader};
use super::message::messages;
use super::plan::{Piece, Plan};
use crate::packed::bitstream::PointsOfView;
use crate::packed::encode::fit::StepSums;
use crate::packed::encode::octaves::{Histogram, RoundedSensitivities};
use crate::packed::encode::pack::check;
use crate::packed::encode::quantised::Observation;
use crate::packed::encode::removal::{changes_without, is_worth_its_bits};
use crate::scene::sensitivity::{AppearanceSensitivity, Sensitivity};
use crate::stream::{Observed, RowLayout};
use crate::support::error::{Error, Result};

/// Sum of the squared sensitivities that views measure. A guess scales its sensitivities to a sum of 1, but the sum of
/// squares is smaller where several Gaussians share a pixel or none covers it. Without this factor, files came out 7 to 9
/// dB better than asked (leica-brush, fruit-drops, snowmiku-mcmc), which is 1.7 halvings of the step.
pub(crate) const SHOWN: f64 = 0.1;

/// The memory of a measured bucket. It holds the sensitivities of each Gaussian, rounded to eighths of an octave, and
/// whether the Gaussian stays. It also holds the factor from the observer's sensitivities to these, the observer's memo, and
/// the Gaussians that are packed instead of the bucket's.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Looked {
    plan_id: u32,
    bucket: usize,
    sensitivities: RoundedSensitivities,
    /// One bit for each Gaussian, the lowest first: whether it stays.
    stays: Vec<u8>,
    scale: f32,
    memo: Vec<u8>,
    /// The Gaussians that are packed instead of the bucket's.
    instead: Option<Piece>,
}

/// Sums over the Gaussians of a bucket.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct LookStatistics {
    pub(super) plan_id: u32,
    pub(super) bucket: usize,
    pub(super) gaussians: u64,
    /// Number of Gaussians that stay.
    pub(super) kept: u64,
    pub(super) sums: StepSums,
    /// Histogram of the sensitivities to the logarithm of the opacity, of the Gaussians that stay.
    pub(super) energies: Histogram,
}

messages!(Looked => "looked", LookStatistics => "look statistics");

impl Bucket {
    /// Sums up what was `observed` of the bucket's Gaussians. Without an observation, the sensitivity is guessed from each
    /// Gaussian alone.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] if the sensitivity has another length or values that are not finite, if the step
    /// factor is not a finite number above 0, or if other Gaussians are packed although the options keep all.
    pub fn look(&self, plan: &Plan, observed: Option<Observed>) -> Result<(LookStatistics, Looked)> {
        let (Observed { instead, mut sensitivity, memo, .. }, scale) = match observed {
            None => {
                let total = plan.guessed_total / SHOWN;
                (Sensitivity::guess_of_part(&self.splats.geometry, total).into(), 1.0)
            }
            Some(mut observed) => {
                observed.check(&self.splats, &plan.options)?;
                let share = self.splats.len() as f64 / plan.len().max(1) as f64;
                // All parts have one overall step. A part that asks for half of that step gets four times the
                // sensitivities instead.
                #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
                let scale = (share / observed.step_factor.powi(2)) as f32;
                observed.sensitivity.scale(scale);
                (observed, scale)
            }
        };
        let Some(splats) = instead else {
            check(&self.splats, &sensitivity)?;
            let (statistics, looked) = LookStatistics::of(self, &sensitivity, plan);
            return Ok((statistics, Looked { scale, memo, ..looked }));
        };
        check(&splats, &sensitivity)?;
        let (mut bucket, order) = self.with(plan, &splats);
        let mut places = vec![0; order.len()];
        (0..).zip(&order).for_each(|(place, &before)| places[before as usize] = place);
        sensitivity = sensitivity.scattered(&places);
        let (statistics, looked) = LookStatistics::of(&bucket, &sensitivity, plan);
        let mut rows = Vec::new();
        RowLayout::new(plan.empty()).pack(&mut bucket.splats, &mut rows);
        let instead = Piece { plan_id: plan.id(), bucket: self.number, keys: bucket.keys, rows };
        Ok((statistics, Looked { scale, memo, instead: Some(instead), ..looked }))
    }
}

impl LookStatistics {
    pub(super) fn of(bucket: &Bucket, found: &Sensitivity, plan: &Plan) -> (Self, Looked) {
        let splats = &bucket.splats;
        let changes = changes_without(&splats.geometry, found, plan.options.may_change());
        let stays: Vec<bool> = changes.into_iter().map(|c| is_worth_its_bits(c, plan.step)).collect();
        let looked = Looked::new(plan.id(), bucket.number, &found.appearances(), &stays);
        let mut out = Self {
            plan_id: plan.id(),
            bucket: bucket.number,
            gaussians: splats.len() as u64,
            kept: stays.iter().filter(|&&stays| stays).count() as u64,
            sums: StepSums::default(),
            energies: Histogram::default(),
        };
        let dc = PointsOfView::new(&plan.options.points_of_view).colours(splats);
        out.sums.add(&splats.geometry, &dc, found, &bucket.keys(), looked.sensitivities.iter());
        let kept = looked.sensitivities.iter().zip(&stays).filter(|(_, stays)| **stays);
        kept.for_each(|(own, _)| out.energies.add(own.opacity));
        (out, looked)
    }

    /// Adds the sums of the next bucket.
    pub(super) fn merge(&mut self, next: &Self) {
        self.gaussians += next.gaussians;
        self.kept += next.kept;
        self.sums.merge(&next.sums);
        self.energies.merge(&next.energies);
    }
}

impl Looked {
    fn new(plan_id: u32, bucket: usize, sensitivities: &[AppearanceSensitivity], stays: &[bool]) -> Self {
        let mut bits = vec![0; stays.len().div_ceil(8)];
        for (i, _) in stays.iter().enumerate().filter(|(_, stays)| **stays) {
            bits[i / 8] |= 1_u8 << (i % 8);
        }
        Self {
            plan_id,
            bucket,
            sensitivities: RoundedSensitivities::of(sensitivities),
            stays: bits,
            scale: 1.0,
            memo: Vec::new(),
            instead: None,
        }
    }

    /// Returns the source of the Gaussians of `bucket` that are packed, and their overall step.
    pub(super) fn observation<'r>(&'r self, plan: &Plan, bucket: &'r Bucket) -> Observation<'r> {
        Observation { part: &bucket.splats, step: plan.step, scale: self.scale, memo: &self.memo }
    }

    /// Returns the Gaussians that are packed: the Gaussians of `bucket`, or others instead.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the others are not of `bucket`.
    pub(super) fn packed<'b>(&self, plan: &Plan, bucket: &'b Bucket) -> Result<Cow<'b, Bucket>> {
        let Some(piece) = &self.instead else { return Ok(Cow::Borrowed(bucket)) };
        let mut reader = BucketReader::new(plan, bucket.number);
        reader.add_read(piece.clone())?;
        Ok(Cow::Owned(reader.finish()))
    }

    /// Returns the sensitivities of each Gaussian, and whether it stays. With `first_stays`, the first Gaussian stays in any
    /// case.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `self` is of another bucket than `bucket`.
    pub(super) fn of_each(
        &self,
        plan: &Plan,
        bucket: &Bucket,
        first_stays: bool,
    ) -> Result<(Vec<AppearanceSensitivity>, Vec<bool>)> {
        plan.check("looked", [self.plan_id], None)?;
        let count = bucket.splats.len();
        if self.bucket != bucket.number {
            let expected = format!("of bucket {}", bucket.number);
            return Err(Error::parameter("looked", format!("of bucket {}", self.bucket), expected));
        }
        if self.sensitivities.len() != count || self.stays.len() != count.div_ceil(8) {
            return Err(Error::parameter("looked", self.sensitivities.len(), format!("{count} Gaussians")));
        }
        let mut stays: Vec<bool> = (0..count).map(|i| self.stays[i / 8] >> (i % 8) & 1 == 1).collect();
        if let Some(first) = stays.first_mut() {
            *first |= first_stays;
        }
        Ok((self.sensitivities.iter().collect(), stays))
    }
}
