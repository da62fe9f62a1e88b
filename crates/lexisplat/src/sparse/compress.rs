//! The whole encoder: a dense scene in, a [`Model`] and a report out.

use std::ops::Range;

use half::f16;

use crate::scene::sh::ShDegree;
use crate::scene::splats::Splats;
use crate::sparse::codes::{Escapes, Indices, SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::learn::{DEFAULT_SAMPLE, Fetch, LearnOptions, Learned, learn_from};
use crate::sparse::model::{Layout, Model, Pursuit, Record};
use crate::sparse::pursuit::{Coder, Encoded, StopRule, ValueType};
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_GAUSSIANS};
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_chunks};
use crate::support::progress::{Progress, Stage};
use crate::support::stopwatch::Stopwatch;

/// The paper's main tolerance.
pub const DEFAULT_TOLERANCE: f64 = 0.1;
/// Gaussians coded before their results are appended: bounds what is held twice.
pub(crate) const AT_ONCE: usize = 32 * GAUSSIANS_PER_TASK;

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
    let (n, dim) = (splats.len(), splats.degree.rest());
    Limits::check("Gaussians", n as u64, MAX_GAUSSIANS)?;
    let clock = Stopwatch::start();
    let mut fetch = |numbers: &[usize], out: &mut Vec<f32>| {
        numbers.iter().for_each(|&i| out.extend_from_slice(splats.rest(i)));
        Ok(())
    };
    let (encoder, learned) = Encoder::new(splats.degree, n, &mut fetch, options, progress)?;
    let learn_seconds = clock.seconds();
    let clock = Stopwatch::start();
    let mut coded = encoder.nothing();
    if dim > 0 && splats.sh_rest.iter().any(|v| !v.is_finite()) {
        return Err(Error::parameter("sh_rest", "NaN or infinity", "finite values"));
    }
    progress.begin(Stage::Code, n as u64);
    for start in (0..n).step_by(AT_ONCE) {
        let end = n.min(start + AT_ONCE);
        encoder.code(&splats.sh_rest[start * dim..end * dim], start..end, &mut coded, progress);
    }
    progress.end();
    let (record, report) = coded.tally.into_report(options, n, learned, [learn_seconds, clock.seconds()]);
    let Encoder { dictionary, .. } = encoder;
    let codes = SparseCodes::new(&dictionary, coded.counts, coded.indices, coded.values, coded.escapes)?;
    let Splats { geometry, meta, .. } = splats;
    Ok((Model { geometry, meta, dictionary, codes, record }, report))
}

/// A dictionary, and how to code with it.
pub(crate) struct Encoder {
    pub(crate) dictionary: Dictionary,
    coder: Option<Coder>,
    tolerance: Option<f64>,
    values: ValueType,
}

impl Encoder {
    /// Checks `options` and learns the dictionary from `vectors` rows of SH-rest, unless one is given.
    pub(crate) fn new(
        degree: ShDegree,
        vectors: usize,
        fetch: &mut Fetch<'_>,
        options: &CompressOptions,
        progress: &dyn Progress,
    ) -> Result<(Self, Option<Learned>)> {
        let stop = StopRule::new(options.tolerance, options.max_nonzeros)?;
        let (dictionary, learned) = match &options.dictionary {
            Some(given) if given.degree() != degree => {
                let expected = format!("a dictionary of the scene's SH degree {degree}");
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
                let learned = learn_from(degree, vectors, fetch, &learn_options, progress)?;
                (learned.dictionary.clone(), Some(learned))
            }
        };
        let values = if options.layout == Layout::F16 { ValueType::F16 } else { ValueType::F32 };
        let coder = (degree.rest() > 0).then(|| Coder::new(&dictionary, options.pursuit, stop, values));
        Ok((Self { dictionary, coder, tolerance: stop.tolerance(), values }, learned))
    }

    /// Codes of no Gaussians.
    pub(crate) fn nothing(&self) -> Coded {
        Coded::empty(&self.dictionary, self.values)
    }

