//! The layers of a file: which Gaussians come first, and in which order the ranges of all chunks lie.

use super::layered::{Chunk, LayerForm, Place, RestForm, layer_forms};

/// Scenes of fewer Gaussians have one layer. Their files are small.
const LEAST_LAYERED: usize = 8000;
/// Share of the Gaussians in the first layer of two.
const FIRST_SHARE: f64 = 0.22;
/// A Gaussian is drawn into the first layer with a probability that grows with this power of the change of pictures
/// without it. With 1 those that show most would stand alone, with holes between them (docs/METHOD.md, "Layers").
const ENERGY_POWER: f64 = 0.6;
/// Steps of the search for the factor of these probabilities.
const FACTOR_STEPS: usize = 60;
/// Gaussians of a chunk of the first layer, and of others. Small ones arrive soon.
const FIRST_CHUNK: usize = 8192;
const SIZE: usize = 32_768;
/// Sizes of nonzeros at which their parts end, where there are layers.
const PARTS: [u32; 3] = [12, 6, 1];
/// Levels of refinement of the first layer and of the second.
const FIRST_LEVELS: u8 = 2;
const SECOND_LEVELS: u8 = 1;

/// The layers of a file.
#[derive(Debug, Clone)]
pub(super) struct Layering {
    /// Factor of the probabilities of the first layer; `None` if there is one layer.
    factor: Option<f64>,
    /// Sum of the probabilities so far.
    sum: f64,
}

impl Layering {
    /// The layers of a scene of `gaussians` Gaussians, or one if it may have no more. `energies` are the changes of
    /// pictures without each of some of the Gaussians.
    pub(super) fn new(
        gaussians: usize,
        may_layer: bool,
        energies: impl Iterator<Item = f32> + Clone,
    ) -> Self {
        let layered = may_layer && gaussians >= LEAST_LAYERED;
        Self { factor: layered.then(|| factor(energies)), sum: 0.5 }
    }

    /// The layer of the next Gaussian in the order of cells.
    pub(super) fn layer(&mut self, energy: f32) -> usize {
        let Some(factor) = self.factor else { return 0 };
        // Sums that pass whole numbers draw Gaussians that lie far apart.
        let before = self.sum.floor();
        self.sum += probability(energy, factor);
        usize::from(self.sum.floor() <= before)
    }

    /// Number of layers.
    pub(super) fn layers(&self) -> usize {
        if self.factor.is_some() { 2 } else { 1 }
    }

    /// How the layers are coded, with `parts` parts of nonzeros.
    pub(super) fn forms(&self, parts: usize) -> Vec<LayerForm> {
        let levels: &[u8] = if self.factor.is_some() { &[FIRST_LEVELS, SECOND_LEVELS] } else { &[0] };
        layer_forms(levels, parts, self.factor.is_some())
    }

    /// Probability that a Gaussian is of the first layer, of which there are more.
    pub(super) fn probability(&self, energy: f32) -> f64 {
        self.factor.map_or(1.0, |factor| probability(energy, factor))
    }

    /// Gaussians of a chunk of a layer.
    pub(super) fn chunk(&self, layer: usize) -> usize {
        if self.factor.is_none() { SIZE } else if layer == 0 { crate::packed::alone::knob("K0", FIRST_CHUNK as f64) as usize } else { crate::packed::alone::knob("K1", SIZE as f64) as usize }
    }

    /// How rows of `dim` coefficients are coded with `atoms` atoms.
    pub(super) fn rest(&self, dim: usize, atoms: usize) -> RestForm {
        let least = match self.factor {
            _ if dim == 0 => Vec::new(),
            Some(_) => PARTS.to_vec(),
            None => vec![1],
        };
        RestForm { dim, atoms, least }
    }

    /// The order of the ranges of `chunks` in the data, of which the first layers come first. Chunks have `parts` parts of
    /// nonzeros.
    pub(super) fn order(&self, chunks: &[Chunk], parts: usize) -> Vec<Place> {
        let mut order = Vec::new();
        let mut put = |chunk: usize, kind: usize| {
            order.push(Place { chunk: chunk as u32, kind: kind as u8 });
        };
        let of = |layer: usize| (0..chunks.len()).filter(move |&c| chunks[c].layer == layer);
        if self.factor.is_none() {
            of(0).for_each(|c| put(c, 0));
            of(0).for_each(|c| (0..parts).for_each(|part| put(c, 1 + part)));
            return order;
        }
        // Ranges of the first layer: base, two refinements, parts, interim changes. Of the second: base, refinement, parts.
        let (first, second) = (1 + usize::from(FIRST_LEVELS), 1 + usize::from(SECOND_LEVELS));
        of(0).for_each(|c| put(c, 0));
        of(0).for_each(|c| put(c, first + parts));
        if parts > 0 {
            of(0).for_each(|c| put(c, first));
        }
        // Where the second layer arrives, the first becomes as fine.
        let mut finer = of(0).peekable();
        let mut later = of(1).skip(1).map(|c| chunks[c].cell);
        for c in of(1) {
            put(c, 0);
            if parts > 0 {
                put(c, second);
            }
            let end = later.next().unwrap_or(u64::MAX);
            while let Some(c) = finer.next_if(|&c| chunks[c].cell < end) {
                put(c, 1);
            }
        }
        finer.for_each(|c| put(c, 1));
        let last = parts.saturating_sub(1);
        for part in 1..last {
            of(0).for_each(|c| put(c, first + part));
            of(1).for_each(|c| put(c, second + part));
        }
        of(0).for_each(|c| put(c, 2));
        of(1).for_each(|c| put(c, 1));
        if last > 0 {
            of(0).for_each(|c| put(c, first + last));
            of(1).for_each(|c| put(c, second + last));
        }
        order
    }
}

/// Probability that a Gaussian is of the first layer.
fn probability(energy: f32, factor: f64) -> f64 {
    let power = libm::pow(f64::from(energy).max(0.0), crate::packed::alone::knob("KE", ENERGY_POWER));
    (factor * power).min(1.0)
}

/// The factor with which probabilities sum to the share of the first layer.
fn factor(energies: impl Iterator<Item = f32> + Clone) -> f64 {
    let count = energies.clone().count() as f64;
    let sum = |factor: f64| energies.clone().map(|e| probability(e, factor)).sum::<f64>();
    // As if all probabilities were below 1; more where some are not.
    let mut factor = share() * count / sum_of_powers(energies.clone()).max(f64::MIN_POSITIVE);
    for _ in 0..FACTOR_STEPS {
        let found = sum(factor) / (share() * count).max(f64::MIN_POSITIVE);
        if !found.is_finite() || found <= 0.0 || (found - 1.0).abs() < 1e-6 {
            break;
        }
        factor /= found;
    }
    factor
}

fn sum_of_powers(energies: impl Iterator<Item = f32>) -> f64 {
    energies.map(|e| libm::pow(f64::from(e).max(0.0), crate::packed::alone::knob("KE", ENERGY_POWER))).sum()
}

fn share() -> f64 { crate::packed::alone::knob("KS", FIRST_SHARE) }
