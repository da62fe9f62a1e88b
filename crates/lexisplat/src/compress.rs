//! The whole encoder: a dense scene in, a [`Model`] and a report out.

use half::f16;

use crate::codes::{Escapes, Indices, SparseCodes, Values};
use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::learn::{DEFAULT_SAMPLE, LearnOptions, Learned, learn};
use crate::limits::Limits;
use crate::model::{Layout, Model, Pursuit, Record};
use crate::parallel::{CHUNK, map_chunks};
use crate::progress::{Progress, Stage};
use crate::pursuit::{Coder, Encoded, Stop, ValueType};
use crate::splats::Splats;
use crate::stopwatch::Stopwatch;

/// The paper's main tolerance.
pub const DEFAULT_TOLERANCE: f64 = 0.1;
/// Chunks coded before their results are appended: bounds what is held twice.
const CHUNKS_AT_ONCE: usize = 32;

/// How to compress.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CompressOptions {
    /// Un-squared L2 norm that no Gaussian's SH-rest error may exceed. Default [`DEFAULT_TOLERANCE`].
    pub tolerance: Option<f64>,
    /// Most nonzeros of a Gaussian. Setting it lifts the promise of `tolerance`.
    pub max_nonzeros: Option<u8>,
    /// Atoms to learn; `None` for twice the dimension. Ignored when `dictionary` is given.
    pub atoms: Option<usize>,
    /// The pursuit. Default OLS.
    pub pursuit: Pursuit,
    /// Layout of the codes in the file. Default f16.
    pub layout: Layout,
    /// Seed of the learning sample.
    pub seed: u64,
    /// Gaussians to learn from at most.
    pub sample: usize,
    /// A dictionary to use instead of learning one. Its degree must be the scene's.
    pub dictionary: Option<Dictionary>,
}

impl Default for CompressOptions {
    fn default() -> Self {
        Self {
            tolerance: Some(DEFAULT_TOLERANCE),
            max_nonzeros: None,
            atoms: None,
            pursuit: Pursuit::Ols,
            layout: Layout::F16,
            seed: 0,
            sample: DEFAULT_SAMPLE,
            dictionary: None,
        }
    }
}

/// What compressing did.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct CompressReport {
    /// How learning went; `None` with a given dictionary.
    pub learned: Option<Learned>,
    /// Mean nonzeros a Gaussian, an escape counting as a full vector.
    pub mean_nonzeros: f64,
    /// Gaussians by number of nonzeros, from 0 to the dimension; escapes not among them.
    pub nonzero_histogram: Vec<u64>,
    /// Gaussians stored exactly.
    pub escapes: u64,
    /// Seconds spent learning (0 where there is no clock, as in a browser).
    pub learn_seconds: f64,
    /// Seconds spent coding and verifying.
    pub code_seconds: f64,
}

impl CompressReport {
    /// The paper's ratio: SH-rest coefficients over mean nonzeros. `None` when nothing is coded.
    #[must_use]
    pub fn coefficient_ratio(&self) -> Option<f64> {
        let dim = self.nonzero_histogram.len().saturating_sub(1);
        (self.mean_nonzeros > 0.0).then(|| dim as f64 / self.mean_nonzeros)
    }
}

/// Compresses `splats`, which are consumed so that the geometry need not exist twice.
///
/// # Errors
/// [`Error::Parameter`] for options out of range, a dictionary of another degree, or a scene whose arrays
/// differ in length or whose values are not finite.
pub fn compress(
    splats: Splats,
    options: &CompressOptions,
    progress: &dyn Progress,
) -> Result<(Model, CompressReport)> {
    splats.validate()?;
    // What a reader would refuse is not written.
    splats.geometry.validate_values()?;
    Limits::check("Gaussians", splats.len() as u64, Limits::default().gaussians)?;
    let stop = Stop::new(options.tolerance, options.max_nonzeros)?;
    let clock = Stopwatch::start();
    let (dictionary, learned) = match &options.dictionary {
        Some(given) if given.degree() != splats.degree => {
            let expected = format!("a dictionary of the scene's SH degree {}", splats.degree);
            return Err(Error::parameter("dictionary", format!("degree {}", given.degree()), expected));
        }
        Some(given) => (given.clone(), None),
        None => {
            let learn_options = LearnOptions {
                atoms: options.atoms,
                pursuit: options.pursuit,
                stop,
                seed: options.seed,
                sample: options.sample,
                ..LearnOptions::new(stop)
            };
            let learned = learn(splats.degree, &splats.sh_rest, &learn_options, progress)?;
            (learned.dictionary.clone(), Some(learned))
        }
    };
    let learn_seconds = clock.seconds();
    let clock = Stopwatch::start();
    let values = if options.layout == Layout::F16 { ValueType::F16 } else { ValueType::F32 };
    let coder = Coder::new(&dictionary, options.pursuit, stop, values);
    let coded = Coded::scene(&coder, &splats, &dictionary, values, stop.tolerance(), progress)?;
    let code_seconds = clock.seconds();

    let count = splats.len().max(1) as f64;
    let escapes = coded.escapes.gaussians.len() as u64;
    let dim = dictionary.dim();
    let nonzeros = coded.indices.len() as u64 + escapes * dim as u64;
    let mut nonzero_histogram = vec![0_u64; dim + 1];
    for &n in &coded.counts {
        nonzero_histogram[usize::from(n)] += 1;
    }
    nonzero_histogram[0] -= escapes;
    let record = Record {
        tolerance: options.tolerance,
        max_nonzeros: options.max_nonzeros,
        pursuit: options.pursuit,
        seed: options.seed,
        layout: options.layout,
        max_residual: coded.max_error,
        rms_residual: (coded.squared_error / count).sqrt(),
        over_tolerance: coded.over_tolerance,
    };
    let codes = SparseCodes::new(&dictionary, coded.counts, coded.indices, coded.values, coded.escapes)?;
    let report = CompressReport {
        learned,
        mean_nonzeros: nonzeros as f64 / count,
        nonzero_histogram,
        escapes,
        learn_seconds,
        code_seconds,
    };
    let Splats { geometry, meta, .. } = splats;
    Ok((Model { geometry, meta, dictionary, codes, record }, report))
}

