//! Sparse coding of SH-rest vectors: the few atoms that bring each within a tolerance.
//!
//! Two greedy rules share one engine. **OMP** takes the atom most correlated with the residual (the
//! paper). **OLS** takes the atom that lowers the residual most once the coefficients of all chosen atoms
//! are refitted; it needs fewer atoms for the same tolerance. Both keep the inner products of every atom
//! with an orthonormal basis of the chosen span, so a step costs `atoms * chosen` multiply-adds and never
//! touches the signal again (Rubinstein et al. 2008, "Batch-OMP"; Mairal's SPAMS for the OLS form).
//!
//! **Determinism.** All long loops run element by element over atoms in lanes of fixed width, with one
//! rounding per multiply and per add and no fused operations; the only reduction is a maximum. The result
//! is therefore the same bit for bit on every CPU, whatever vector width the compiler or the run-time
//! dispatch picks.

mod engine;
mod greedy;
#[cfg(test)]
mod oracle;

pub use engine::{Coder, Encoded, StopRule, ValueType, Visit};
