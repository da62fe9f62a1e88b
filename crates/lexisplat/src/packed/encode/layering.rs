//! The layers of a file: which Gaussians come first, and the order of the ranges of all chunks in the data.

use serde::{Deserialize, Serialize};

use super::options::PackOptions;
use crate::packed::bitstream::index::MAX_LAYERS;
use crate::packed::bitstream::{Chunk, LayerForm, RangeId, RestForm, layer_forms};

/// Share of the Gaussians that are not in the last layer, for scenes with several layers.
const COARSE_SHARE: f64 = 0.14;
/// Share of the Gaussians of a first layer that stay in it when it is divided in two, for refinements of detail.
const DIVIDED_SHARE: f64 = 0.2;
/// Power of the energy to which the probability of a layer is proportional. The energy of a Gaussian is the squared change
/// of pictures without it. With a power of 1 the Gaussians that show most would stand alone, with holes between them
/// (docs/METHOD.md, "Layers").
const ENERGY_POWER: f64 = 0.6;
/// Most steps of the search for the factor of these probabilities.
const FACTOR_STEPS: usize = 60;
/// Least and most Gaussians of a chunk, and the number of chunks of a layer whose size is between these limits. Small
/// chunks arrive soon, and large ones take fewer bytes in all.
const LEAST_CHUNK: usize = 8192;
pub(crate) const MOST_CHUNK: usize = 32_768;
const CHUNKS: usize = 6;
/// A remainder of a layer of up to `1 / REST` of a chunk joins the last chunk.
const REST: usize = 2;
/// Smallest size of a nonzero in each SH part, in steps, for scenes with several layers.
const SH_PARTS: [u32; 3] = [12, 6, 1];
/// Number of refinements of the first layer and of each other layer, for scenes with several layers.
const FIRST_REFINEMENTS: u8 = 2;
const REFINEMENTS: u8 = 1;

/// The layers of a file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Layering {
    /// Factor of the probabilities of each layer but the last. It is empty if there is one layer.
    factors: Vec<f64>,
    /// For each layer but the last, the sum of its probabilities over the Gaussians seen.
    sums: Vec<f64>,
    /// Number of Gaussians of a chunk of each layer.
    chunks: Vec<usize>,
}

