//! From a scene to a packed file.

use super::CHUNK;
use super::canonical::{Grid, MortonKey, placed};
use super::codebook::Codes;
use super::coder::{ChunkCoder, Tally, View, length, no_symbols, tables};
use super::fit::Fit;
use super::reorder::gather;
use super::unpack::Packed;
use crate::scene::sensitivity::Sensitivity;
use crate::scene::splats::{Splats, all_finite, for_extra};
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_ATOMS, MAX_GAUSSIANS};
use crate::support::parallel::map_chunks;
use crate::support::progress::{Progress, Stage};
use crate::support::stopwatch::Stopwatch;

/// Expected PSNR at an overall step of [`EXPECTED_STEP`] over the root of the number of Gaussians, how it
/// grows as the step halves, and by how much faster: fitted to held-out views of the models measured in
/// docs/METHOD.md, which it misses by up to 3 dB.
const EXPECTED_DB: f64 = 40.0;
const EXPECTED_STEP: f64 = 2.3e-3;
const DB_PER_OCTAVE: f64 = 4.5;
const DB_PER_OCTAVE_2: f64 = 0.15;
/// Better than this nothing is expected to become.
const MOST_DB: f64 = 100.0;
/// How to pack.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct PackOptions {
    /// The promised un-squared L2 norm that no Gaussian's SH-rest error may exceed. Default none: SH are
    /// then as exact as pictures need.
    pub tolerance: Option<f64>,
    /// Atoms to learn, 1 to 1024; `None` for as many as the scene pays for.
    pub atoms: Option<usize>,
    /// Keep each Gaussian's index in the source.
    pub keep_order: bool,
    /// Seed of the learning sample.
    pub seed: u64,
}

impl PackOptions {
    /// Refuses what is out of range.
    pub(crate) fn check(&self) -> Result<()> {
        if let Some(atoms) = self.atoms
            && !(1..=MAX_ATOMS).contains(&atoms)
        {
            return Err(Error::parameter("atoms", atoms, format!("1 to {MAX_ATOMS}")));
        }
        if let Some(tol) = self.tolerance
            && (!tol.is_finite() || tol <= 0.0)
        {
            return Err(Error::parameter("tolerance", tol, "a finite number above 0"));
        }
        Ok(())
    }
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
    scene: Vec<MortonKey>,
    fit: Fit,
}

impl<'a> Packer<'a> {
    /// Prepares `splats`, of whose values pictures depend as `sensitivity` says.
    ///
    /// # Errors
    /// [`Error::Parameter`] for options out of range, arrays of different lengths, or values or weights that
    /// are not finite.
    pub fn new(splats: &'a Splats, sensitivity: &Sensitivity, options: &PackOptions) -> Result<Self> {
        check(splats, sensitivity)?;
        options.check()?;
        let g = &splats.geometry;
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
        expected_step(self.len(), decibels)
    }

