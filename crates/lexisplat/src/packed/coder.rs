//! What all chunks of a file are coded with, and the coding of one.

use half::f16;

use super::canonical::{MortonKey, canonical};
use super::chunk_codec::{ChunkCodec, Code, GaussianValues};
use super::chunks::{MAX_ATOM_BITS, code_dictionary, resident};
use super::codebook::{Codebook, Codes, Costs, StopRule, first_atoms, learn};
use super::entropy::{CONTEXTS, Histogram, Tables};
use super::fit::Fit;
use super::pack::{PackOptions, PackReport};
use super::parameters::Parameters;
use super::stream::{Stream, SymbolEncoder};
use crate::scene::splats::Splats;
use crate::sparse::codes::reconstruct;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Layout, Pursuit, Record};
use crate::support::error::{Error, Result};
use crate::support::progress::Progress;
use crate::support::rng::SplitMix64;

/// Rows to learn a dictionary from at most.
const SAMPLE: usize = 24_576;
/// Most rows that decide how finely atoms are rounded.
const ATOM_BITS_SAMPLE: usize = 2048;
/// Gaussians that pay for one more atom.
const GAUSSIANS_PER_ATOM: usize = 64;
/// Atoms learned unless asked otherwise at most: as many as one byte counts. At least there are as many as
/// a row has coefficients, without which nothing comes near.
const MAX_LEARNED: usize = 256;
/// Steps an atom's coefficient is rounded to, for each step of an average value.
const ATOM_STEPS_PER_VALUE: f64 = 10.0;
/// Step of SH values as a share of a promised tolerance.
const VALUE_STEP_PER_TOLERANCE: f64 = 0.35;
/// Share of the squared tolerance a code is first asked to stay below; the rest is for f16.
const TOLERANCE_SHARE: f32 = 0.995;
/// A code whose error is above this, the largest f16, is no code, promise or not: the row is stored exactly.
const MAX_ERROR: f64 = 65_504.0;
/// Mixed into the seed of the sample.
const SAMPLE_STREAM: u64 = 0x70_61_63_6b;

/// Gaussians in the order of a packed file.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) splats: &'a Splats,
    /// Which Gaussian of `splats` comes next, and its cell.
    pub(super) scene: &'a [MortonKey],
    /// Colour and shape class of each, in this order.
    pub(super) classes: &'a [[u8; 2]],
}

impl<'a> View<'a> {
    /// The part `range` of it.
    pub(super) fn part(self, range: std::ops::Range<usize>) -> Self {
        Self { splats: self.splats, scene: &self.scene[range.clone()], classes: &self.classes[range] }
    }

    fn len(self) -> usize {
        self.scene.len()
    }

    fn row(self, i: usize) -> &'a [f32] {
        self.splats.rest(self.scene[i].index())
    }

    /// The rows of Gaussians `indices` in units of their value steps, and their colour classes.
    fn scaled(self, indices: impl Iterator<Item = usize>, parameters: &Parameters) -> (Vec<f32>, Vec<u8>) {
        let mut rows = Vec::new();
        let mut classes = Vec::new();
        for i in indices {
            let class = self.classes[i][0];
            let inverse = 1.0 / parameters.value_step(class);
            rows.extend(self.row(i).iter().map(|x| x * inverse));
            classes.push(class);
        }
        (rows, classes)
    }
}

/// What all chunks are coded with.
#[derive(Debug)]
pub(super) struct ChunkCoder {
    pub(super) parameters: Parameters,
    pub(super) dictionary: Dictionary,
    pub(super) atom_bits: u32,
    /// The dictionary's symbols.
    pub(super) first: SymbolEncoder,
    book: Option<Codebook>,
    stop: StopRule,
    tolerance: Option<f64>,
}

