//! Sparse coding of vectors, SH-rest or others: finds the few atoms that bring each vector within a tolerance.
//!
//! Two greedy rules share one engine. **OMP**, the rule of the paper, chooses the atom most correlated with the residual.
//! **OLS** chooses the atom that lowers the residual most after the coefficients of all chosen atoms are refitted. OLS
//! needs fewer atoms for the same tolerance. Both rules keep the inner products of every atom with an orthonormal basis of
//! the chosen span. A step therefore costs `atoms * chosen` multiply-adds and never reads the signal again (Rubinstein et
//! al. 2008, "Batch-OMP"; Mairal's SPAMS for the OLS form).
//!
//! **Rows.** The engine leaves a row over the tolerance if f32 cannot tell the last atoms apart, or if the row is too large
//! or too small for f32. [`encode_rows`] codes such rows anew in f64. Scenes store such vectors exactly instead.
//!
//! **Determinism.** All long loops run element by element over atoms in lanes of fixed width. Every multiplication and
//! every addition is rounded by itself, and the only reduction is a maximum. The result is therefore the same bit for
//! bit on every CPU, at any vector width of the compiler and of the run-time dispatch.

mod careful;
mod engine;
mod greedy;
pub(crate) mod lanes;
mod rows;
#[cfg(test)]
pub(super) mod tests;

pub use super::codes::ValueType;
pub use super::row_value::RowValue;
pub use engine::{Coder, Encoded, StopRule, Visit};
pub(crate) use rows::RowCoder;
pub use rows::{RowCodes, encode_rows};

/// Number of rows that one task codes. It is small enough that even small sets of long rows occupy all threads.
pub(crate) const ROWS_PER_TASK: usize = 256;