    /// Packs with an overall step: roughly, the root of the mean squared error of pictures that each
    /// value of each Gaussian may make on its own. Half the step is about 5 dB better.
    ///
    /// # Errors
    /// [`Error::Parameter`] if `step` is not finite and above 0, or values are so large that sums of them
    /// leave f32.
    pub fn pack(&self, step: f64, progress: &dyn Progress) -> Result<(Packed, PackReport)> {
        let clock = Stopwatch::start();
        let n = self.len();
        let view = View { splats: self.splats, scene: &self.scene, classes: &self.fit.classes };
        let mut coder = ChunkCoder::new(view, n, &self.fit, step, &self.options, progress)?;
        let first = std::mem::take(&mut coder.first);
        progress.begin(Stage::Code, n as u64);
        let codes = (0..n.div_ceil(CHUNK)).map(|c| {
            let part = view.part(c * CHUNK..n.min((c + 1) * CHUNK));
            let codes = coder.codes(part);
            progress.advance(part.scene.len() as u64);
            codes
        });
        let codes: Vec<Codes> = codes.collect();
        progress.end();
        let learn_seconds = clock.seconds();
        let clock = Stopwatch::start();
        // Twice: once to count what the tables are made of, once to code. To keep all symbols in between
        // would take more memory than the scene's geometry.
        let record = |range: std::ops::Range<usize>| {
            let codes = &codes[range.start / CHUNK];
            coder.record(view.part(range), codes)
        };
        let chunks = map_chunks(n, CHUNK, |range| {
            let mut tally = Tally::new(coder.dictionary.dim());
            let mut histograms = no_symbols();
            record(range).count(&mut tally, &mut histograms).map(|_| (tally, histograms))
        });
        let mut tally = Tally::new(coder.dictionary.dim());
        let mut histograms = no_symbols();
        first.count(&mut histograms);
        for chunk in chunks {
            let (counted, symbols) = chunk?;
            tally.add(&counted);
            histograms.iter_mut().zip(&symbols).for_each(|(sum, more)| sum.merge(more));
        }
        let tables = tables(&histograms)?;
        let mut parts = vec![first.finish(&tables)];
        parts.extend(map_chunks(n, CHUNK, |range| record(range).recorder.finish(&tables)));
        let mut lengths = Vec::with_capacity(2 * parts.len());
        let mut data = Vec::new();
        for part in parts.iter().flatten() {
            lengths.push(length(part)?);
            data.extend_from_slice(part);
        }
        let (record, report) = tally.into_report(&self.options, n, [learn_seconds, clock.seconds()]);
        let packed = Packed {
            degree: self.splats.degree,
            gaussians: n,
            atoms: coder.dictionary.len(),
            atom_bits: coder.atom_bits,
            record,
            meta: self.splats.meta.clone(),
            extras: self.extras(),
            order: self.options.keep_order.then(|| self.scene.iter().map(|g| g.source).collect()),
            target: None,
            device: None,
            parameters: coder.parameters.to_list(),
            tables: tables.write(),
            lengths,
            data,
            limits: Limits::default(),
        };
        Ok((packed, report))
    }

    fn extras(&self) -> Vec<crate::scene::splats::Extra> {
        let mut extras = self.splats.geometry.extras.clone();
        for extra in &mut extras {
            for_extra!(&mut extra.values, v => gather(v, self.scene.iter().map(|g| g.index())));
        }
        extras
    }
}

/// [`Packer::step_for`] of a scene of `gaussians` Gaussians.
pub(super) fn expected_step(gaussians: usize, decibels: f64) -> f64 {
    // decibels = EXPECTED_DB + DB_PER_OCTAVE x + DB_PER_OCTAVE_2 x^2, with x the octaves below.
    let over = decibels.clamp(0.0, MOST_DB) - EXPECTED_DB;
    let root = (DB_PER_OCTAVE * DB_PER_OCTAVE + 4.0 * DB_PER_OCTAVE_2 * over).max(0.0).sqrt();
    let octaves = (root - DB_PER_OCTAVE) / (2.0 * DB_PER_OCTAVE_2);
    EXPECTED_STEP * libm::exp2(-octaves) / (gaussians.max(1) as f64).sqrt()
}

/// Refuses scenes and sensitivities that do not go together or are not finite.
pub(crate) fn check(splats: &Splats, sensitivity: &Sensitivity) -> Result<()> {
    splats.validate()?;
    Limits::check("Gaussians", splats.len() as u64, MAX_GAUSSIANS)?;
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
        all_finite([("sensitivity", values)])?;
    }
    let g = &splats.geometry;
    all_finite([
        ("positions", g.positions.as_flattened()),
        ("dc", g.dc.as_flattened()),
        ("opacities", &g.opacities),
        ("scales", g.scales.as_flattened()),
        ("rotations", g.rotations.as_flattened()),
        ("sh_rest", splats.sh_rest.as_slice()),
    ])
}
