//! The coded sample: which vectors use which atom, and the residual of each vector.

use crate::sparse::pursuit::{Coder, Encoded, ROWS_PER_TASK};
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_chunks};

/// Treatment of a vector that no code brings within the tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Beyond {
    /// The vector is stored exactly. Atoms are not learned from it, and it costs as much as a code of full length.
    Exact,
    /// The vector keeps the code that comes nearest to it. Atoms are learned from this code.
    Nearest,
}

/// Codes and residuals of a set of vectors.
#[derive(Debug, Default)]
pub(super) struct Training {
    pub(super) dim: usize,
    /// Start of each vector's entries, followed by the end of the last vector's entries.
    pub(super) starts: Vec<usize>,
    /// Atom of each entry.
    pub(super) atoms: Vec<u16>,
    /// Value of each entry.
    pub(super) values: Vec<f32>,
    /// Residuals of all vectors, one after the other.
    pub(super) residuals: Vec<f32>,
}

/// One use of an atom.
#[derive(Debug, Clone, Copy)]
pub(super) struct Use {
    /// Number of the vector that uses the atom.
    pub(super) vector: usize,
    /// Index of the entry in [`Training::values`].
    pub(super) entry: usize,
}

impl Training {
    /// Codes all `vectors`. A vector that is stored exactly has no entries, and its residual is 0.
    pub(super) fn code(coder: &Coder, vectors: &[f32], beyond: Beyond) -> Self {
        let dim = coder.dim();
        let tasks = map_chunks(vectors.len() / dim, ROWS_PER_TASK, |range| {
            let mut task = Self { dim, ..Self::default() };
            coder.encode(&vectors[range.start * dim..range.end * dim], |visit| {
                let (code, _) = visit.nearest();
                if visit.outcome == Encoded::Escape && beyond == Beyond::Exact {
                    task.residuals.resize(task.residuals.len() + dim, 0.0);
                } else if code.is_empty() {
                    task.residuals.extend_from_slice(visit.signal);
                } else {
                    task.atoms.extend(code.iter().map(|&(atom, _)| atom));
                    task.values.extend(code.iter().map(|&(_, value)| value));
                    task.residuals
                        .extend(visit.signal.iter().zip(visit.reconstruction()).map(|(x, y)| x - y));
                }
                task.starts.push(task.atoms.len());
            });
            task
        });
        let mut all = Self { dim, starts: vec![0], ..Self::default() };
        for task in tasks {
            let offset = all.atoms.len();
            all.starts.extend(task.starts.iter().map(|end| offset + end));
            all.atoms.extend(task.atoms);
            all.values.extend(task.values);
            all.residuals.extend(task.residuals);
        }
        all
    }

    /// Returns the number of vectors.
    pub(super) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns the number of uses of each of `atoms` atoms.
    pub(super) fn usage(&self, atoms: usize) -> Vec<usize> {
        let mut usage = vec![0; atoms];
        self.atoms.iter().for_each(|&atom| usage[usize::from(atom)] += 1);
        usage
    }

    /// Returns the uses of each of `atoms` atoms, by ascending vector.
    pub(super) fn uses(&self, atoms: usize) -> Vec<Vec<Use>> {
        let mut uses = vec![Vec::new(); atoms];
        for vector in 0..self.len() {
            for entry in self.starts[vector]..self.starts[vector + 1] {
                uses[usize::from(self.atoms[entry])].push(Use { vector, entry });
            }
        }
        uses
    }
}

/// Mean cost of coding a vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cost {
    pub(super) nonzeros: f64,
    /// Additional cost of the vectors that stay beyond the tolerance, in the unit of `nonzeros`. It grows with the errors
    /// of these vectors.
    pub(super) beyond: f64,
    pub(super) squared_error: f64,
}

/// Returns the mean cost of coding `vectors`.
pub(super) fn cost(coder: &Coder, vectors: &[f32], beyond: Beyond) -> Cost {
    let dim = coder.dim();
    let count = vectors.len() / dim;
    let tasks = map_chunks(count, GAUSSIANS_PER_TASK, |range| {
        let (mut nonzeros, mut squared_error, mut left) = (0_usize, 0.0, 0.0);
        coder.encode(&vectors[range.start * dim..range.end * dim], |visit| match visit.outcome {
            Encoded::Code { error } => {
                nonzeros += visit.code.len();
                squared_error += error * error;
            }
            // The vector is stored exactly, which costs as much as a code with all atoms.
            Encoded::Escape if beyond == Beyond::Exact => nonzeros += dim,
            // An error as large as the tolerance adds the cost of a code of full length. Larger errors add more, in
            // proportion.
            Encoded::Escape => {
                let (code, error) = visit.nearest();
                nonzeros += code.len();
                squared_error += error * error;
                left += dim as f64 * coder.tolerance().map_or(0.0, |tolerance| error / tolerance);
            }
        });
        (nonzeros, squared_error, left)
    });
    let scale = 1.0 / count.max(1) as f64;
    Cost {
        nonzeros: tasks.iter().map(|p| p.0).sum::<usize>() as f64 * scale,
        squared_error: tasks.iter().map(|p| p.1).sum::<f64>() * scale,
        beyond: tasks.iter().map(|p| p.2).sum::<f64>() * scale,
    }
}