impl Layering {
    /// Creates the layers of a scene of `gaussians` Gaussians, as `options` ask for. `energies` holds the energies of a sample
    /// of the Gaussians, and the number of Gaussians that each stands for.
    pub(in crate::packed) fn new(
        gaussians: usize,
        options: &PackOptions,
        energies: impl Iterator<Item = (f32, u64)>,
    ) -> Self {
        let mut factors = Vec::new();
        let shares = shares(gaussians, options.lod);
        if gaussians >= options.layers_from.max(1) {
            let powers: Vec<(f64, f64)> =
                energies.map(|(energy, count)| (power(energy), count as f64)).collect();
            // The probability with which each Gaussian is in none of the layers so far.
            let mut left = vec![1.0; powers.len()];
            for &share in &shares {
                let factor = factor(share, &powers, &left);
                left.iter_mut()
                    .zip(&powers)
                    .for_each(|(left, (power, _))| *left *= 1.0 - (factor * power).min(1.0));
                factors.push(factor);
            }
        }
        let count = factors.len();
        let last = 1.0 - shares.iter().sum::<f64>();
        let shares = shares.into_iter().chain([last]);
        let size = |share: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
            let count = (share * gaussians as f64) as usize;
            (count / CHUNKS).next_power_of_two().clamp(LEAST_CHUNK, MOST_CHUNK)
        };
        let chunks = if count == 0 { vec![MOST_CHUNK] } else { shares.map(size).collect() };
        Self { sums: vec![0.5; count], factors, chunks }
    }

    /// Returns the layer of the next Gaussian, and counts it. Gaussians come in the order of cells.
    pub(in crate::packed) fn layer(&mut self, energy: f32) -> usize {
        let power = power(energy);
        for (layer, (factor, sum)) in self.factors.iter().zip(&mut self.sums).enumerate() {
            // A Gaussian is drawn when the sum passes a whole number. So Gaussians that are drawn lie far apart.
            let before = sum.floor();
            *sum += (factor * power).min(1.0);
            if sum.floor() > before {
                return layer;
            }
        }
        self.factors.len()
    }

    /// Number of layers.
    pub(in crate::packed) fn layers(&self) -> usize {
        self.factors.len() + 1
    }

    /// Returns the form of each layer, with `sh_parts` SH parts.
    pub(in crate::packed) fn forms(&self, sh_parts: usize) -> Vec<LayerForm> {
        let mut refinements = vec![REFINEMENTS; self.layers()];
        refinements[0] = if self.layers() > 1 { FIRST_REFINEMENTS } else { 0 };
        layer_forms(&refinements, sh_parts, self.layers() > 1)
    }

    /// Returns the probability with which a Gaussian that is in no earlier layer is drawn into `layer`.
    pub(in crate::packed) fn probability(&self, layer: usize, energy: f32) -> f64 {
        self.factors.get(layer).map_or(1.0, |factor| (factor * power(energy)).min(1.0))
    }

    /// Returns the number of Gaussians of the next chunk of `layer`. `left` is the number of Gaussians of the layer that
    /// are in no chunk yet.
    pub(in crate::packed) fn next_chunk(&self, layer: usize, left: usize) -> usize {
        let size = self.chunks.get(layer).copied().unwrap_or(MOST_CHUNK);
        if left > size + size / REST { size } else { left }
    }

    /// Returns how rows of `dim` coefficients are coded with `atoms` atoms.
    pub(in crate::packed) fn rest(&self, dim: usize, atoms: usize) -> RestForm {
        let least = match self.layers() {
            _ if dim == 0 => Vec::new(),
            1 => vec![1],
            _ => SH_PARTS.to_vec(),
        };
        RestForm { dim, atoms, least }
    }

    /// Returns the order of the ranges of `chunks` in the data. Each chunk has `sh_parts` SH parts, and `energies`
    /// holds the sum of its Gaussians' energies.
    pub(in crate::packed) fn order(
        &self,
        chunks: &[Chunk],
        energies: &[f64],
        sh_parts: usize,
    ) -> Vec<RangeId> {
        let forms = self.forms(sh_parts);
        let mut order = Order { sh_parts, order: Vec::new(), finer: vec![0; chunks.len()] };
        let of = |layer: usize| (0..chunks.len()).filter(move |&c| chunks[c].layer == layer);
        // The first layer comes as a whole, one kind of range after the other. Other layers come chunk by chunk, in falling
        // order of energy over bytes of the base.
        for kind in [Order::base, Order::interim, Order::largest] {
            of(0).for_each(|c| kind(&mut order, c, forms[0]));
        }
        for (layer, form) in forms.iter().enumerate().skip(1) {
            let worth = |c: usize| {
                let bytes = chunks[c].ranges.first().map_or(0, |base| base.length);
                energies.get(c).copied().unwrap_or(0.0) / f64::from(bytes.max(1))
            };
            let mut arriving: Vec<usize> = of(layer).collect();
            arriving.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)));
            let mut there = vec![false; chunks.len()];
            for c in arriving {
                for kind in [Order::base, Order::interim, Order::largest] {
                    kind(&mut order, c, *form);
                }
                there[c] = true;
                // As soon as the chunks around an earlier chunk are there, that chunk gets one more refinement.
                for before in (0..chunks.len()).filter(|&b| chunks[b].layer < layer) {
                    if !there[before] && overlapping(chunks, before, layer).all(|c| there[c]) {
                        order.finer(before, forms[chunks[before].layer]);
                        there[before] = true;
                    }
                }
            }
        }
        // The remaining ranges of all layers follow: middle nonzeros, remaining refinements, smallest nonzeros.
        let last = sh_parts.saturating_sub(1);
        for sh_part in 1..last {
            (0..chunks.len()).for_each(|c| order.sh_part(c, forms[chunks[c].layer], sh_part));
        }
        for c in 0..chunks.len() {
            let form = forms[chunks[c].layer];
            while order.finer(c, form) {}
        }
        if last > 0 {
            (0..chunks.len()).for_each(|c| order.sh_part(c, forms[chunks[c].layer], last));
        }
        order.order
    }
}

