//! Learns a dictionary: codes a sample, refits the atoms to their users, repeats.
//!
//! One round is a pursuit with the tolerance of the final coding, followed by approximate K-SVD (Rubinstein et al.
//! 2008), which refits each atom and the values of its users in turn. Each atom moves by its K-SVD step plus a share of
//! its last movement. With this momentum, fewer rounds than plain K-SVD needs end at 2 to 3 % fewer nonzeros
//! (docs/METHOD.md has the figures). The sample grows during learning, since early rounds need only the direction.

mod atom_replacement;
mod axes;
mod sample;
mod training;
mod update;

use crate::scene::sh::ShDegree;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::{Coder, StopRule, ValueType};
use crate::support::builder::builder_methods;
use crate::support::error::{Error, Result};
use crate::support::limits::MAX_ATOMS;
use crate::support::progress::{Progress, Stage};
pub(crate) use atom_replacement::{take_first, unit_axis};
pub(crate) use axes::principal_axes;
pub(crate) use sample::Fetch;
use sample::Sample;
use training::Training;
pub(crate) use update::ksvd_atom;

/// Most vectors that a dictionary is learned from. On the real models tried, half as many gave the same mean nonzeros
/// up to the differences between seeds (docs/METHOD.md).
pub const DEFAULT_SAMPLE: usize = 65_536;
/// Share of an atom's last movement that the next round keeps. Values from 0.8 to 0.97 give the same nonzeros; 0 gives
/// 3 to 18 % more.
pub const DEFAULT_MOMENTUM: f32 = 0.9;
/// Vectors for each atom in the first stage, which is the fastest. Each later stage has [`GROWTH`] times more.
const FIRST_STAGE_PER_ATOM: usize = 48;
/// Growth of the sample between stages.
const GROWTH: usize = 4;
/// Most rounds in the first stage, and in each later one.
const STAGE_ROUNDS: [usize; 2] = [150, 20];
/// Rounds between evaluations on the held-out vectors.
const EVALUATE_EVERY: usize = 5;
/// An evaluation counts as progress if it lowers the held-out score by this share.
const MIN_GAIN: f64 = 1e-3;
/// Evaluations in a row without progress after which a stage still goes on.
const PATIENCE: u32 = 2;

/// How to learn a dictionary.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LearnOptions {
    /// Number of atoms, 1 to [`MAX_ATOMS`]; `None` for twice the dimension.
    pub atoms: Option<usize>,
    /// The pursuit that will code.
    pub pursuit: Pursuit,
    /// When that pursuit will stop. With a tolerance, learning minimises mean nonzeros. With only a cap on nonzeros, it
    /// minimises the squared error.
    pub stop: StopRule,
    /// Seed of the sample and of the first atoms.
    pub seed: u64,
    /// Most vectors to learn from.
    pub sample: usize,
    /// Share of an atom's last movement that the next round keeps, from 0 to below 1.
    pub momentum: f32,
}

impl LearnOptions {
    /// The defaults for a stopping rule: OLS, seed 0, [`DEFAULT_SAMPLE`] vectors, twice as many atoms as dimensions.
    #[must_use]
    pub fn new(stop: StopRule) -> Self {
        Self {
            atoms: None,
            pursuit: Pursuit::Ols,
            stop,
            seed: 0,
            sample: DEFAULT_SAMPLE,
            momentum: DEFAULT_MOMENTUM,
        }
    }

    builder_methods!(
        with_atoms(atoms: Option<usize>),
        with_pursuit(pursuit: Pursuit),
        with_seed(seed: u64),
        with_sample(sample: usize),
        with_momentum(momentum: f32),
    );
}

/// A learned dictionary and a report of the learning.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Learned {
    /// The atoms, most used first, each with its largest entry positive.
    pub dictionary: Dictionary,
    /// Number of rounds.
    pub rounds: usize,
    /// Number of vectors learned from.
    pub sample: usize,
    /// Mean nonzeros of the held-out vectors; 0 if there were too few vectors to hold any out.
    pub held_out_nonzeros: f64,
}

/// Learns a dictionary from `signals`: SH-rest vectors of `degree`, one after the other.
///
/// The result depends only on the arguments, not on threads or CPU.
///
/// # Errors
/// [`Error::Parameter`] if the number of atoms or the momentum is out of range, or if `signals` are not a whole number
/// of finite vectors. [`Error::Cancelled`] if `progress` cancels.
pub fn learn(
    degree: ShDegree,
    signals: &[f32],
    options: &LearnOptions,
    progress: &dyn Progress,
) -> Result<Learned> {
    let dim = degree.rest();
    if dim > 0 && !signals.len().is_multiple_of(dim) {
        return Err(Error::parameter("signals", signals.len(), format!("a multiple of {dim} values")));
    }
    let vectors = signals.len().checked_div(dim).unwrap_or(0);
    let mut fetch = |numbers: &[usize], out: &mut Vec<f32>| {
        numbers.iter().for_each(|&i| out.extend_from_slice(&signals[i * dim..(i + 1) * dim]));
        Ok(())
    };
    learn_from(degree, vectors, &mut fetch, options, progress)
}

