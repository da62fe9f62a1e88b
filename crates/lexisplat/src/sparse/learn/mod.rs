//! Learns a dictionary: codes a sample, refits the atoms to their users, and repeats.
//!
//! One round is a pursuit with the tolerance of the final coding, followed by approximate K-SVD (Rubinstein et al. 2008),
//! which refits each atom and the values of its users in turn. Each atom moves by its K-SVD step plus a share of its last
//! movement. With this momentum, learning takes fewer rounds than plain K-SVD and ends at 2 to 3 % fewer nonzeros
//! (docs/METHOD.md has the figures). The sample grows during learning, since early rounds need only the direction in which
//! the atoms move.

mod atom_replacement;
mod axes;
mod learner;
mod sample;
mod statistics;
#[cfg(test)]
mod tests;
mod training;
mod update;

use std::ops::RangeInclusive;

use crate::scene::sh::ShDegree;
use crate::sparse::atoms::{Atoms, check_dim, check_finite, count_rows};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Pursuit;
use crate::sparse::pursuit::{RowValue, StopRule};
use crate::support::builder::builder_methods;
use crate::support::error::{Error, Result};
use crate::support::progress::Progress;
pub(crate) use atom_replacement::{take_first, unit_axis};
pub(crate) use axes::{axes_of_moments, principal_axes};
pub(crate) use sample::Fetch;
pub use statistics::{ROWS_PER_BLOCK, Statistics};
use training::Beyond;
pub(crate) use update::ksvd_atom;

/// Default for the largest number of vectors that a dictionary is learned from. On bonsai-3dgs half as many
/// vectors give 0.8 % more nonzeros, and 20 % more vectors hardly fewer (docs/METHOD.md).
pub const DEFAULT_SAMPLE: usize = 65_536;
/// Default share of an atom's last movement that the next round keeps. Shares from 0.8 to 0.97 give the same nonzeros; a
/// share of 0 gives up to 3 % more (docs/METHOD.md).
pub const DEFAULT_MOMENTUM: f32 = 0.9;
/// Range of the largest absolute value of rows that are learned from without scaling. The squared norm of a row of
/// [`MAX_DIM`](crate::MAX_DIM) such values is within the range of a pursuit in f32.
const IN_RANGE: RangeInclusive<f64> = 1e-12..=1e13;

/// Options of learning a dictionary.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LearnOptions {
    /// Number of atoms, 1 to [`MAX_ATOMS`](crate::MAX_ATOMS); `None` for twice the dimension, but at most `MAX_ATOMS`.
    pub atoms: Option<usize>,
    /// Pursuit that codes the vectors, in learning and in the final coding.
    pub pursuit: Pursuit,
    /// Stopping rule of the final coding. With a tolerance, learning minimises mean nonzeros and ignores a cap on nonzeros.
    /// With only a cap on nonzeros, learning minimises the squared error.
    pub stop: StopRule,
    /// Seed of the sample and of the first atoms.
    pub seed: u64,
    /// Largest number of vectors to learn from.
    pub sample: usize,
    /// Share of an atom's last movement that the next round keeps, from 0 to below 1.
    pub momentum: f32,
}

impl LearnOptions {
    /// Returns the defaults for a stopping rule: OLS, seed 0, [`DEFAULT_SAMPLE`] vectors, twice as many atoms as
    /// dimensions.
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

/// Learned atoms for rows of any length, and a report of the learning.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct LearnedAtoms {
    /// The atoms, most used first, each with its largest entry positive.
    pub atoms: Atoms,
    /// Number of rounds.
    pub rounds: usize,
    /// Number of rows learned from.
    pub sample: usize,
    /// Mean nonzeros of the held-out rows; 0 if there were too few rows to hold any out.
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
    learn_from(degree, vectors, &mut in_memory(dim, signals), options, progress)
}

/// Learns as [`learn`] does, from `vectors` vectors that `fetch` reads by number.
pub(crate) fn learn_from(
    degree: ShDegree,
    vectors: usize,
    fetch: &mut Fetch<'_>,
    options: &LearnOptions,
    progress: &dyn Progress,
) -> Result<Learned> {
    let dim = degree.rest();
    if dim == 0 {
        return Ok(Learned { dictionary: Dictionary::empty(), rounds: 0, sample: 0, held_out_nonzeros: 0.0 });
    }
    let LearnedAtoms { atoms, rounds, sample, held_out_nonzeros } =
        learner::learn(dim, vectors, fetch, options, Beyond::Exact, progress)?;
    Ok(Learned { dictionary: Dictionary::of(degree, atoms)?, rounds, sample, held_out_nonzeros })
}

/// Learns atoms from `rows`, each of `dim` values, one after the other.
///
/// This is [`learn`] for rows of any length, with two differences. First, a row that no code brings within the tolerance is
/// not stored exactly but keeps the code that comes nearest ([`Visit::nearest`](crate::pursuit::Visit::nearest)). Atoms are
/// therefore learned from such rows too, and few atoms for long rows lower the errors of the rows. Second, learning ends
/// with some rounds without momentum.
///
/// Rows are learned from in f32. If they are too large or too small for f32, the rows and the tolerance are scaled, which
/// changes no atom. Rows that [`LearnOptions::sample`] leaves out are checked but not learned from. Without any rows, the
/// atoms are unit axes, then random directions.
///
/// `progress` is asked between rounds, but not while the first atoms are made. Making them takes half a minute for rows of 1024
/// values.
///
/// The result depends only on the arguments, not on threads or CPU.
///
/// # Errors
/// [`Error::Parameter`] if `dim` is not from 1 to [`MAX_DIM`](crate::MAX_DIM), if the number of atoms or the momentum is
/// out of range, or if `rows` are not a whole number of finite rows. [`Error::Cancelled`] if `progress` cancels.
pub fn learn_atoms<V: RowValue>(
    dim: usize,
    rows: &[V],
    options: &LearnOptions,
    progress: &dyn Progress,
) -> Result<LearnedAtoms> {
    check_dim(dim)?;
    let count = count_rows(dim, rows)?;
    check_finite(dim, rows, 0)?;
    let learn = |rows: &[f32], options: &LearnOptions| {
        learner::learn(dim, count, &mut in_memory(dim, rows), options, Beyond::Nearest, progress)
    };
    let largest = rows.iter().map(|x| x.wide().abs()).fold(0.0, f64::max);
    if largest == 0.0 || IN_RANGE.contains(&largest) {
        return learn(&V::narrow(rows), options);
    }
    let (_, exponent) = libm::frexp(largest);
    let scaled: Vec<f32> = rows.iter().map(|x| f32::nearest(libm::scalbn(x.wide(), -exponent))).collect();
    learn(&scaled, &LearnOptions { stop: options.stop.scaled(-exponent), ..options.clone() })
}

/// Returns a [`Fetch`] function that reads vectors of `rows`, each of `dim` values.
fn in_memory(dim: usize, rows: &[f32]) -> impl FnMut(&[usize], &mut Vec<f32>) -> Result<()> {
    move |numbers, out| {
        numbers.iter().for_each(|&i| out.extend_from_slice(&rows[i * dim..(i + 1) * dim]));
        Ok(())
    }
}
