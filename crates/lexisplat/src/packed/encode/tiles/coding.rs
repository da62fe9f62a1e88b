//! Coding of buckets, each on its own.

use serde::{Deserialize, Serialize};

use super::bucket::Bucket;
use super::look::Looked;
use super::message::messages;
use super::plan::Plan;
use super::sample::SampleStatistics;
use super::steps::Steps;
use crate::packed::curve::MortonKey;
use crate::packed::encode::encoding::{self, Encoding, Written};
use crate::packed::encode::quantised::Refit;
use crate::packed::encode::settled::Settled;
use crate::packed::entropy::tables;
use crate::packed::entropy::tables::Lookup;
use crate::scene::extra::Extra;
use crate::scene::splats::filter;
use crate::support::error::{Error, Result};
use crate::support::parallel::map_vec;
use crate::support::progress::Progress;
use crate::support::stopwatch::Stopwatch;

/// The parameters, the dictionary and the costs with which all buckets are coded.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Coding {
    plan_id: u32,
    pub(super) steps: Steps,
    settled: Settled,
}

/// The coded Gaussians of a bucket.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Coded {
    plan_id: u32,
    pub(super) bucket: usize,
    /// The bytes of the tables with which the chunks are coded: the bucket's own, or those of all buckets.
    tables: Vec<u8>,
    chunks: Vec<Written>,
    pub(super) layers: Vec<CodedLayer>,
}

/// The parts of a layer that are not in its chunks.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct CodedLayer {
    pub(super) gaussians: usize,
    /// The index of each Gaussian in the source of its file, if the order is kept.
    pub(super) order: Option<Vec<u32>>,
    pub(super) extras: Vec<Extra>,
}

/// Counts of how often each symbol occurs in a bucket.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Counts {
    plan_id: u32,
    pub(super) counts: encoding::Counts,
}

/// The tables with which all buckets are coded.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Tables {
    plan_id: u32,
    pub(super) bytes: Vec<u8>,
}

messages!(Coding => "coding", Coded => "coded bucket", Counts => "counts", Tables => "tables");

impl Coding {
    /// Learns the dictionary, and settles everything else with which buckets are coded. `groups` holds the statistics of
    /// all groups, in order. Reports the learning to `progress`.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `groups` are not those of all groups, or if values are so large that sums of them leave f32;
    /// [`Error::Cancelled`].
    pub fn new(
        plan: &Plan,
        steps: &Steps,
        groups: &[SampleStatistics],
        progress: &dyn Progress,
    ) -> Result<Self> {
        plan.check("steps", [steps.plan_id], None)?;
        let all = SampleStatistics::sum(plan, groups)?;
        let of = (plan.kind.degree, steps.kept());
        let settled = Settled::new(steps.begun.clone(), &all, of, &plan.options, progress)?;
        Ok(Self { plan_id: plan.id(), steps: steps.clone(), settled })
    }

    /// Returns the number of Gaussians that are coded.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.steps.kept()
    }

    /// Returns an encoder that has coded nothing.
    pub(super) fn encoding(&self, plan: &Plan) -> Result<Encoding> {
        plan.check("coding", [self.plan_id], None)?;
        self.settled.encoding(&plan.options, Stopwatch::start())
    }

    /// Codes the Gaussians of `bucket` that stay, with the bucket's own tables. `refit` fits them to pictures, if their base
    /// colours and opacities may change. Advances `progress` by the number of Gaussians.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `looked` is of another bucket, or if a file cannot hold a value; errors of `refit`;
    /// [`Error::Cancelled`].
    pub fn code<E: From<Error>>(
        &self,
        plan: &Plan,
        bucket: &Bucket,
        looked: &Looked,
        refit: Option<&mut Refit<'_, E>>,
        progress: &dyn Progress,
    ) -> Result<(Counts, Coded), E> {
        let observation = looked.observation(plan, bucket);
        let bucket = &*looked.packed(plan, bucket)?;
        let splats = &bucket.splats;
        let (mut sensitivities, stays) =
            looked.of_each(plan, bucket, self.steps.first_stays(bucket.number))?;
        let mut keys = bucket.keys();
        filter(&mut keys, &stays);
        filter(&mut sensitivities, &stays);
        plan.check("coding", [self.plan_id], None)?;
        let (gaussians, options, clock) = ((keys, sensitivities), &plan.options, Stopwatch::start());
        let mut quantised =
            self.settled.quantise(splats, gaussians, &self.steps.steps, options, clock, progress)?;
        let appearances = quantised.refitted(refit, &observation, progress)?;
        let (counts, chunks) = quantised.counted(appearances.as_deref(), progress)?;
        let tables = tables::Tables::of(&counts)?;
        let chunks = map_vec(chunks, |(layer, chunk)| Written::new(layer, &chunk, &tables));
        let first = plan.first_of_file(bucket.number);
        let mut start = 0;
        let mut layers = Vec::new();
        for gaussians in quantised.layer_counts() {
            let own = start..start + gaussians;
            start = own.end;
            let source = |g: &MortonKey| {
                let source = u64::from(bucket.keys[g.index()].source).saturating_sub(first);
                u32::try_from(source).unwrap_or(u32::MAX)
            };
            let order =
                options.keep_order.then(|| quantised.sources()[own.clone()].iter().map(source).collect());
            layers.push(CodedLayer { gaussians, order, extras: quantised.extras(own) });
        }
        let coded =
            Coded { plan_id: self.plan_id, bucket: bucket.number, tables: tables.write(), chunks, layers };
        Ok((Counts { plan_id: self.plan_id, counts }, coded))
    }
}

