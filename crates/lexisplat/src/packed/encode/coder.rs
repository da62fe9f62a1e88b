//! Coding of one chunk, and the parameters and the dictionary with which all chunks of a file are coded.

use half::f16;

use super::appearance::{Appearance, AppearanceChange};
use super::canonical::canonical;
use super::codebook::{Choice, Codebook, Codes, Costs, StopRule, choose, first_atoms, learn};
use super::options::PackOptions;
use crate::packed::bitstream::coded_gaussian::CodedGaussian;
use crate::packed::bitstream::parameters::{ColourAndShape, Parameters};
use crate::packed::bitstream::{PointsOfView, WholeAtoms, morton, seen_row};
use crate::packed::curve::MortonKey;
use crate::scene::sh::ShDegree;
use crate::scene::splats::Splats;
use crate::sparse::codes::reconstruct;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::learn::unit_axis;
use crate::sparse::tally::Tally;
use crate::support::error::{Error, Result};
use crate::support::progress::Progress;

/// Largest number of rows that a dictionary is learned from.
pub(in crate::packed) const SAMPLE: usize = 24_576;
/// Largest number of rows that decide how finely atoms are rounded.
const ATOM_BITS_SAMPLE: usize = 2048;
/// Number of Gaussians that justify one more atom.
const GAUSSIANS_PER_ATOM: usize = 64;
/// Largest number of atoms that are learned by default. One byte can hold their indices. Files without the fixed atoms have
/// at least as many learned atoms as a row has coefficients, since fewer do not span the rows.
const MAX_LEARNED: usize = 256;
/// A scene that justifies fewer atoms than this times the coefficients of a row chooses among several numbers of atoms.
const CHOICE: usize = 2;
/// Index of the step of SH values among the factors of [`Parameters`].
pub(in crate::packed) const VALUES: usize = 1;
/// Largest `k` of the steps `2^-k` of atoms' coefficients.
const MAX_ATOM_BITS: u32 = 14;
/// Number of rounding steps of an atom's coefficient in one value step, for each step of the root mean square of values.
const ATOM_STEPS_PER_VALUE: f64 = 10.0;
/// Step of SH values as a share of a promised tolerance.
const VALUE_STEP_PER_TOLERANCE: f64 = 0.35;
/// Share of the squared tolerance that the pursuit may use. Rounding to f16 takes up to the rest.
const TOLERANCE_SHARE: f32 = 0.995;
/// Largest error of a code: the largest f16. A row whose code has a larger error is stored exactly, also without a promised
/// tolerance.
const MAX_ERROR: f64 = 65_504.0;
/// Mixed into the seed of the sample.
pub(in crate::packed) const SAMPLE_STREAM: u64 = 0x70_61_63_6b;

/// Gaussians in the order of a packed file.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct OrderedGaussians<'a> {
    pub(in crate::packed) splats: &'a Splats,
    /// The index in `splats`, and the cell, of each Gaussian.
    pub(in crate::packed) keys: &'a [MortonKey],
    /// The classes of each Gaussian of `keys`.
    pub(in crate::packed) classes: &'a [ColourAndShape<u8>],
    /// The appearance of each Gaussian of `keys`, instead of the base colours and opacities of `splats`.
    pub(in crate::packed) appearances: Option<&'a [Appearance]>,
    /// The interim change of each Gaussian of the first layer, in addition to its growth.
    pub(in crate::packed) changes: Option<&'a [AppearanceChange]>,
}

impl<'a> OrderedGaussians<'a> {
    /// Creates a list of Gaussians with their own base colours and opacities, without interim changes.
    pub(in crate::packed) fn new(
        splats: &'a Splats,
        keys: &'a [MortonKey],
        classes: &'a [ColourAndShape<u8>],
    ) -> Self {
        Self { splats, keys, classes, appearances: None, changes: None }
    }

    /// Returns the Gaussians `rows`. `changes` stays whole, so it is indexed from the first Gaussian of the file.
    pub(in crate::packed) fn slice(self, rows: std::ops::Range<usize>) -> Self {
        Self {
            splats: self.splats,
            keys: &self.keys[rows.clone()],
            classes: &self.classes[rows.clone()],
            appearances: self.appearances.map(|all| &all[rows.clone()]),
            changes: self.changes,
        }
    }

    pub(in crate::packed) fn len(self) -> usize {
        self.keys.len()
    }

