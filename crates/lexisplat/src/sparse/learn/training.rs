//! The coded sample: which vectors use which atom, and the residual of each vector.

use crate::sparse::pursuit::{Coder, Encoded};
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_chunks};

/// Codes and residuals of a set of vectors.
#[derive(Debug, Default)]
pub(super) struct Training {
    pub(super) dim: usize,
    /// Start of each vector's entries, followed by the end of the last vector's.
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
    /// The vector.
    pub(super) vector: usize,
    /// The entry in [`Training::values`].
    pub(super) entry: usize,
}

impl Training {
    /// Codes all `vectors`. A vector that cannot be coded has no entries, and its residual is 0.
    pub(super) fn code(coder: &Coder, vectors: &[f32], dim: usize) -> Self {
        let parts = map_chunks(vectors.len() / dim, GAUSSIANS_PER_TASK, |range| {
            let mut part = Self { dim, ..Self::default() };
            coder.encode(&vectors[range.start * dim..range.end * dim], |visit| {
                if visit.outcome == Encoded::Escape {
                    part.residuals.resize(part.residuals.len() + dim, 0.0);
                } else {
                    part.atoms.extend(visit.code.iter().map(|&(atom, _)| atom));
                    part.values.extend(visit.code.iter().map(|&(_, value)| value));
                    part.residuals
                        .extend(visit.signal.iter().zip(visit.reconstruction()).map(|(x, y)| x - y));
                }
                part.starts.push(part.atoms.len());
            });
            part
        });
        let mut all = Self { dim, starts: vec![0], ..Self::default() };
        for part in parts {
            let offset = all.atoms.len();
            all.starts.extend(part.starts.iter().map(|end| offset + end));
            all.atoms.extend(part.atoms);
            all.values.extend(part.values);
            all.residuals.extend(part.residuals);
        }
        all
    }

    /// Number of vectors.
    pub(super) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of uses of each of `atoms` atoms.
    pub(super) fn usage(&self, atoms: usize) -> Vec<usize> {
        let mut usage = vec![0; atoms];
        self.atoms.iter().for_each(|&atom| usage[usize::from(atom)] += 1);
        usage
    }

    /// The uses of each of `atoms` atoms, by ascending vector.
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
    pub(super) squared_error: f64,
}

/// Mean cost of coding `vectors`.
pub(super) fn cost(coder: &Coder, vectors: &[f32], dim: usize) -> Cost {
    let count = vectors.len() / dim;
    let parts = map_chunks(count, GAUSSIANS_PER_TASK, |range| {
        let (mut nonzeros, mut squared_error) = (0_usize, 0.0);
        coder.encode(&vectors[range.start * dim..range.end * dim], |visit| match visit.outcome {
            Encoded::Code { error } => {
                nonzeros += visit.code.len();
                squared_error += error * error;
            }
            // The vector is stored exactly, which costs as much as a code with all atoms.
            Encoded::Escape => nonzeros += dim,
        });
        (nonzeros, squared_error)
    });
    let scale = 1.0 / count.max(1) as f64;
    Cost {
        nonzeros: parts.iter().map(|p| p.0).sum::<usize>() as f64 * scale,
        squared_error: parts.iter().map(|p| p.1).sum::<f64>() * scale,
    }
}