/// [`learn`] from `vectors` vectors, which `fetch` reads by number.
pub(crate) fn learn_from(
    degree: ShDegree,
    vectors: usize,
    fetch: &mut Fetch<'_>,
    options: &LearnOptions,
    progress: &dyn Progress,
) -> Result<Learned> {
    let dim = degree.rest();
    let atoms = options.atoms.unwrap_or(2 * dim);
    if dim == 0 {
        return Ok(Learned { dictionary: Dictionary::empty(), rounds: 0, sample: 0, held_out_nonzeros: 0.0 });
    }
    if atoms == 0 || atoms > MAX_ATOMS {
        return Err(Error::parameter("atoms", atoms, format!("1 to {MAX_ATOMS}")));
    }
    if !(0.0..1.0).contains(&options.momentum) {
        return Err(Error::parameter("momentum", options.momentum, "from 0 to below 1"));
    }
    let sample = Sample::draw(dim, vectors, fetch, options)?;
    if sample.learn.iter().chain(&sample.held_out).any(|v| !v.is_finite()) {
        return Err(Error::parameter("signals", "NaN or infinity", "finite values"));
    }
    let first = Dictionary::new(degree, atom_replacement::first_atoms(dim, &sample.learn, atoms, options))?;
    let mut learner = Learner {
        options,
        sample: &sample,
        velocity: vec![0.0; first.as_slice().len()],
        best: (f64::INFINITY, first.clone()),
        dictionary: first,
        rounds: 0,
    };
    learner.run(progress)?;
    let dictionary = learner.canonical()?;
    let held_out_nonzeros = learner.mean_nonzeros(&dictionary);
    Ok(Learned { dictionary, rounds: learner.rounds, sample: sample.learn.len() / dim, held_out_nonzeros })
}

/// The state of learning.
struct Learner<'a> {
    options: &'a LearnOptions,
    sample: &'a Sample,
    dictionary: Dictionary,
    /// The movement of each atom in the last round.
    velocity: Vec<f32>,
    /// Lowest held-out score so far, and its dictionary.
    best: (f64, Dictionary),
    rounds: usize,
}

impl Learner<'_> {
    fn run(&mut self, progress: &dyn Progress) -> Result<()> {
        let dim = self.dictionary.dim();
        let vectors = self.sample.learn.len() / dim;
        let mut sizes = vec![(FIRST_STAGE_PER_ATOM * self.dictionary.len()).min(vectors)];
        while let Some(&last) = sizes.last()
            && last < vectors
        {
            // The last stage takes all vectors if they are less than twice as many as the next stage would take.
            let next = last * GROWTH;
            sizes.push(if next * 2 > vectors { vectors } else { next });
        }
        let most = STAGE_ROUNDS[0] + STAGE_ROUNDS[1] * (sizes.len() - 1);
        progress.begin(Stage::Learn, most as u64);
        for (stage, size) in sizes.into_iter().enumerate() {
            let part = &self.sample.learn[..size * dim];
            // Progress is counted anew, because a stage with more vectors may begin at a worse score.
            let mut reference = f64::INFINITY;
            let mut patience = PATIENCE;
            for round in 1..=STAGE_ROUNDS[stage.min(1)] {
                self.round(part)?;
                progress.advance(1);
                progress.check()?;
                if round % EVALUATE_EVERY == 0 {
                    let score = self.score(&self.dictionary);
                    if score < self.best.0 {
                        self.best = (score, self.dictionary.clone());
                    }
                    if score <= reference * (1.0 - MIN_GAIN) {
                        reference = score;
                        patience = PATIENCE;
                    } else if patience == 0 {
                        break;
                    } else {
                        patience -= 1;
                    }
                }
            }
        }
        progress.end();
        Ok(())
    }

    fn coder(&self, dictionary: &Dictionary) -> Coder {
        Coder::new(dictionary, self.options.pursuit, self.options.stop.without_cap(), ValueType::F32)
    }

    fn round(&mut self, part: &[f32]) -> Result<()> {
        let dim = self.dictionary.dim();
        let mut training = Training::code(&self.coder(&self.dictionary), part, dim);
        let mut atoms = update::refit(&self.dictionary, &mut training);
        update::accelerate(&self.dictionary, &mut atoms, &mut self.velocity, self.options.momentum);
        atom_replacement::replace_useless(&mut atoms, &mut self.velocity, &training, part);
        self.dictionary = Dictionary::new(self.dictionary.degree(), atoms)?;
        self.rounds += 1;
        Ok(())
    }

    /// What learning minimises, on the validation vectors.
    fn score(&self, dictionary: &Dictionary) -> f64 {
        let cost = training::cost(&self.coder(dictionary), self.sample.validation(), dictionary.dim());
        if self.options.stop.tolerance().is_some() { cost.nonzeros } else { cost.squared_error }
    }

    fn mean_nonzeros(&self, dictionary: &Dictionary) -> f64 {
        training::cost(&self.coder(dictionary), &self.sample.held_out, dictionary.dim()).nonzeros
    }

    /// The best dictionary, in an order and with signs that do not depend on the way it was found.
    fn canonical(&self) -> Result<Dictionary> {
        let best = &self.best.1;
        let training = Training::code(&self.coder(best), self.sample.validation(), best.dim());
        let usage = training.usage(best.len());
        Dictionary::new(best.degree(), atom_replacement::canonical(best, &usage))
    }
}
