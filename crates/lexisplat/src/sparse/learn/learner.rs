//! The rounds of learning. They run in stages of growing samples, until the score of the held-out vectors falls no more.

use super::sample::{Fetch, Sample};
use super::training::{self, Beyond, Training};
use super::{LearnOptions, LearnedAtoms, atom_replacement, update};
use crate::sparse::atoms::Atoms;
use crate::sparse::pursuit::{Coder, ValueType};
use crate::support::error::{Error, Result};
use crate::support::limits::MAX_ATOMS;
use crate::support::progress::{Progress, Stage};

/// Number of vectors for each atom in the first stage, which is the fastest. Each later stage but the last has [`GROWTH`]
/// times as many vectors as the stage before it.
const FIRST_STAGE_PER_ATOM: usize = 48;
/// Factor by which the sample grows between stages.
const GROWTH: usize = 4;
/// Largest number of rounds in the first stage, and in each later stage.
const STAGE_ROUNDS: [usize; 2] = [150, 20];
/// Number of rounds between evaluations on the held-out vectors.
const EVALUATE_EVERY: usize = 5;
/// Share by which an evaluation must lower the held-out score to count as progress.
const MIN_GAIN: f64 = 1e-3;
/// Number of rounds without momentum at the end of learning from rows that keep their nearest codes ([`Beyond::Nearest`]).
/// For such rows, momentum acts on all of a row's error. Atoms then swing about the best atoms instead of settling.
const SETTLING_ROUNDS: usize = 10;
/// Largest number of evaluations in a row without progress after which a stage still goes on.
const PATIENCE: u32 = 2;

/// Learns atoms of `dim` values from `vectors` vectors, which `fetch` reads by number. `dim` is from 1 to
/// [`MAX_DIM`](crate::MAX_DIM).
pub(super) fn learn(
    dim: usize,
    vectors: usize,
    fetch: &mut Fetch<'_>,
    options: &LearnOptions,
    beyond: Beyond,
    progress: &dyn Progress,
) -> Result<LearnedAtoms> {
    let atoms = options.atoms.unwrap_or((2 * dim).min(MAX_ATOMS));
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
    let first = Atoms::checked(dim, atom_replacement::first_atoms(dim, &sample.learn, atoms, options))?;
    let mut learner = Learner {
        options,
        beyond,
        sample: &sample,
        velocity: vec![0.0; first.as_slice().len()],
        best: (f64::INFINITY, first.clone()),
        atoms: first,
        rounds: 0,
    };
    learner.run(progress)?;
    let atoms = learner.canonical()?;
    let held_out_nonzeros = learner.mean_nonzeros(&atoms);
    Ok(LearnedAtoms { atoms, rounds: learner.rounds, sample: sample.learn.len() / dim, held_out_nonzeros })
}

/// The state of learning.
struct Learner<'a> {
    options: &'a LearnOptions,
    beyond: Beyond,
    sample: &'a Sample,
    atoms: Atoms,
    /// The movement of each atom in the last round.
    velocity: Vec<f32>,
    /// Lowest held-out score so far, and the atoms that have it.
    best: (f64, Atoms),
    rounds: usize,
}

impl Learner<'_> {
    fn run(&mut self, progress: &dyn Progress) -> Result<()> {
        let dim = self.atoms.dim();
        let vectors = self.sample.learn.len() / dim;
        let mut sizes = vec![(FIRST_STAGE_PER_ATOM * self.atoms.len()).min(vectors)];
        while let Some(&last) = sizes.last()
            && last < vectors
        {
            // The next stage takes all vectors, and is the last, if there are fewer than twice as many as it would
            // otherwise take.
            let next = last * GROWTH;
            sizes.push(if next * 2 > vectors { vectors } else { next });
        }
        let settling = if self.beyond == Beyond::Nearest { SETTLING_ROUNDS } else { 0 };
        let most = STAGE_ROUNDS[0] + STAGE_ROUNDS[1] * (sizes.len() - 1) + settling;
        progress.begin(Stage::Learn, most as u64);
        for (stage, size) in sizes.into_iter().enumerate() {
            let rows = &self.sample.learn[..size * dim];
            // Each stage measures progress anew, because a stage with more vectors may begin at a worse score.
            let mut reference = f64::INFINITY;
            let mut patience = PATIENCE;
            for round in 1..=STAGE_ROUNDS[stage.min(1)] {
                self.round(rows, self.options.momentum)?;
                progress.advance(1);
                progress.check()?;
                if round % EVALUATE_EVERY == 0 {
                    let score = self.evaluate();
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
        self.atoms = self.best.1.clone();
        for round in 1..=settling {
            self.round(&self.sample.learn, 0.0)?;
            progress.advance(1);
            progress.check()?;
            if round % EVALUATE_EVERY == 0 {
                self.evaluate();
            }
        }
        progress.end();
        Ok(())
    }

    /// Returns the score of the atoms. Keeps the atoms if their score is the lowest so far.
    fn evaluate(&mut self) -> f64 {
        let score = self.score(&self.atoms);
        if score < self.best.0 {
            self.best = (score, self.atoms.clone());
        }
        score
    }

    fn coder(&self, atoms: &Atoms) -> Coder {
        Coder::over(atoms, self.options.pursuit, self.options.stop.without_cap(), ValueType::F32)
    }

    fn round(&mut self, rows: &[f32], momentum: f32) -> Result<()> {
        let dim = self.atoms.dim();
        let mut training = Training::code(&self.coder(&self.atoms), rows, self.beyond);
        let mut atoms = update::refit(&self.atoms, &mut training);
        update::accelerate(&self.atoms, &mut atoms, &mut self.velocity, momentum);
        atom_replacement::replace_useless(&mut atoms, &mut self.velocity, &training, rows);
        self.atoms = Atoms::checked(dim, atoms)?;
        self.rounds += 1;
        Ok(())
    }

    /// Returns the quantity that learning minimises, for `atoms` on the validation vectors. With a tolerance, it is the
    /// mean nonzeros plus the cost of vectors beyond the tolerance. Otherwise it is the mean squared error.
    fn score(&self, atoms: &Atoms) -> f64 {
        let cost = training::cost(&self.coder(atoms), self.sample.validation(), self.beyond);
        match self.options.stop.tolerance() {
            Some(_) => cost.nonzeros + cost.beyond,
            None => cost.squared_error,
        }
    }

    fn mean_nonzeros(&self, atoms: &Atoms) -> f64 {
        training::cost(&self.coder(atoms), &self.sample.held_out, self.beyond).nonzeros
    }

    /// Returns the best atoms in an order and with signs that do not depend on the way in which the atoms were found.
    fn canonical(&self) -> Result<Atoms> {
        let best = &self.best.1;
        let training = Training::code(&self.coder(best), self.sample.validation(), self.beyond);
        let usage = training.usage(best.len());
        Atoms::checked(best.dim(), atom_replacement::canonical(best, &usage))
    }
}