impl ChunkCoder {
    /// Learns from the Gaussians of `view` how to code the `total` of a scene.
    pub(super) fn new(
        view: View<'_>,
        total: usize,
        fit: &Fit,
        step: f64,
        options: &PackOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        if !step.is_finite() || step <= 0.0 {
            return Err(Error::parameter("step", step, "a finite number above 0"));
        }
        let mut parameters = fit.with_step(step);
        #[expect(clippy::cast_possible_truncation, reason = "a step is f32")]
        if let Some(tol) = options.tolerance {
            let step = tol * VALUE_STEP_PER_TOLERANCE;
            parameters.promised = step.clamp(f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX)) as f32;
        }
        if Parameters::from_list(&parameters.to_list()).is_none() {
            return Err(too_large());
        }
        let degree = view.splats.degree;
        let dim = degree.rest();
        let stop = match options.tolerance {
            #[expect(clippy::cast_possible_truncation, reason = "a share of the tolerance, in steps")]
            Some(_) => StopRule::Error((1.0 / VALUE_STEP_PER_TOLERANCE).powi(2) as f32 * TOLERANCE_SHARE),
            None => StopRule::Balanced,
        };
        let mut coder = Self {
            parameters,
            dictionary: Dictionary::empty(),
            atom_bits: 0,
            first: SymbolEncoder::default(),
            book: None,
            stop,
            tolerance: options.tolerance,
        };
        if dim > 0 && view.len() > 0 {
            let (rows, costs) = coder.learn(view, total, options, progress)?;
            coder.atom_bits = coder.choose_atom_bits(view, &rows, &costs);
            let atoms = rows.len() / dim;
            let rounded = code_dictionary(&mut coder.first, degree, atoms, coder.atom_bits, Some(&rows));
            coder.dictionary = Dictionary::new(degree, rounded.clone())?;
            coder.book = Some(Codebook::new(dim, rounded, costs));
        } else if dim > 0 {
            // A scene without Gaussians still needs one atom to be valid.
            let mut atom = vec![0.0; dim];
            atom[0] = 1.0;
            let rounded = code_dictionary(&mut coder.first, degree, 1, 0, Some(&atom));
            coder.dictionary = Dictionary::new(degree, rounded)?;
        }
        Ok(coder)
    }

    fn learn(
        &self,
        view: View<'_>,
        total: usize,
        options: &PackOptions,
        progress: &dyn Progress,
    ) -> Result<(Vec<f32>, Costs)> {
        let dim = view.splats.degree.rest();
        let sample = SplitMix64::new(options.seed ^ SAMPLE_STREAM).shuffled(view.len()).take(SAMPLE);
        let (rows, classes) = view.scaled(sample, &self.parameters);
        // A promise is cheaper to keep with more atoms than exact rows.
        let fewest = if options.tolerance.is_some() { 2 * dim } else { dim };
        let pay = || (total / GAUSSIANS_PER_ATOM).clamp(fewest, MAX_LEARNED);
        let first = first_atoms(dim, options.atoms.unwrap_or_else(pay), &rows);
        learn(dim, &rows, &classes, first, self.stop, progress)
    }

    /// How finely atoms need be rounded: the larger the values, the more their errors show.
    fn choose_atom_bits(&self, view: View<'_>, rows: &[f32], costs: &Costs) -> u32 {
        let dim = view.splats.degree.rest();
        let n = view.len();
        let book = Codebook::new(dim, rows.to_vec(), costs.clone());
        let stride = n.div_ceil(ATOM_BITS_SAMPLE).max(1);
        let (sample, classes) = view.scaled((0..n).step_by(stride), &self.parameters);
        let codes = book.encode(&sample, &classes, self.stop);
        let (mut sum, mut count) = (0.0_f64, 1.0_f64);
        for i in 0..classes.len() {
            for &(_, value) in codes.row(i) {
                sum += f64::from(value) * f64::from(value);
                count += 1.0;
            }
        }
        let wanted = libm::log2(ATOM_STEPS_PER_VALUE * (1.0 + sum / count).sqrt());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let bits = wanted.round().clamp(4.0, f64::from(MAX_ATOM_BITS)) as u32;
        bits
    }

    /// The codes of all of `view`; none for scenes without SH-rest.
    pub(super) fn codes(&self, view: View<'_>) -> Codes {
        let Some(book) = &self.book else { return Codes::default() };
        let (rows, classes) = view.scaled(0..view.len(), &self.parameters);
        book.encode(&rows, &classes, self.stop)
    }

    /// Codes a chunk, all of `view`.
    pub(super) fn record(&self, view: View<'_>, codes: &Codes) -> Chunk {
        let (parameters, dictionary) = (&self.parameters, &self.dictionary);
        let dim = dictionary.dim();
        let mut walk = ChunkCodec::new(parameters, dim);
        let mut chunk = Chunk { tally: Tally::new(dim), ..Chunk::default() };
        let tally = &mut chunk.tally;
        let mut values: Vec<(u16, f16)> = Vec::new();
        let mut rebuilt = vec![0.0_f32; dim];
        for i in 0..view.len() {
            let placed = view.scene[i];
            let g = canonical(&view.splats.geometry, placed.index());
            let classes = view.classes[i];
            let row = view.row(i);
            let mut code = Code::Atoms(if dim > 0 { codes.row(i) } else { &[] });
            if let Code::Atoms(pairs) = code
                && dim > 0
            {
                resident(pairs, parameters.value_step(classes[0]), &mut values);
                let pairs = values.iter().map(|&(atom, value)| (usize::from(atom), value.to_f32()));
                reconstruct(dictionary, pairs, &mut rebuilt);
                let squares = row.iter().zip(&rebuilt).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
                let error = squares.sum::<f64>().sqrt();
                let storable = values.iter().all(|v| v.1.is_finite());
                let most = self.tolerance.unwrap_or(MAX_ERROR).min(MAX_ERROR);
                if !storable || error > most {
                    code = Code::Exact(row);
                    tally.escapes += 1;
                } else {
                    tally.max_error = tally.max_error.max(error);
                    tally.squared_error += error * error;
                    tally.nonzeros += values.len() as u64;
                    tally.histogram[values.len().min(dim)] += 1;
                }
            }
            let target = GaussianValues {
                cell: placed.cell,
                classes,
                scales: g.scales,
                axes: g.axes,
                position: g.position,
                log_opacity: g.log_opacity,
                dc: parameters.dc_coordinates(g.dc),
                code,
            };
            chunk.impossible |= walk.step(&mut chunk.recorder, Some(&target)).is_none();
        }
        chunk
    }
}