impl Tables {
    /// Makes the tables for all buckets. `counts` holds the counts of all buckets, in order.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are no counts, if they are of several scenes, or if there are more symbols than a file
    /// holds.
    pub fn new(counts: &[Counts]) -> Result<Self> {
        let wrong = || Error::parameter("counts", counts.len(), "those of all buckets of a scene");
        let all = Counts::sum(counts).ok_or_else(wrong)?;
        Ok(Self { plan_id: all.plan_id, bytes: tables::Tables::of(&all.counts)?.write() })
    }

    pub(super) fn read(&self, plan: &Plan) -> Result<tables::Tables> {
        plan.check("tables", [self.plan_id], None)?;
        tables::Tables::read(&self.bytes).map_err(|rule| Error::parameter("tables", rule, "tables"))
    }
}

impl Counts {
    /// Returns the sum of all counts. `None` if there are none, or if they are of several scenes.
    pub(super) fn sum(all: &[Self]) -> Option<Self> {
        let (first, rest) = all.split_first()?;
        let mut sum = first.clone();
        rest.iter().for_each(|more| sum.counts.add(&more.counts));
        rest.iter().all(|more| more.plan_id == sum.plan_id).then_some(sum)
    }
}

impl Coded {
    /// Recodes the bucket with the tables of all buckets.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the bucket is of another scene or another coding.
    pub fn with_tables(self, plan: &Plan, coding: &Coding, tables: &Tables) -> Result<Self> {
        plan.check("coded bucket", [self.plan_id], None)?;
        let wrong =
            || Error::parameter("coded bucket", self.bucket, "a bucket whose symbols the tables have");
        let own = tables::Tables::read(&self.tables).map_err(|_| wrong())?;
        let (lookup, common) = (Lookup::new(&own), tables.read(plan)?);
        let encoding = coding.encoding(plan)?;
        let forms = encoding.layering.forms(encoding.head.rest.least.len());
        let recoded = map_vec(self.chunks.iter().collect(), |chunk: &Written| {
            let form = forms.get(chunk.layer).copied().unwrap_or_default();
            chunk.recoded(&encoding.form, form, &lookup, &common)
        });
        let chunks = recoded.into_iter().collect::<Option<Vec<Written>>>().ok_or_else(wrong)?;
        Ok(Self { tables: tables.bytes.clone(), chunks, ..self })
    }

    /// Flips a bit of one byte of the ranges; `at` selects the byte and the bit.
    #[cfg(test)]
    pub(super) fn damage(&mut self, at: usize) {
        let ranges = self.chunks.iter_mut().flat_map(|chunk| &mut chunk.ranges);
        let mut bytes: Vec<&mut u8> = ranges.flat_map(|range| &mut range.bytes).collect();
        let count = bytes.len();
        *bytes[at % count] ^= 1 << (at % 8);
    }

    /// Returns the chunks and the layers, if they are coded with `tables` and belong together.
    pub(super) fn into_chunks(
        self,
        plan: &Plan,
        tables: &Tables,
        layers: usize,
    ) -> Result<(Vec<Written>, Vec<CodedLayer>)> {
        plan.check("coded bucket", [self.plan_id], None)?;
        if self.tables != tables.bytes {
            return Err(Error::parameter("coded bucket", self.bucket, "one with the tables of the file"));
        }
        let gaussians = |layer: usize| -> usize {
            self.chunks.iter().filter(|chunk| chunk.layer == layer).map(|chunk| chunk.gaussians).sum()
        };
        let belongs = |(number, layer): (usize, &CodedLayer)| {
            layer.gaussians == gaussians(number)
                && layer.order.as_ref().map(Vec::len) == plan.options.keep_order.then_some(layer.gaussians)
                && layer.extras.len() == plan.kind.extras.len()
        };
        if self.layers.len() != layers || !self.layers.iter().enumerate().all(belongs) {
            return Err(Error::parameter("coded bucket", self.bucket, "layers that hold its chunks"));
        }
        Ok((self.chunks, self.layers))
    }

    /// Returns the number of the bucket.
    #[must_use]
    pub fn bucket(&self) -> usize {
        self.bucket
    }
}
