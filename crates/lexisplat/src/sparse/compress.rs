//! The encoder of the exact layouts.

use std::ops::Range;

use half::f16;

use crate::scene::source::SplatSource;
use crate::scene::splats::{Splats, all_finite};
use crate::sparse::codes::{Escapes, Indices, SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::learn::{DEFAULT_SAMPLE, LearnOptions, Learned, learn_from};
use crate::sparse::model::{Model, Pursuit, Record};
use crate::sparse::pursuit::{self, Coder, StopRule, ValueType, Visit};
use crate::sparse::tally::{CompressReport, Tally};
use crate::support::builder::builder_methods;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_GAUSSIANS};
use crate::support::parallel::{AT_ONCE, GAUSSIANS_PER_TASK, map_chunks};
use crate::support::progress::{Progress, Stage};
use crate::support::stopwatch::Stopwatch;

/// Default tolerance, which is the paper's main one.
pub const DEFAULT_TOLERANCE: f64 = 0.1;

/// Options of compression to an exact layout.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CompressOptions {
    /// Un-squared L2 norm that the SH-rest error of no Gaussian exceeds. Default [`DEFAULT_TOLERANCE`].
    pub tolerance: Option<f64>,
    /// Largest number of nonzeros of a Gaussian. With it, `tolerance` is no longer promised.
    pub max_nonzeros: Option<u8>,
    /// Number of atoms to learn; `None` for twice the dimension. Ignored if `dictionary` is given.
    pub atoms: Option<usize>,
    /// The pursuit. Default OLS.
    pub pursuit: Pursuit,
    /// Type of the values of codes. Default f16.
    pub values: ValueType,
    /// Seed of the learning sample.
    pub seed: u64,
    /// Largest number of Gaussians to learn from.
    pub sample: usize,
    /// A dictionary to use instead of learning one. Its degree must be the scene's.
    pub dictionary: Option<Dictionary>,
}

impl CompressOptions {
    builder_methods!(
        with_tolerance(tolerance: impl Into<Option<f64>>),
        with_max_nonzeros(max_nonzeros: impl Into<Option<u8>>),
        with_atoms(atoms: impl Into<Option<usize>>),
        with_pursuit(pursuit: Pursuit),
        with_values(values: ValueType),
        with_seed(seed: u64),
        with_sample(sample: usize),
        with_dictionary(dictionary: impl Into<Option<Dictionary>>),
    );
}

impl Default for CompressOptions {
    fn default() -> Self {
        Self {
            tolerance: Some(DEFAULT_TOLERANCE),
            max_nonzeros: None,
            atoms: None,
            pursuit: Pursuit::Ols,
            values: ValueType::F16,
            seed: 0,
            sample: DEFAULT_SAMPLE,
            dictionary: None,
        }
    }
}

/// Compresses `splats`. It is consumed, so that the geometry need not be in memory twice.
///
/// # Errors
/// [`Error::Parameter`] if options are out of range, if the dictionary is of another degree, or if the arrays of the scene
/// differ in length or have values that are not finite; [`Error::Cancelled`].
pub fn compress(
    splats: Splats,
    options: &CompressOptions,
    progress: &dyn Progress,
) -> Result<(Model, CompressReport)> {
    splats.validate()?;
    splats.geometry.validate_values()?;
    let dim = splats.degree.rest();
    let Encoded { dictionary, coded, record, report } =
        encode(&splats, options, AT_ONCE, progress, &mut |encoder, range, coded| {
            encoder.code(&splats.sh_rest[range.start * dim..range.end * dim], range, coded, progress)
        })?;
    let codes = SparseCodes::new(&dictionary, coded.counts, coded.indices, coded.values, coded.escapes)?;
    let Splats { geometry, meta, .. } = splats;
    Ok((Model::new(geometry, meta, dictionary, codes, record)?, report))
}

/// A function that codes the Gaussians of a range and appends their codes.
type CodeNext<'a> = dyn FnMut(&Encoder, Range<usize>, &mut Coded) -> Result<()> + 'a;

/// The results of [`encode`].
pub(crate) struct Encoded {
    pub(crate) dictionary: Dictionary,
    /// The codes that `code_next` appended and did not clear.
    pub(crate) coded: Coded,
    pub(crate) record: Record,
    pub(crate) report: CompressReport,
}

/// Checks `options`, learns the dictionary from rows of `source`, and calls `code_next` for successive ranges of Gaussians.
/// Each range but the last has `at_once` Gaussians, which must be a multiple of [`GAUSSIANS_PER_TASK`].
pub(crate) fn encode(
    source: &dyn SplatSource,
    options: &CompressOptions,
    at_once: usize,
    progress: &dyn Progress,
    code_next: &mut CodeNext<'_>,
) -> Result<Encoded> {
    debug_assert!(at_once.is_multiple_of(GAUSSIANS_PER_TASK), "sums would be added in another order");
    let n = source.len();
    Limits::check("Gaussians", n as u64, MAX_GAUSSIANS)?;
    let clock = Stopwatch::start();
    let (encoder, learned) = Encoder::new(source, options, progress)?;
    let learn_seconds = clock.seconds();
    let clock = Stopwatch::start();
    let mut coded = encoder.no_codes();
    progress.begin(Stage::Code, n as u64);
    for start in (0..n).step_by(at_once) {
        progress.check()?;
        code_next(&encoder, start..n.min(start + at_once), &mut coded)?;
    }
    progress.end();
    let record = Record {
        tolerance: options.tolerance,
        max_nonzeros: options.max_nonzeros,
        pursuit: Some(options.pursuit),
        seed: options.seed,
        ..Record::default()
    };
    let tally = std::mem::take(&mut coded.tally);
    let (record, report) = tally.into_report(record, n);
    let report = CompressReport { learned, learn_seconds, code_seconds: clock.seconds(), ..report };
    Ok(Encoded { dictionary: encoder.dictionary, coded, record, report })
}

