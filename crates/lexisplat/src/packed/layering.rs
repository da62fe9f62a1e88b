//! The layers of a file: which Gaussians come first, and in which order the ranges of all chunks lie.

use super::layered::{Pass, RestForm};

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
const CHUNK: usize = 32_768;
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
        let layered = may_layer && gaussians >= LEAST_LAYERED && env("ONE", 0.0) == 0.0;
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

    /// Levels of refinement of each layer.
    pub(super) fn levels(&self) -> Vec<u8> {
        if self.factor.is_some() { vec![env("L0", 2.0) as u8, env("L1", 1.0) as u8] } else { vec![0] }
    }

    /// Gaussians of a chunk of a layer.
    pub(super) fn chunk(&self, layer: usize) -> usize {
        if self.factor.is_some() && layer == 0 { FIRST_CHUNK } else { CHUNK }
    }

    /// How rows of `dim` coefficients are coded with `atoms` atoms.
    pub(super) fn rest(&self, dim: usize, atoms: usize) -> RestForm {
        let least = match self.factor {
            _ if dim == 0 => Vec::new(),
            Some(_) => std::env::var("PARTS")
                .map_or(PARTS.to_vec(), |v| v.split(',').map(|x| x.parse().unwrap()).collect()),
            None => vec![1],
        };
        RestForm { dim, atoms, least }
    }

    /// The order of ranges in the data, for chunks of this form.
    pub(super) fn passes(&self, rest: &RestForm) -> Vec<Pass> {
        let parts = rest.least.len();
        let pass = |layer: u8, ranges: &[usize]| Pass {
            layer,
            ranges: ranges.iter().fold(0, |all, k| all | 1 << k),
        };
        if self.factor.is_none() {
            let all: Vec<usize> = (1..1 + parts).collect();
            let rest = (parts > 0).then(|| pass(0, &all));
            return [Some(pass(0, &[0])), rest].into_iter().flatten().collect();
        }
        // Ranges of the first layer: base, two refinements, parts. Of the second: base, refinement, parts.
        let (l0, l1) = (env("L0", 2.0) as usize, env("L1", 1.0) as usize);
        let (first, second) = (1 + l0, 1 + l1);
        let mut passes = vec![pass(0, &[0])];
        if parts > 0 {
            passes.push(pass(0, &[first]));
        }
        if l0 > 0 {
            passes.push(pass(0, &[1]));
        }
        passes.push(if parts > 0 { pass(1, &[0, second]) } else { pass(1, &[0]) });
        for part in 1..parts {
            passes.extend([pass(0, &[first + part]), pass(1, &[second + part])]);
        }
        if l0 > 1 {
            passes.push(pass(0, &[2]));
        }
        if l1 > 0 {
            passes.push(pass(1, &[1]));
        }
        passes
    }
}

/// Probability that a Gaussian is of the first layer.
fn env(name: &str, or: f64) -> f64 {
    std::env::var(name).ok().map_or(or, |v| v.parse().unwrap())
}

fn probability(energy: f32, factor: f64) -> f64 {
    let power = libm::pow(f64::from(energy).max(0.0), ENERGY_POWER);
    (factor * power).min(1.0)
}

/// The factor with which probabilities sum to the share of the first layer.
fn factor(energies: impl Iterator<Item = f32> + Clone) -> f64 {
    let count = energies.clone().count() as f64;
    let sum = |factor: f64| energies.clone().map(|e| probability(e, factor)).sum::<f64>();
    // As if all probabilities were below 1; more where some are not.
    let mut factor =
        env("SHARE", FIRST_SHARE) * count / sum_of_powers(energies.clone()).max(f64::MIN_POSITIVE);
    for _ in 0..FACTOR_STEPS {
        let found = sum(factor) / (env("SHARE", FIRST_SHARE) * count).max(f64::MIN_POSITIVE);
        if !found.is_finite() || found <= 0.0 || (found - 1.0).abs() < 1e-6 {
            break;
        }
        factor /= found;
    }
    factor
}

fn sum_of_powers(energies: impl Iterator<Item = f32>) -> f64 {
    energies.map(|e| libm::pow(f64::from(e).max(0.0), ENERGY_POWER)).sum()
}