    fn row(self, i: usize) -> &'a [f32] {
        self.splats.rest(self.keys[i].index())
    }

    /// Returns the rows of the Gaussians `indices` in units of their value steps, and their colour classes.
    pub(in crate::packed) fn scaled(
        self,
        indices: impl Iterator<Item = usize>,
        parameters: &Parameters,
    ) -> (Vec<f32>, Vec<u8>) {
        let mut rows = Vec::new();
        let mut classes = Vec::new();
        for i in indices {
            let class = self.classes[i].colour;
            let inverse = 1.0 / parameters.value_step(class);
            rows.extend(self.row(i).iter().map(|x| x * inverse));
            classes.push(class);
        }
        (rows, classes)
    }
}

/// The parameters and the dictionary with which all chunks are coded.
#[derive(Debug, Clone)]
pub(in crate::packed) struct ChunkCoder {
    pub(in crate::packed) parameters: Parameters,
    pub(in crate::packed) dictionary: Dictionary,
    pub(in crate::packed) points_of_view: PointsOfView,
    book: Option<Codebook>,
    stop: StopRule,
    tolerance: Option<f64>,
}

impl ChunkCoder {
    /// Creates a coder of learned `atoms`. `costs` are the costs of symbols.
    pub(in crate::packed) fn learned(
        parameters: Parameters,
        points_of_view: PointsOfView,
        atoms: &WholeAtoms,
        costs: Costs,
        stop: StopRule,
        tolerance: Option<f64>,
    ) -> Result<Self> {
        let degree = atoms.degree();
        let dim = degree.rest();
        let rows = atoms.rows();
        let book = (dim > 0).then(|| Codebook::new(dim, rows.clone(), costs));
        let dictionary = if dim > 0 { Dictionary::new(degree, rows)? } else { Dictionary::empty() };
        Ok(Self { parameters, dictionary, points_of_view, book, stop, tolerance })
    }

    /// Returns the codes of `gaussians`; none for scenes without SH-rest.
    pub(in crate::packed) fn codes(&self, gaussians: OrderedGaussians<'_>) -> Codes {
        let Some(book) = &self.book else { return Codes::default() };
        let (rows, classes) = gaussians.scaled(0..gaussians.len(), &self.parameters);
        book.encode(&rows, &classes, self.stop)
    }

    /// Returns the targets of `gaussians`, and counts of their codes. Base colours are in units of `dc_unit`.
    pub(in crate::packed) fn targets(
        &self,
        gaussians: OrderedGaussians<'_>,
        codes: &Codes,
        dc_unit: f64,
    ) -> Result<(Tally, Vec<CodedGaussian>)> {
        let (parameters, dictionary) = (&self.parameters, &self.dictionary);
        let dim = dictionary.dim();
        let mut tally = Tally::new(dim);
        let mut values: Vec<(u16, f16)> = Vec::new();
        let mut rebuilt = vec![0.0_f32; dim];
        let mut targets = Vec::with_capacity(gaussians.len());
        for i in 0..gaussians.len() {
            let placed = gaussians.keys[i];
            let mut form = canonical(&gaussians.splats.geometry, placed.index());
            if let Some(appearances) = gaussians.appearances {
                let Appearance { dc, log_opacity } = appearances[i];
                (form.dc, form.log_opacity) = (dc, log_opacity);
            }
            let classes = gaussians.classes[i];
            let centre = parameters.centre(morton::decode(placed.cell).unwrap_or_default());
            let mut shown = [0.0; 3];
            let (mut code, mut exact) = (Vec::new(), Vec::new());
            if dim > 0 {
                resident(codes.row(i), parameters.value_step(classes.colour), &mut values);
                let pairs = values.iter().map(|&(atom, value)| (usize::from(atom), value.to_f32()));
                reconstruct(dictionary, pairs, &mut rebuilt);
                let row = gaussians.row(i);
                let squares = row.iter().zip(&rebuilt).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
                let error = squares.sum::<f64>().sqrt();
                let storable = values.iter().all(|v| v.1.is_finite());
                if storable && error <= self.tolerance.unwrap_or(MAX_ERROR).min(MAX_ERROR) {
                    code = codes.row(i).to_vec();
                    tally.code(values.len(), error, None);
                } else {
                    exact = row.to_vec();
                    tally.escapes += 1;
                }
                if !self.points_of_view.points.is_empty() {
                    let weights = self.points_of_view.weights(dictionary.degree(), form.position);
                    let weights = weights.get(..dictionary.degree().rest_per_channel()).unwrap_or_default();
                    shown = seen_row(if exact.is_empty() { &rebuilt } else { &exact }, weights);
                }
            }
            form.dc = std::array::from_fn(|c| form.dc[c] + shown[c]);
            let mut target = form.coded(placed.cell, centre, classes, parameters, dc_unit);
            (target.code, target.exact) = (code, exact);
            targets.push(target);
        }
        Ok((tally, targets))
    }
}

