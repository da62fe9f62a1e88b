//! Codes many vectors: the stopping rule, and the check that every error is within the tolerance.

use half::f16;

use super::greedy::{ANY, Plan, Scratch, squared_distance};
use super::lanes::blocks_of;
use crate::sparse::atoms::Atoms;
use crate::sparse::codes::ValueType;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Pursuit;
use crate::support::error::{Error, Result};
use crate::support::simd::Simd;

/// Share of the tolerance by which errors of codes stay below it. A reader who sums the squares in another order then
/// agrees that the errors are within the tolerance.
const PROMISE_MARGIN: f64 = 1e-12;
/// Largest squared norm of a vector that is coded. Above it, f32 squares of correlations could overflow.
const MAX_ENERGY: f64 = 1e30;
/// Squared norm below which f32 squares of correlations lose their digits. Smaller vectors are coded if the tolerance is as
/// small, but coded badly. Rows of this size are coded in f64.
pub(super) const MIN_ENERGY: f64 = 1e-24;
/// Share of the signal's energy below which the f32 residual is rounding noise, so that more atoms would not help.
const NOISE_FLOOR: f64 = 1e-12;

/// Number of lanes of a per-atom array for the paper's dictionary of 90 atoms. Loops of a length known to the compiler are
/// faster.
const DEFAULT_BLOCKS: usize = blocks_of(90);

/// The rule by which a pursuit ends: at a tolerance or at a number of atoms, whichever comes first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StopRule {
    tolerance: Option<f64>,
    max_nonzeros: Option<usize>,
}

impl StopRule {
    /// Creates a rule that stops at the un-squared L2 norm `tolerance` of the error, at `max_nonzeros` atoms, or at
    /// whichever comes first.
    ///
    /// # Errors
    /// [`Error::Parameter`] if both are missing, or if the tolerance is not finite or not above 0.
    pub fn new(tolerance: Option<f64>, max_nonzeros: Option<usize>) -> Result<Self> {
        if let Some(tol) = tolerance
            && (!tol.is_finite() || tol <= 0.0)
        {
            return Err(Error::parameter("tolerance", tol, "a finite number above 0"));
        }
        if tolerance.is_none() && max_nonzeros.is_none() {
            return Err(Error::parameter("tolerance", "none", "a tolerance, a cap on nonzeros, or both"));
        }
        Ok(Self { tolerance, max_nonzeros })
    }

    /// Returns the tolerance, if any.
    #[must_use]
    pub fn tolerance(&self) -> Option<f64> {
        self.tolerance
    }

    /// Returns the rule for vectors that are scaled by two to the power `exponent`.
    pub(crate) fn scaled(self, exponent: i32) -> Self {
        let scaled = |tolerance| libm::scalbn(tolerance, exponent).clamp(f64::MIN_POSITIVE, f64::MAX);
        Self { tolerance: self.tolerance.map(scaled), ..self }
    }

    /// Returns the rule without the cap on nonzeros; unchanged if it has no tolerance.
    #[must_use]
    pub fn without_cap(self) -> Self {
        Self { max_nonzeros: if self.tolerance.is_some() { None } else { self.max_nonzeros }, ..self }
    }
}

/// Outcome of coding one vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Encoded {
    /// A code was found. Its error is computed in f64 from the values that a decoder reconstructs.
    Code {
        /// Un-squared L2 norm of the error.
        error: f64,
    },
    /// No code reaches the tolerance, so the vector must be stored exactly.
    Escape,
}

/// One coded vector, as [`Coder::encode`] passes it on.
#[derive(Debug, Clone, Copy)]
pub struct Visit<'a> {
    /// The vector.
    pub signal: &'a [f32],
    /// The pairs (atom, value) of the code, by ascending atom. Values are already rounded. An escape has the pairs that the
    /// pursuit ended with; [`Self::nearest`] tells whether they are of use.
    pub code: &'a [(u16, f32)],
    /// The outcome.
    pub outcome: Encoded,
    reconstruction: &'a [f32],
    /// The atoms that the pursuit chose, in order.
    pub(super) chosen: &'a [u16],
}

impl Visit<'_> {
    /// Returns the vector that a decoder reconstructs from the code.
    #[must_use]
    pub fn reconstruction(&self) -> &[f32] {
        &self.reconstruction[..self.signal.len()]
    }

    /// Returns the code that comes nearest to the vector, and the un-squared L2 norm of its error. This is the code of
    /// [`Encoded::Code`]. For an escape, it is the code that the pursuit ended with, or an empty code if the error of that
    /// code is not below the vector's norm.
    #[must_use]
    pub fn nearest(&self) -> (&[(u16, f32)], f64) {
        if let Encoded::Code { error } = self.outcome {
            return (self.code, error);
        }
        let norm = self.signal.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
        let error = squared_distance(self.signal, self.reconstruction).sqrt();
        if error < norm { (self.code, error) } else { (&[], norm) }
    }
}

/// The loop of [`Coder::encode`]. A closure would not be inlined into the dispatch, and would then be compiled without
/// the chosen instructions.
struct Job<'a, F, const BLOCKS: usize> {
    coder: &'a Coder,
    signals: &'a [f32],
    scratch: &'a mut Scratch,
    code: &'a mut Vec<(u16, f32)>,
    sink: &'a mut F,
}