/// An order of ranges under construction.
struct Order {
    sh_parts: usize,
    order: Vec<RangeId>,
    /// Number of refinements of each chunk that are in the order.
    finer: Vec<usize>,
}

impl Order {
    fn put(&mut self, chunk: usize, kind: usize) {
        #[expect(clippy::cast_possible_truncation, reason = "files have fewer chunks, and chunks few kinds")]
        self.order.push(RangeId { chunk: chunk as u32, kind: kind as u8 });
    }

    fn base(&mut self, chunk: usize, _: LayerForm) {
        self.put(chunk, 0);
    }

    fn interim(&mut self, chunk: usize, form: LayerForm) {
        if form.interim {
            self.put(chunk, form.interim_range());
        }
    }

    fn largest(&mut self, chunk: usize, form: LayerForm) {
        if self.sh_parts > 0 {
            self.sh_part(chunk, form, 0);
        }
    }

    fn sh_part(&mut self, chunk: usize, form: LayerForm, sh_part: usize) {
        self.put(chunk, 1 + form.refinements + sh_part);
    }

    /// Adds the next refinement of `chunk`. Returns whether there was one.
    fn finer(&mut self, chunk: usize, form: LayerForm) -> bool {
        let next = self.finer[chunk];
        if next < form.refinements {
            self.put(chunk, 1 + next);
            self.finer[chunk] += 1;
        }
        next < form.refinements
    }
}

/// Returns the chunks of `layer` whose cells overlap those of the chunk `own` of another layer.
fn overlapping(chunks: &[Chunk], own: usize, layer: usize) -> impl Iterator<Item = usize> {
    let end = |c: usize| match chunks.get(c + 1) {
        Some(next) if next.layer == chunks[c].layer => next.cell,
        _ => u64::MAX,
    };
    let cells = chunks[own].cell..end(own);
    let of = (0..chunks.len()).filter(move |&c| chunks[c].layer == layer);
    of.filter(move |&c| chunks[c].cell <= cells.end && end(c) >= cells.start)
}

/// Returns the share of the Gaussians in each layer but the last, if the first layer has at most `most` Gaussians.
fn shares(gaussians: usize, most: Option<usize>) -> Vec<f64> {
    let mut first = COARSE_SHARE;
    let mut others = Vec::new();
    let is_above = |first: f64| most.is_some_and(|most| first * gaussians as f64 > most as f64);
    while is_above(first) && others.len() + 2 < MAX_LAYERS {
        others.insert(0, (1.0 - DIVIDED_SHARE) * first);
        first *= DIVIDED_SHARE;
    }
    [vec![first], others].concat()
}

/// Returns the number to which the probability of a Gaussian is proportional, as long as it is below 1.
fn power(energy: f32) -> f64 {
    libm::pow(f64::from(energy).max(0.0), ENERGY_POWER)
}

/// Returns the factor with which the probabilities sum to `share` of all Gaussians. `powers` holds a power of an energy and
/// the number of Gaussians that it stands for. `left` holds the share of these Gaussians that is in no earlier layer.
fn factor(share: f64, powers: &[(f64, f64)], left: &[f64]) -> f64 {
    let all: f64 = powers.iter().map(|p| p.1).sum();
    let wanted = (share * all).max(f64::MIN_POSITIVE);
    let sum = |factor: f64| {
        let of = |((power, count), left): (&(f64, f64), &f64)| left * (factor * power).min(1.0) * count;
        powers.iter().zip(left).map(of).sum::<f64>()
    };
    // The first guess assumes that all probabilities are below 1. Where some are not, the factor has to be larger.
    let whole: f64 = powers.iter().zip(left).map(|((power, count), left)| left * power * count).sum();
    let mut factor = wanted / whole.max(f64::MIN_POSITIVE);
    for _ in 0..FACTOR_STEPS {
        let found = sum(factor) / wanted;
        if !found.is_finite() || found <= 0.0 || (found - 1.0).abs() < 1e-6 {
            break;
        }
        factor /= found;
    }
    factor
}