/// The task of learning a dictionary.
pub(in crate::packed) struct Learning<'a> {
    pub(in crate::packed) degree: ShDegree,
    /// Number of Gaussians that are coded with the dictionary.
    pub(in crate::packed) total: usize,
    pub(in crate::packed) stop: StopRule,
    pub(in crate::packed) options: &'a PackOptions,
}

impl Learning<'_> {
    /// Learns a dictionary from a sample of rows and their colour classes. The rows are in units of their value steps and
    /// in random order.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if `progress` cancels.
    pub(in crate::packed) fn dictionary(
        &self,
        rows: &[f32],
        classes: &[u8],
        progress: &dyn Progress,
    ) -> Result<Choice> {
        let Self { degree, total, stop, options } = *self;
        let dim = degree.rest();
        if dim == 0 || rows.is_empty() {
            // A file of any degree has at least one atom in memory, also without rows to learn from.
            let first: Vec<f32> = unit_axis(dim, 0).collect();
            let atoms = WholeAtoms::new(degree, &first, 0, false);
            return Ok(Choice { atoms, costs: Costs::initial(1, dim), step: 1.0 });
        }
        let pays = (total / GAUSSIANS_PER_ATOM).min(MAX_LEARNED);
        if options.atoms.is_none() && stop == StopRule::Balanced && pays < CHOICE * dim {
            let bits_of =
                |rows: &[f32], atoms: &[f32], costs: &Costs| self.atom_bits(rows, classes, atoms, costs);
            return choose(degree, rows, classes, pays, bits_of, progress);
        }
        let first = first_atoms(dim, atoms_to_learn(total, dim, options), rows);
        let (learned, costs) = learn(dim, rows, classes, first, 0, stop, progress)?;
        let some = classes.len().min(ATOM_BITS_SAMPLE);
        let bits = self.atom_bits(&rows[..some * dim], &classes[..some], &learned, &costs);
        Ok(Choice { atoms: WholeAtoms::new(degree, &learned, bits, false), costs, step: 1.0 })
    }

    /// Returns the number of bits to which atoms are rounded, for `rows` and the dictionary `atoms`. Larger values enlarge
    /// the errors of atoms, so they ask for more bits.
    fn atom_bits(&self, rows: &[f32], classes: &[u8], atoms: &[f32], costs: &Costs) -> u32 {
        let book = Codebook::new(self.degree.rest(), atoms.to_vec(), costs.clone());
        let codes = book.encode(rows, classes, self.stop);
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
}

/// Sets the step of values that keeps a promised `tolerance`, if there is one. Returns the rule by which a pursuit stops.
pub(in crate::packed) fn promise(parameters: &mut Parameters, tolerance: Option<f64>) -> StopRule {
    let Some(tol) = tolerance else { return StopRule::Balanced };
    let step = tol * VALUE_STEP_PER_TOLERANCE;
    #[expect(clippy::cast_possible_truncation, reason = "a step is f32, and so is a share of the tolerance")]
    let (step, share) = (
        step.clamp(f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX)) as f32,
        (1.0 / VALUE_STEP_PER_TOLERANCE).powi(2) as f32,
    );
    parameters.promised = step;
    StopRule::Error(share * TOLERANCE_SHARE)
}

/// Returns the number of atoms that a scene of `total` Gaussians learns if it does not choose among several numbers.
fn atoms_to_learn(total: usize, dim: usize, options: &PackOptions) -> usize {
    // To keep a promised tolerance, more atoms take fewer bits than exact rows.
    let fewest = if options.tolerance.is_some() { 2 * dim } else { dim };
    options.atoms.unwrap_or_else(|| (total / GAUSSIANS_PER_ATOM).min(MAX_LEARNED).max(fewest))
}

/// Writes `code` to `out` as it is kept in memory: in ascending order of atoms, with values in f16.
fn resident(code: &[(u16, i32)], step: f32, out: &mut Vec<(u16, f16)>) {
    out.clear();
    #[expect(clippy::cast_precision_loss, reason = "f16 keeps less")]
    out.extend(code.iter().map(|&(atom, value)| (atom, f16::from_f32(value as f32 * step))));
    out.sort_by_key(|p| p.0);
}

pub(in crate::packed) fn too_large() -> Error {
    Error::parameter("values", "too large", "positions and colours whose sums f32 can hold")
}