impl<F: FnMut(Visit<'_>), const BLOCKS: usize> pulp::NullaryFnOnce for Job<'_, F, BLOCKS> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { coder, signals, scratch, code, sink } = self;
        for signal in signals.chunks_exact(coder.plan.dim) {
            let outcome = coder.encode_one::<BLOCKS>(scratch, signal, code);
            let (reconstruction, chosen) = (&scratch.reconstruction[..], &scratch.chosen[..scratch.len]);
            sink(Visit { signal, code, outcome, reconstruction, chosen });
        }
    }
}

/// A coder of vectors over one set of atoms. Threads can share a coder, since each call has its own working memory.
#[derive(Debug)]
pub struct Coder {
    plan: Plan,
    pursuit: Pursuit,
    stop: StopRule,
    values: ValueType,
}

impl Coder {
    /// Makes a coder over `dictionary`.
    #[must_use]
    pub fn new(dictionary: &Dictionary, pursuit: Pursuit, stop: StopRule, values: ValueType) -> Self {
        Self::over(dictionary.atoms(), pursuit, stop, values)
    }

    /// Makes a coder over `atoms`.
    #[must_use]
    pub fn over(atoms: &Atoms, pursuit: Pursuit, stop: StopRule, values: ValueType) -> Self {
        Self { plan: Plan::new(atoms), pursuit, stop, values }
    }

    /// Returns the number of values of a vector.
    #[must_use]
    pub fn dim(&self) -> usize {
        self.plan.dim
    }

    /// Returns the number of atoms.
    #[must_use]
    pub fn atoms(&self) -> usize {
        self.plan.atoms
    }

    /// Returns the tolerance at which the pursuit stops, if any.
    #[must_use]
    pub fn tolerance(&self) -> Option<f64> {
        self.stop.tolerance
    }

    /// Returns the largest error that counts as within the tolerance; 0 without a tolerance.
    pub(super) fn promise(&self) -> f64 {
        self.stop.tolerance.map_or(0.0, |t| t * (1.0 - PROMISE_MARGIN))
    }

    /// Returns the cap on nonzeros, if any.
    pub(super) fn max_nonzeros(&self) -> Option<usize> {
        self.stop.max_nonzeros
    }

    pub(super) fn pursuit(&self) -> Pursuit {
        self.pursuit
    }

    pub(super) fn value_type(&self) -> ValueType {
        self.values
    }

    /// Returns the values of atom `j`.
    pub(super) fn atom(&self, j: usize) -> impl Iterator<Item = f32> {
        self.plan.atom(j)
    }

    /// Codes the vectors in `signals`, each as long as an atom, and passes each result to `sink`, in order. Uses the
    /// vector instructions of [`Simd::current`](crate::simd::Simd::current).
    ///
    /// # Panics
    /// If the dictionary is empty (degree 0).
    pub fn encode(&self, signals: &[f32], mut sink: impl FnMut(Visit<'_>)) {
        match self.plan.has_blocks(DEFAULT_BLOCKS) {
            true => self.encode_blocks::<DEFAULT_BLOCKS>(signals, &mut sink),
            false => self.encode_blocks::<ANY>(signals, &mut sink),
        }
    }

    fn encode_blocks<const BLOCKS: usize>(&self, signals: &[f32], sink: &mut impl FnMut(Visit<'_>)) {
        let mut scratch = self.plan.scratch();
        let mut code = Vec::with_capacity(self.plan.dim);
        // The loop is compiled once for each vector width; the arithmetic is the same in each.
        let job = Job::<_, BLOCKS> { coder: self, signals, scratch: &mut scratch, code: &mut code, sink };
        Simd::current().run(job);
    }

    #[inline(always)]
    fn encode_one<const BLOCKS: usize>(
        &self,
        s: &mut Scratch,
        signal: &[f32],
        code: &mut Vec<(u16, f32)>,
    ) -> Encoded {
        code.clear();
        s.len = 0;
        let error = self.plan.error(s, signal, code);
        let promise = self.promise();
        if error <= promise || self.stop.max_nonzeros == Some(0) {
            return Encoded::Code { error };
        }
        let energy = error * error;
        if energy.is_nan() || energy > MAX_ENERGY {
            return Encoded::Escape;
        }
        let cap = self.stop.max_nonzeros.unwrap_or(self.plan.dim);
        let target = (promise * promise).max(energy * NOISE_FLOOR);
        self.plan.start::<BLOCKS>(s, signal, energy);
        loop {
            // Each pass takes at least one more atom. A further pass follows if the recurrence was too optimistic, or if
            // rounding to the value type raised the error above the tolerance.
            let mut exhausted = false;
            loop {
                exhausted |= s.len >= cap || !self.plan.step::<BLOCKS>(s, self.pursuit);
                if exhausted || s.energy <= target {
                    break;
                }
            }
            self.plan.solve(s, code);
            if self.values == ValueType::F16 {
                for (_, value) in code.iter_mut() {
                    *value = f16::from_f32(*value).to_f32();
                }
            }
            code.retain(|&(_, value)| value != 0.0);
            let error = self.plan.error(s, signal, code);
            if error <= promise {
                return Encoded::Code { error };
            }
            if exhausted {
                let capped = self.stop.max_nonzeros.is_some() && error.is_finite();
                return if capped { Encoded::Code { error } } else { Encoded::Escape };
            }
        }
    }
}