/// The codes of a run of Gaussians, as they grow.
struct Coded {
    counts: Vec<u8>,
    indices: Indices,
    values: Values,
    escapes: Escapes,
    max_error: f64,
    squared_error: f64,
    over_tolerance: u64,
}

impl Coded {
    fn empty(atoms: usize, values: ValueType) -> Self {
        Self {
            counts: Vec::new(),
            indices: Indices::for_atoms(atoms),
            values: match values {
                ValueType::F32 => Values::F32(Vec::new()),
                ValueType::F16 => Values::F16(Vec::new()),
            },
            escapes: Escapes::default(),
            max_error: 0.0,
            squared_error: 0.0,
            over_tolerance: 0,
        }
    }

    /// Codes a whole scene, chunk by chunk.
    fn scene(
        coder: &Coder,
        splats: &Splats,
        dictionary: &Dictionary,
        values: ValueType,
        tolerance: Option<f64>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (n, dim) = (splats.len(), splats.degree.rest());
        let mut all = Self::empty(dictionary.len(), values);
        if dim == 0 {
            all.counts = vec![0; n];
            return Ok(all);
        }
        if splats.sh_rest.iter().any(|v| !v.is_finite()) {
            return Err(Error::parameter("sh_rest", "NaN or infinity", "finite values"));
        }
        progress.begin(Stage::Code, n as u64);
        for batch in (0..n).step_by(CHUNK * CHUNKS_AT_ONCE) {
            let len = (n - batch).min(CHUNK * CHUNKS_AT_ONCE);
            let parts = map_chunks(len, CHUNK, |range| {
                let mut part = Self::empty(dictionary.len(), values);
                let (start, end) = (batch + range.start, batch + range.end);
                coder.encode(&splats.sh_rest[start * dim..end * dim], |visit| {
                    part.push(start, visit.signal, visit.code, visit.outcome, tolerance);
                });
                progress.advance((end - start) as u64);
                part
            });
            for part in parts {
                all.append(part);
            }
        }
        progress.end();
        Ok(all)
    }

    fn push(
        &mut self,
        start: usize,
        signal: &[f32],
        code: &[(u16, f32)],
        outcome: Encoded,
        tolerance: Option<f64>,
    ) {
        let Encoded::Code { error } = outcome else {
            // Scenes are limited to u32 Gaussians, a code to `dim` atoms, dictionaries to u16 atoms.
            #[expect(clippy::cast_possible_truncation, reason = "checked before coding")]
            self.escapes.gaussians.push((start + self.counts.len()) as u32);
            self.escapes.rows.extend_from_slice(signal);
            self.counts.push(0);
            return;
        };
        #[expect(clippy::cast_possible_truncation, reason = "checked before coding")]
        self.counts.push(code.len() as u8);
        match &mut self.indices {
            #[expect(clippy::cast_possible_truncation, reason = "chosen for at most 256 atoms")]
            Indices::U8(indices) => indices.extend(code.iter().map(|p| p.0 as u8)),
            Indices::U16(indices) => indices.extend(code.iter().map(|p| p.0)),
        }
        match &mut self.values {
            Values::F32(values) => values.extend(code.iter().map(|p| p.1)),
            Values::F16(values) => values.extend(code.iter().map(|p| f16::from_f32(p.1))),
        }
        self.max_error = self.max_error.max(error);
        self.squared_error += error * error;
        self.over_tolerance += u64::from(tolerance.is_some_and(|t| error > t));
    }

    fn append(&mut self, part: Self) {
        self.counts.extend_from_slice(&part.counts);
        match (&mut self.indices, part.indices) {
            (Indices::U8(a), Indices::U8(b)) => a.extend_from_slice(&b),
            (Indices::U16(a), Indices::U16(b)) => a.extend_from_slice(&b),
            _ => unreachable!("all parts come from one dictionary"),
        }
        match (&mut self.values, part.values) {
            (Values::F32(a), Values::F32(b)) => a.extend_from_slice(&b),
            (Values::F16(a), Values::F16(b)) => a.extend_from_slice(&b),
            _ => unreachable!("all parts have one value type"),
        }
        self.escapes.gaussians.extend_from_slice(&part.escapes.gaussians);
        self.escapes.rows.extend_from_slice(&part.escapes.rows);
        self.max_error = self.max_error.max(part.max_error);
        self.squared_error += part.squared_error;
        self.over_tolerance += part.over_tolerance;
    }
}
