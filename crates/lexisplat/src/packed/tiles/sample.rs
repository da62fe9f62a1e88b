//! The Gaussians of a group of buckets that predictors and dictionary are found from. They stay where they are.

use serde::{Deserialize, Serialize};

use super::bucket::Bucket;
use super::look::Looked;
use super::message::messages;
use super::plan::Plan;
use super::steps::Steps;
use crate::packed::canonical::MortonKey;
use crate::packed::codebook;
use crate::packed::coder::{SAMPLE, SAMPLE_STREAM, View, atoms_to_learn};
use crate::packed::fit::Predictors;
use crate::packed::layered::MeanView;
use crate::packed::octaves::Histogram;
use crate::scene::splats::Splats;
use crate::support::error::{Error, Result};
use crate::support::rng::SplitMix64;

/// Approximate number of Gaussians that predictors are fitted to.
const FITTED: usize = 1 << 19;
/// Gaussians of a run of the sample. They are neighbours in the file.
const RUN: usize = 2048;

/// Some Gaussians of a group of buckets.
#[derive(Debug, Default)]
pub struct Sample {
    parts: Vec<Part>,
    /// Rows to learn from, in units of their value steps, and their colour classes, once they are made.
    rows: Option<(Vec<f32>, Vec<u8>)>,
}

/// Those of one bucket.
#[derive(Debug)]
struct Part {
    bucket: usize,
    splats: Splats,
    /// Cells, and numbers among the Gaussians.
    scene: Vec<MortonKey>,
    weights: Vec<[f32; 2]>,
    stays: Vec<bool>,
}

/// Sums over the sample of a group.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SampleStatistics {
    scene: u32,
    pub(super) predictors: Predictors,
    /// By how many classes shapes ask for smaller steps.
    pub(super) over: f32,
    /// The largest coordinate of each base colour.
    pub(super) dc: Histogram,
    /// Sums of the products of coordinates of rows: the lower half, row by row.
    moments: Vec<f64>,
    /// Some rows.
    rows: Vec<f32>,
}

/// What a group found out in a round of a [`Lesson`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Findings {
    scene: u32,
    pub(super) found: codebook::Findings,
}

/// A dictionary that is being learned.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Lesson {
    pub(super) scene: u32,
    pub(super) lesson: codebook::Lesson,
}

messages!(SampleStatistics => "sample statistics", Findings => "findings", Lesson => "lesson");

impl Sample {
    /// No Gaussians yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the next bucket of the group.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `looked` is of another bucket.
    pub fn add(&mut self, plan: &Plan, bucket: &Bucket, looked: &Looked) -> Result<()> {
        let n = bucket.splats.len();
        let (weights, stays) = looked.of_each(plan, bucket, false)?;
        // Of so many runs one is taken, in the next bucket the next.
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
        let scene = (0..).zip(taken()).map(|(source, i)| MortonKey { source, ..bucket.places[i] }).collect();
        self.parts.push(Part {
            bucket: bucket.number,
            splats,
            scene,
            weights: taken().map(|i| weights[i]).collect(),
            stays: taken().map(|i| stays[i]).collect(),
        });
        self.rows = None;
        Ok(())
    }

    /// Sums over the sample.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `steps` are of another scene.
    pub fn statistics(&mut self, plan: &Plan, steps: &Steps) -> Result<SampleStatistics> {
        plan.check("steps", [steps.scene], None)?;
        let dim = plan.like.degree.rest();
        let mut out = SampleStatistics::none(plan);
        let mean_view = MeanView::new(&plan.options.viewpoints);
        let parameters = &steps.floor.parameters;
        for part in &self.parts {
            let dc = mean_view.colours(&part.splats);
            let classes = steps.steps.classes_of(&part.weights);
            out.predictors.add(&part.splats.geometry, &dc, &part.scene, &classes, parameters);
            let kept: Vec<MortonKey> = part.kept().map(|i| part.scene[i]).collect();
            out.over = out.over.max(steps.floor.over(&part.splats.geometry, &kept));
            for dc in &dc {
                let largest = parameters.dc_coordinates(*dc).into_iter();
                out.dc.add(largest.fold(0.0_f32, |most, x| most.max(x.abs())));
            }
        }
        let (rows, _) = self.rows(plan, steps);
        if dim > 0 {
            for row in rows.chunks_exact(dim) {
                for i in 0..dim {
                    let sums = out.moments[i * (i + 1) / 2..].iter_mut().zip(&row[..=i]);
                    sums.for_each(|(sum, x)| *sum += f64::from(row[i]) * f64::from(*x));
                }
            }
            // Half of the first atoms are rows, the first ones of each group.
            let some = atoms_to_learn(steps.kept(), dim, &plan.options).div_ceil(plan.groups());
            out.rows = rows[..(some * dim).min(rows.len())].to_vec();
        }
        Ok(out)
    }

