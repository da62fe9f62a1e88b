//! From a scene to a packed file.

use half::f16;

use super::CHUNK;
use super::canonical::{Grid, Placed, canonical, placed};
use super::codebook::{Codebook, Codes, Costs, Until, learn};
use super::entropy::{CONTEXTS, Histogram, Tables};
use super::fit::Fit;
use super::parameters::Parameters;
use super::restore::gather;
use super::stream::{Recorder, Stream};
use super::unpack::{MAX_ATOM_BITS, Packed, dictionary_walk, resident};
use super::walk::{Code, Target, Walk};
use crate::codes::reconstruct;
use crate::dictionary::Dictionary;
use crate::error::{Error, Result};
use crate::limits::{Limits, MAX_ATOMS};
use crate::model::{Layout, Pursuit, Record};
use crate::parallel::map_chunks;
use crate::progress::{Progress, Stage};
use crate::rng::SplitMix64;
use crate::sensitivity::Sensitivity;
use crate::splats::{Splats, for_extra};
use crate::stopwatch::Stopwatch;

/// Rows to learn a dictionary from at most.
const SAMPLE: usize = 24_576;
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
/// Expected PSNR at an overall step of [`EXPECTED_STEP`] over the root of the number of Gaussians, how it
/// grows as the step halves, and by how much faster: fitted to held-out views of the models measured in
/// docs/METHOD.md, which it misses by up to 3 dB.
const EXPECTED_DB: f64 = 40.0;
const EXPECTED_STEP: f64 = 2.3e-3;
const DB_PER_OCTAVE: f64 = 4.5;
const DB_PER_OCTAVE_2: f64 = 0.15;
/// Better than this nothing is expected to become.
const MOST_DB: f64 = 100.0;
/// A code whose error is above this, the largest f16, is no code, promise or not: the row is stored exactly.
const MAX_ERROR: f64 = 65_504.0;
/// Mixed into the seed of the sample.
const SAMPLE_STREAM: u64 = 0x70_61_63_6b;

/// How to pack.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct PackOptions {
    /// Promise: un-squared L2 norm that no Gaussian's SH-rest error may exceed. Default none: SH are
    /// then as exact as pictures need.
    pub tolerance: Option<f64>,
    /// Atoms to learn, 1 to 1024; `None` for as many as the scene pays for.
    pub atoms: Option<usize>,
    /// Keep each Gaussian's index in the source.
    pub keep_order: bool,
    /// Seed of the learning sample.
    pub seed: u64,
}

/// What packing did.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct PackReport {
    /// Mean nonzeros a Gaussian, an escape counting as a full row.
    pub mean_nonzeros: f64,
    /// Gaussians by number of nonzeros; escapes not among them.
    pub nonzero_histogram: Vec<u64>,
    /// Gaussians whose SH are stored exactly.
    pub escapes: u64,
    /// Seconds spent learning (0 where there is no clock).
    pub learn_seconds: f64,
    /// Seconds spent on everything else.
    pub code_seconds: f64,
}

/// A scene prepared for packing at any quality.
#[derive(Debug)]
pub struct Packer<'a> {
    splats: &'a Splats,
    options: PackOptions,
    scene: Vec<Placed>,
    fit: Fit,
}

impl<'a> Packer<'a> {
    /// Prepares `splats`, of whose values pictures depend as `sensitivity` says.
    ///
    /// # Errors
    /// [`Error::Parameter`] for options out of range, arrays of different lengths, or values or weights that
    /// are not finite.
    pub fn new(splats: &'a Splats, sensitivity: &Sensitivity, options: &PackOptions) -> Result<Self> {
        splats.validate()?;
        Limits::check("Gaussians", splats.len() as u64, Limits::default().gaussians)?;
        let weights = [
            (sensitivity.colour.len(), sensitivity.colour.as_slice()),
            (sensitivity.opacity.len(), &sensitivity.opacity),
            (sensitivity.position.len(), sensitivity.position.as_flattened()),
            (sensitivity.scale.len(), sensitivity.scale.as_flattened()),
            (sensitivity.rotation.len(), sensitivity.rotation.as_flattened()),
        ];
        for (len, values) in weights {
            if len != splats.len() {
                let expected = format!("{} entries, one a Gaussian", splats.len());
                return Err(Error::parameter("sensitivity", len, expected));
            }
            if let Some(value) = values.iter().find(|v| !v.is_finite()) {
                return Err(Error::parameter("sensitivity", value, "finite values"));
            }
        }
        if let Some(atoms) = options.atoms
            && !(1..=MAX_ATOMS).contains(&atoms)
        {
            return Err(Error::parameter("atoms", atoms, format!("1 to {MAX_ATOMS}")));
        }
        if let Some(tol) = options.tolerance
            && (!tol.is_finite() || tol <= 0.0)
        {
            return Err(Error::parameter("tol", tol, "a finite number above 0"));
        }
        let g = &splats.geometry;
        let arrays: [(&str, &[f32]); 6] = [
            ("positions", g.positions.as_flattened()),
            ("dc", g.dc.as_flattened()),
            ("opacities", &g.opacities),
            ("scales", g.scales.as_flattened()),
            ("rotations", g.rotations.as_flattened()),
            ("sh_rest", &splats.sh_rest),
        ];
        for (name, values) in arrays {
            if let Some(k) = values.iter().position(|v| !v.is_finite()) {
                return Err(Error::parameter(name, values[k], "finite values"));
            }
        }
        let grid = Grid::fit(&g.positions);
        let scene = placed(g, &grid);
        let fit = Fit::new(g, sensitivity, &scene, &grid);
        Ok(Self { splats, options: options.clone(), scene, fit })
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.scene.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.scene.is_empty()
    }