/// A dictionary, and the parameters of coding with it.
pub(crate) struct Encoder {
    dictionary: Dictionary,
    coder: Option<Coder>,
    tolerance: Option<f64>,
    values: ValueType,
}

impl Encoder {
    /// Checks `options` and learns the dictionary from rows of `source`, unless one is given.
    fn new(
        source: &dyn SplatSource,
        options: &CompressOptions,
        progress: &dyn Progress,
    ) -> Result<(Self, Option<Learned>)> {
        let degree = source.empty().degree;
        let stop = StopRule::new(options.tolerance, options.max_nonzeros.map(usize::from))?;
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
                    seed: options.seed,
                    sample: options.sample,
                    ..LearnOptions::new(stop)
                };
                let mut fetch = |numbers: &[usize], out: &mut Vec<f32>| source.read_rest(numbers, out);
                let learned = learn_from(degree, source.len(), &mut fetch, &learn_options, progress)?;
                (learned.dictionary.clone(), Some(learned))
            }
        };
        let values = options.values;
        let coder = (degree.rest() > 0).then(|| Coder::new(&dictionary, options.pursuit, stop, values));
        Ok((Self { dictionary, coder, tolerance: stop.tolerance(), values }, learned))
    }

    fn no_codes(&self) -> Coded {
        Coded {
            counts: Vec::new(),
            indices: Indices::for_atoms(self.dictionary.len()),
            values: Values::empty(self.values),
            escapes: Escapes::default(),
            tally: Tally::new(self.dictionary.dim()),
        }
    }

    /// Removes the codes from `coded` and keeps the counts.
    pub(crate) fn clear(&self, coded: &mut Coded) {
        let tally = std::mem::take(&mut coded.tally);
        *coded = Coded { tally, ..self.no_codes() };
    }

    /// Codes `rest`, the SH-rest of Gaussians `range`, and appends the codes to `coded`.
    ///
    /// # Errors
    /// [`Error::Parameter`] for values that are not finite, [`Error::Cancelled`].
    pub(crate) fn code(
        &self,
        rest: &[f32],
        range: Range<usize>,
        coded: &mut Coded,
        progress: &dyn Progress,
    ) -> Result<()> {
        let dim = self.dictionary.dim();
        let Some(coder) = &self.coder else {
            coded.counts.resize(coded.counts.len() + range.len(), 0);
            coded.tally.histogram[0] += range.len() as u64;
            progress.advance(range.len() as u64);
            return Ok(());
        };
        let tasks = map_chunks(range.len(), GAUSSIANS_PER_TASK, |piece| {
            progress.check()?;
            let mut codes = TaskCodes { tally: Tally::new(dim), ..TaskCodes::default() };
            let start = range.start + piece.start;
            let rest = &rest[piece.start * dim..piece.end * dim];
            all_finite([("sh_rest", rest)])?;
            coder.encode(rest, |visit| codes.push(start, &visit, self.tolerance));
            progress.advance(piece.len() as u64);
            Ok(codes)
        });
        for codes in tasks {
            coded.append(codes?);
        }
        Ok(())
    }
}

/// Codes of a run of Gaussians, with room for atoms and values of any type.
#[derive(Debug, Default)]
struct TaskCodes {
    counts: Vec<u8>,
    pairs: Vec<(u16, f32)>,
    escapes: Escapes,
    tally: Tally,
}

impl TaskCodes {
    /// Appends the next code. Escapes are numbered from `start`.
    fn push(&mut self, start: usize, visit: &Visit<'_>, tolerance: Option<f64>) {
        let code = match visit.outcome {
            pursuit::Encoded::Code { error } => {
                self.tally.code(visit.code.len(), error, tolerance);
                visit.code
            }
            pursuit::Encoded::Escape => {
                #[expect(clippy::cast_possible_truncation, reason = "checked before coding")]
                self.escapes.gaussians.push((start + self.counts.len()) as u32);
                self.escapes.rows.extend_from_slice(visit.signal);
                self.tally.escapes += 1;
                &[]
            }
        };
        #[expect(clippy::cast_possible_truncation, reason = "checked before coding")]
        self.counts.push(code.len() as u8);
        self.pairs.extend_from_slice(code);
    }
}

/// The codes of a run of Gaussians as a file holds them.
#[derive(Debug)]
pub(crate) struct Coded {
    pub(crate) counts: Vec<u8>,
    pub(crate) indices: Indices,
    pub(crate) values: Values,
    pub(crate) escapes: Escapes,
    tally: Tally,
}

impl Coded {
    /// Appends `codes`.
    fn append(&mut self, codes: TaskCodes) {
        let TaskCodes { counts, pairs, escapes, tally } = codes;
        self.counts.extend(counts);
        match &mut self.indices {
            #[expect(clippy::cast_possible_truncation, reason = "chosen for at most 256 atoms")]
            Indices::U8(indices) => indices.extend(pairs.iter().map(|p| p.0 as u8)),
            Indices::U16(indices) => indices.extend(pairs.iter().map(|p| p.0)),
        }
        match &mut self.values {
            Values::F32(values) => values.extend(pairs.iter().map(|p| p.1)),
            Values::F16(values) => values.extend(pairs.iter().map(|p| f16::from_f32(p.1))),
        }
        self.escapes.gaussians.extend(escapes.gaussians);
        self.escapes.rows.extend(escapes.rows);
        self.tally.add(&tally);
    }
}