    /// What the sample says of the atoms of a round.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `steps` or `lesson` are of another scene.
    pub fn find(&mut self, plan: &Plan, steps: &Steps, lesson: &Lesson) -> Result<Findings> {
        plan.check("steps", [steps.scene], None)?;
        plan.check("lesson", [lesson.scene], None)?;
        let (rows, classes) = self.rows(plan, steps);
        Ok(Findings { scene: lesson.scene, found: lesson.lesson.find(rows, classes) })
    }

    /// The rows to learn from, and their colour classes.
    fn rows(&mut self, plan: &Plan, steps: &Steps) -> &(Vec<f32>, Vec<u8>) {
        let parts = &self.parts;
        self.rows.get_or_insert_with(|| {
            let kept = |bucket: usize| steps.kept.get(bucket).copied().unwrap_or(0) as f64;
            let sampled = (0..plan.groups()).flat_map(|group| plan.group(group));
            let all_kept = sampled.map(kept).sum::<f64>().max(1.0);
            let (mut rows, mut all_classes) = (Vec::new(), Vec::new());
            let parameters = steps.floor.parameters.for_learning();
            for part in parts {
                let scene: Vec<MortonKey> = part.kept().map(|i| part.scene[i]).collect();
                let weights: Vec<[f32; 2]> = part.kept().map(|i| part.weights[i]).collect();
                let free = steps.steps.classes_of(&weights);
                let classes = steps.floor.classes(&free, &part.splats.geometry, &scene);
                let view = View::new(&part.splats, &scene, &classes);
                let share = kept(part.bucket) / all_kept;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share")]
                let wanted = (SAMPLE as f64 * share).round() as usize;
                let seed = plan.options.seed ^ SAMPLE_STREAM ^ part.bucket as u64;
                let chosen = SplitMix64::new(seed).shuffled(scene.len()).take(wanted);
                let (mut own, mut classes) = view.scaled(chosen, &parameters);
                rows.append(&mut own);
                all_classes.append(&mut classes);
            }
            (rows, all_classes)
        })
    }
}

impl Part {
    fn kept(&self) -> impl Iterator<Item = usize> {
        (0..self.scene.len()).filter(|&i| self.stays[i])
    }
}

impl SampleStatistics {
    fn none(plan: &Plan) -> Self {
        let dim = plan.like.degree.rest();
        Self {
            scene: plan.scene(),
            predictors: Predictors::default(),
            over: 0.0,
            dc: Histogram::default(),
            moments: vec![0.0; dim * (dim + 1) / 2],
            rows: Vec::new(),
        }
    }

    /// The sums of all groups, in order.
    pub(super) fn sum(plan: &Plan, groups: &[Self]) -> Result<Self> {
        plan.check("sample statistics", groups.iter().map(|group| group.scene), Some(plan.groups()))?;
        let mut out = Self::none(plan);
        for group in groups {
            out.predictors.merge(&group.predictors);
            out.over = out.over.max(group.over);
            out.dc.merge(&group.dc);
            out.moments.iter_mut().zip(&group.moments).for_each(|(sum, more)| *sum += more);
            out.rows.extend_from_slice(&group.rows);
        }
        Ok(out)
    }
}

impl Lesson {
    /// Begins to learn a dictionary. `groups` are the statistics of all, in order. `None` if there is nothing to learn: the scene has
    /// no SH-rest.
    ///
    /// # Errors
    /// [`Error::Parameter`] if they are not those of all groups.
    pub fn new(plan: &Plan, steps: &Steps, groups: &[SampleStatistics]) -> Result<Option<Self>> {
        let dim = plan.like.degree.rest();
        let all = SampleStatistics::sum(plan, groups)?;
        if dim == 0 {
            return Ok(None);
        }
        let moment = |i: usize, j: usize| all.moments[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
        let moments = (0..dim).map(|i| (0..dim).map(|j| moment(i, j)).collect()).collect();
        let atoms = atoms_to_learn(steps.kept(), dim, &plan.options);
        let lesson = codebook::Lesson::new(atoms, moments, &all.rows, steps.stop);
        Ok(Some(Self { scene: plan.scene(), lesson }))
    }

    /// Moves the atoms by what all groups found, in order.
    ///
    /// # Errors
    /// [`Error::Parameter`] for findings of another scene or another dictionary.
    pub fn advance(&mut self, groups: &[Findings]) -> Result<()> {
        let groups = self.found(groups)?;
        self.lesson.advance(&groups);
        Ok(())
    }

    /// What all groups found on these atoms.
    pub(super) fn found(&self, groups: &[Findings]) -> Result<Vec<codebook::Findings>> {
        let own = |group: &&Findings| group.scene == self.scene && self.lesson.fits(&group.found);
        if groups.is_empty() || !groups.iter().all(|group| own(&group)) {
            return Err(Error::parameter("findings", groups.len(), "those of all groups on these atoms"));
        }
        Ok(groups.iter().map(|group| group.found.clone()).collect())
    }

    /// Whether the atoms are as good as they get. [`Coding::new`](super::Coding::new) needs the findings on these.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.lesson.is_over()
    }

    /// Number of rounds to come.
    #[must_use]
    pub fn left(&self) -> usize {
        self.lesson.left()
    }
}