    /// The overall step that pictures of about this PSNR, in dB, are expected of: errors of all Gaussians
    /// add up, so it falls with the root of their number.
    #[must_use]
    pub fn step_for(&self, decibels: f64) -> f64 {
        // decibels = EXPECTED_DB + DB_PER_OCTAVE x + DB_PER_OCTAVE_2 x^2, with x the octaves below.
        let over = decibels.clamp(0.0, MOST_DB) - EXPECTED_DB;
        let root = (DB_PER_OCTAVE * DB_PER_OCTAVE + 4.0 * DB_PER_OCTAVE_2 * over).max(0.0).sqrt();
        let octaves = (root - DB_PER_OCTAVE) / (2.0 * DB_PER_OCTAVE_2);
        EXPECTED_STEP * libm::exp2(-octaves) / (self.len().max(1) as f64).sqrt()
    }

    /// Packs with an overall step: roughly, the root of the mean squared error of pictures that each
    /// value of each Gaussian may make on its own. Half the step is about 5 dB better.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `step` is not finite and above 0, or values are so large that sums of them
    /// leave f32.
    pub fn pack(&self, step: f64, progress: &dyn Progress) -> Result<(Packed, PackReport)> {
        if !step.is_finite() || step <= 0.0 {
            return Err(Error::parameter("step", step, "a finite number above 0"));
        }
        let clock = Stopwatch::start();
        let mut parameters = self.fit.with_step(step);
        #[expect(clippy::cast_possible_truncation, reason = "a step is f32")]
        if let Some(tol) = self.options.tolerance {
            let step = tol * VALUE_STEP_PER_TOLERANCE;
            parameters.promised = step.clamp(f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX)) as f32;
        }
        if Parameters::from_list(&parameters.to_list()).is_none() {
            return Err(too_large());
        }
        let degree = self.splats.degree;
        let dim = degree.rest();
        let until = match self.options.tolerance {
            #[expect(clippy::cast_possible_truncation, reason = "a share of the tolerance, in steps")]
            Some(_) => Until::Error((1.0 / VALUE_STEP_PER_TOLERANCE).powi(2) as f32 * TOLERANCE_SHARE),
            None => Until::Balanced,
        };
        let mut first = Recorder::default();
        let mut dictionary = Dictionary::empty();
        let mut codes = None;
        let mut atom_bits = 0;
        if dim > 0 && !self.scene.is_empty() {
            let (rows, costs) = self.learn(&parameters, until, progress);
            atom_bits = self.atom_bits(&rows, &costs, &parameters, until);
            let atoms = rows.len() / dim;
            let rounded = dictionary_walk(&mut first, degree, atoms, atom_bits, Some(&rows));
            dictionary = Dictionary::new(degree, rounded.clone())?;
            let book = Codebook::new(dim, rounded, costs);
            codes = Some(self.code(&book, &parameters, until, progress));
        } else if dim > 0 {
            // A scene without Gaussians still needs one atom to be valid.
            let mut atom = vec![0.0; dim];
            atom[0] = 1.0;
            let rounded = dictionary_walk(&mut first, degree, 1, 0, Some(&atom));
            dictionary = Dictionary::new(degree, rounded)?;
        }
        let learn_seconds = clock.seconds();
        let clock = Stopwatch::start();
        // Twice: once to count what the tables are made of, once to code. To keep all symbols in between
        // would take more memory than the scene's geometry.
        let n = self.scene.len();
        let record = |range| self.chunk(range, &parameters, &dictionary, codes.as_ref());
        let chunks = map_chunks(n, CHUNK, |range| {
            let mut chunk = record(range);
            let mut histograms = vec![Histogram::default(); Stream::ALL.len() * CONTEXTS];
            std::mem::take(&mut chunk.recorder).count(&mut histograms);
            (chunk, histograms)
        });
        let mut histogram = vec![0_u64; dim + 1];
        let (mut escapes, mut max_error, mut squared, mut nonzeros) = (0_u64, 0.0_f64, 0.0_f64, 0_u64);
        let mut histograms = vec![Histogram::default(); Stream::ALL.len() * CONTEXTS];
        first.count(&mut histograms);
        for (chunk, counted) in chunks {
            for (sum, histogram) in histograms.iter_mut().zip(&counted) {
                sum.merge(histogram);
            }
            for (a, b) in histogram.iter_mut().zip(&chunk.histogram) {
                *a += b;
            }
            escapes += chunk.escapes;
            max_error = max_error.max(chunk.max_error);
            squared += chunk.squared_error;
            nonzeros += chunk.nonzeros;
            if chunk.impossible {
                return Err(too_large());
            }
        }
        let tables =
            Tables::new(&histograms).ok_or_else(|| Error::parameter("tables", "none", "fewer symbols"))?;
        let mut parts = vec![first.finish(&tables)];
        parts.extend(map_chunks(n, CHUNK, |range| record(range).recorder.finish(&tables)));
        let mut lengths = Vec::with_capacity(2 * parts.len());
        let mut data = Vec::new();
        for part in parts.iter().flatten() {
            lengths.push(
                u32::try_from(part.len())
                    .map_err(|_| Error::parameter("chunk", part.len(), "parts of less than 4 GiB"))?,
            );
            data.extend_from_slice(part);
        }
        let count = n.max(1) as f64;
        let packed = Packed {
            degree,
            gaussians: n,
            atoms: dictionary.len(),
            atom_bits,
            record: Record {
                tolerance: self.options.tolerance,
                max_nonzeros: None,
                pursuit: Pursuit::Omp,
                seed: self.options.seed,
                layout: Layout::Packed,
                max_residual: max_error,
                rms_residual: (squared / count).sqrt(),
                over_tolerance: 0,
            },
            meta: self.splats.meta.clone(),
            extras: self.extras(),
            order: self.options.keep_order.then(|| self.scene.iter().map(|g| g.source).collect()),
            promise: None,
            drawn_on: None,
            parameters: parameters.to_list(),
            tables: tables.write(),
            lengths,
            data,
        };
        let report = PackReport {
            mean_nonzeros: (nonzeros + escapes * dim as u64) as f64 / count,
            nonzero_histogram: histogram,
            escapes,
            learn_seconds,
            code_seconds: clock.seconds(),
        };
        Ok((packed, report))
    }

    fn row(&self, i: usize) -> &[f32] {
        self.splats.rest(self.scene[i].index())
    }

    /// The rows of Gaussians `indices` in units of their value steps, and their colour classes.
    fn scaled(&self, indices: impl Iterator<Item = usize>, parameters: &Parameters) -> (Vec<f32>, Vec<u8>) {
        let mut rows = Vec::new();
        let mut classes = Vec::new();
        for i in indices {
            let class = self.fit.classes[i][0];
            let inverse = 1.0 / parameters.value_step(class);
            rows.extend(self.row(i).iter().map(|x| x * inverse));
            classes.push(class);
        }
        (rows, classes)
    }

    fn learn(&self, parameters: &Parameters, until: Until, progress: &dyn Progress) -> (Vec<f32>, Costs) {
        let dim = self.splats.degree.rest();
        let n = self.scene.len();
        let sample = SplitMix64::new(self.options.seed ^ SAMPLE_STREAM).shuffled(n).take(SAMPLE);
        let (rows, classes) = self.scaled(sample, parameters);
        // A promise is cheaper to keep with more atoms than exact rows.
        let fewest = if self.options.tolerance.is_some() { 2 * dim } else { dim };
        let atoms = self.options.atoms.unwrap_or_else(|| (n / GAUSSIANS_PER_ATOM).clamp(fewest, MAX_LEARNED));
        let first = first_atoms(dim, atoms, &rows);
        progress.begin(Stage::Learn, super::codebook::ROUNDS as u64);
        let learned = learn(dim, &rows, &classes, first, until, &mut || progress.advance(1));
        progress.end();
        learned
    }

    /// How finely atoms need be rounded: the larger the values, the more their errors show.
    fn atom_bits(&self, rows: &[f32], costs: &Costs, parameters: &Parameters, until: Until) -> u32 {
        let dim = self.splats.degree.rest();
        let n = self.scene.len();
        let book = Codebook::new(dim, rows.to_vec(), costs.clone());
        let stride = n.div_ceil(super::codebook::CHUNK).max(1);
        let (sample, classes) = self.scaled((0..n).step_by(stride), parameters);
        let codes = book.encode(&sample, &classes, until);
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

    fn code(
        &self,
        book: &Codebook,
        parameters: &Parameters,
        until: Until,
        progress: &dyn Progress,
    ) -> Vec<Codes> {
        let n = self.scene.len();
        progress.begin(Stage::Code, n as u64);
        let codes = (0..n.div_ceil(CHUNK)).map(|c| {
            let range = c * CHUNK..((c + 1) * CHUNK).min(n);
            let done = range.len() as u64;
            let (rows, classes) = self.scaled(range, parameters);
            let codes = book.encode(&rows, &classes, until);
            progress.advance(done);
            codes
        });
        let codes = codes.collect();
        progress.end();
        codes
    }

    fn chunk(
        &self,
        range: std::ops::Range<usize>,
        parameters: &Parameters,
        dictionary: &Dictionary,
        codes: Option<&Vec<Codes>>,
    ) -> Chunk {
        let dim = dictionary.dim();
        let codes = codes.and_then(|codes| codes.get(range.start / CHUNK));
        let mut walk = Walk::new(parameters, dim);
        let mut chunk = Chunk { histogram: vec![0; dim + 1], ..Chunk::default() };
        let mut values: Vec<(u16, f16)> = Vec::new();
        let mut rebuilt = vec![0.0_f32; dim];
        for i in range.clone() {
            let placed = self.scene[i];
            let g = canonical(&self.splats.geometry, placed.index());
            let classes = self.fit.classes[i];
            let row = self.row(i);
            let mut code = Code::Atoms(codes.map_or(&[], |c| c.row(i - range.start)));
            if let Code::Atoms(pairs) = code
                && dim > 0
            {
                resident(pairs, parameters.value_step(classes[0]), &mut values);
                let pairs = values.iter().map(|&(atom, value)| (usize::from(atom), value.to_f32()));
                reconstruct(dictionary, pairs, &mut rebuilt);
                let squares = row.iter().zip(&rebuilt).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
                let error = squares.sum::<f64>().sqrt();
                let storable = values.iter().all(|v| v.1.is_finite());
                let most = self.options.tolerance.unwrap_or(MAX_ERROR).min(MAX_ERROR);
                if !storable || error > most {
                    code = Code::Exact(row);
                    chunk.escapes += 1;
                } else {
                    chunk.max_error = chunk.max_error.max(error);
                    chunk.squared_error += error * error;
                    chunk.nonzeros += values.len() as u64;
                    chunk.histogram[values.len().min(dim)] += 1;
                }
            }
            let target = Target {
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

    fn extras(&self) -> Vec<crate::splats::Extra> {
        let mut extras = self.splats.geometry.extras.clone();
        for extra in &mut extras {
            for_extra!(&mut extra.values, v => gather(v, self.scene.iter().map(|g| g.index())));
        }
        extras
    }
}

/// One chunk recorded, with what it adds to the report.
#[derive(Default)]
struct Chunk {
    recorder: Recorder,
    histogram: Vec<u64>,
    escapes: u64,
    max_error: f64,
    squared_error: f64,
    nonzeros: u64,
    /// A decoder would refuse it.
    impossible: bool,
}

fn too_large() -> Error {
    Error::parameter("values", "too large", "positions and colours whose sums f32 can hold")
}

/// Atoms to start learning from: principal axes, then rows of the sample.
fn first_atoms(dim: usize, atoms: usize, rows: &[f32]) -> Vec<f32> {
    let mut out = Vec::with_capacity(atoms * dim);
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
    for axis in crate::learn::principal_axes(dim, rows).iter().take(atoms / 2) {
        out.extend(axis.iter().map(|&x| x as f32));
    }
    let mut rows = rows.chunks_exact(dim);
    while out.len() < atoms * dim {
        let Some(row) = rows.next() else { break };
        let norm = row.iter().map(|x| x * x).sum::<f32>().sqrt();
        if norm > 1.0 && norm.is_finite() {
            out.extend(row.iter().map(|x| x / norm));
        }
    }
    let mut axis = 0;
    while out.len() < atoms * dim {
        out.extend((0..dim).map(|d| if d == axis % dim { 1.0 } else { 0.0 }));
        axis += 1;
    }
    out
}