/// One chunk recorded, with what it adds to the report.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pub(super) recorder: SymbolEncoder,
    pub(super) tally: Tally,
    /// A decoder would refuse it.
    impossible: bool,
}

impl Chunk {
    /// Adds the chunk to what is known of the file, and returns its symbols.
    pub(super) fn count(self, tally: &mut Tally, histograms: &mut [Histogram]) -> Result<SymbolEncoder> {
        if self.impossible {
            return Err(too_large());
        }
        tally.add(&self.tally);
        self.recorder.count(histograms);
        Ok(self.recorder)
    }
}

/// No symbols yet, of any stream in any context.
pub(super) fn no_symbols() -> Vec<Histogram> {
    vec![Histogram::default(); Stream::ALL.len() * CONTEXTS]
}

/// The tables for what was counted.
pub(super) fn tables(histograms: &[Histogram]) -> Result<Tables> {
    Tables::new(histograms).ok_or_else(|| Error::parameter("tables", "none", "fewer symbols"))
}

/// Length of a part of a chunk as the file has it.
pub(super) fn length(part: &[u8]) -> Result<u32> {
    u32::try_from(part.len()).map_err(|_| Error::parameter("chunk", part.len(), "parts of less than 4 GiB"))
}

/// What is counted while coding.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    histogram: Vec<u64>,
    escapes: u64,
    max_error: f64,
    squared_error: f64,
    nonzeros: u64,
}

impl Tally {
    pub(super) fn new(dim: usize) -> Self {
        Self { histogram: vec![0; dim + 1], ..Self::default() }
    }

    pub(super) fn add(&mut self, part: &Self) {
        self.histogram.iter_mut().zip(&part.histogram).for_each(|(a, b)| *a += b);
        self.escapes += part.escapes;
        self.max_error = self.max_error.max(part.max_error);
        self.squared_error += part.squared_error;
        self.nonzeros += part.nonzeros;
    }

    /// What is recorded and reported of `gaussians` Gaussians; `seconds` are those of learning and coding.
    pub(super) fn into_report(
        self,
        options: &PackOptions,
        gaussians: usize,
        seconds: [f64; 2],
    ) -> (Record, PackReport) {
        let count = gaussians.max(1) as f64;
        let dim = self.histogram.len() as u64 - 1;
        let record = Record {
            tolerance: options.tolerance,
            max_nonzeros: None,
            pursuit: Pursuit::Omp,
            seed: options.seed,
            layout: Layout::Packed,
            max_residual: self.max_error,
            rms_residual: (self.squared_error / count).sqrt(),
            over_tolerance: 0,
        };
        let report = PackReport {
            mean_nonzeros: (self.nonzeros + self.escapes * dim) as f64 / count,
            nonzero_histogram: self.histogram,
            escapes: self.escapes,
            learn_seconds: seconds[0],
            code_seconds: seconds[1],
        };
        (record, report)
    }
}

fn too_large() -> Error {
    Error::parameter("values", "too large", "positions and colours whose sums f32 can hold")
}