    /// Codes `rest`, the SH-rest of Gaussians `range`, and appends to `coded`. The same bits come out of one
    /// call and of several, if all but the last are for a multiple of [`GAUSSIANS_PER_TASK`] Gaussians.
    pub(crate) fn code(&self, rest: &[f32], range: Range<usize>, coded: &mut Coded, progress: &dyn Progress) {
        let dim = self.dictionary.dim();
        let Some(coder) = &self.coder else {
            coded.counts.resize(coded.counts.len() + range.len(), 0);
            coded.tally.histogram[0] += range.len() as u64;
            progress.advance(range.len() as u64);
            return;
        };
        let parts = map_chunks(range.len(), GAUSSIANS_PER_TASK, |piece| {
            let mut part = self.nothing();
            let start = range.start + piece.start;
            coder.encode(&rest[piece.start * dim..piece.end * dim], |visit| {
                part.push(start, visit.signal, visit.code, visit.outcome, self.tolerance);
            });
            progress.advance(piece.len() as u64);
            part
        });
        for part in parts {
            coded.append(part);
        }
    }
}

/// What is counted while coding.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tally {
    pub(crate) nonzeros: u64,
    pub(crate) escapes: u64,
    /// Gaussians by number of nonzeros; escapes not among them.
    histogram: Vec<u64>,
    max_error: f64,
    squared_error: f64,
    over_tolerance: u64,
}

impl Tally {
    fn add(&mut self, part: &Self) {
        self.nonzeros += part.nonzeros;
        self.escapes += part.escapes;
        self.histogram.iter_mut().zip(&part.histogram).for_each(|(a, b)| *a += b);
        self.max_error = self.max_error.max(part.max_error);
        self.squared_error += part.squared_error;
        self.over_tolerance += part.over_tolerance;
    }

    /// What is recorded and reported of `gaussians` Gaussians; `seconds` are those of learning and coding.
    pub(crate) fn into_report(
        &self,
        options: &CompressOptions,
        gaussians: usize,
        learned: Option<Learned>,
        seconds: [f64; 2],
    ) -> (Record, CompressReport) {
        let count = gaussians.max(1) as f64;
        let dim = self.histogram.len() as u64 - 1;
        let record = Record {
            tolerance: options.tolerance,
            max_nonzeros: options.max_nonzeros,
            pursuit: options.pursuit,
            seed: options.seed,
            layout: options.layout,
            max_residual: self.max_error,
            rms_residual: (self.squared_error / count).sqrt(),
            over_tolerance: self.over_tolerance,
        };
        let report = CompressReport {
            learned,
            mean_nonzeros: (self.nonzeros + self.escapes * dim) as f64 / count,
            nonzero_histogram: self.histogram.clone(),
            escapes: self.escapes,
            learn_seconds: seconds[0],
            code_seconds: seconds[1],
        };
        (record, report)
    }
}

/// The codes of a run of Gaussians, as they grow.
#[derive(Debug)]
pub(crate) struct Coded {
    pub(crate) counts: Vec<u8>,
    pub(crate) indices: Indices,
    pub(crate) values: Values,
    pub(crate) escapes: Escapes,
    pub(crate) tally: Tally,
}

impl Coded {
    fn empty(dictionary: &Dictionary, values: ValueType) -> Self {
        Self {
            counts: Vec::new(),
            indices: Indices::for_atoms(dictionary.len()),
            values: match values {
                ValueType::F32 => Values::F32(Vec::new()),
                ValueType::F16 => Values::F16(Vec::new()),
            },
            escapes: Escapes::default(),
            tally: Tally { histogram: vec![0; dictionary.dim() + 1], ..Tally::default() },
        }
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
            self.tally.escapes += 1;
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
        self.tally.nonzeros += code.len() as u64;
        self.tally.histogram[code.len()] += 1;
        self.tally.max_error = self.tally.max_error.max(error);
        self.tally.squared_error += error * error;
        self.tally.over_tolerance += u64::from(tolerance.is_some_and(|t| error > t));
    }

    /// Forgets the codes, but not what was counted.
    pub(crate) fn clear(&mut self) {
        self.counts.clear();
        match &mut self.indices {
            Indices::U8(v) => v.clear(),
            Indices::U16(v) => v.clear(),
        }
        match &mut self.values {
            Values::F32(v) => v.clear(),
            Values::F16(v) => v.clear(),
        }
        self.escapes.gaussians.clear();
        self.escapes.rows.clear();
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
        self.tally.add(&part.tally);
    }
}
