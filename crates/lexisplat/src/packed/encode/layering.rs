//! The layers of a file: which Gaussians come first, and in which order the ranges of all chunks lie.

use serde::{Deserialize, Serialize};

use crate::packed::bitstream::{Chunk, LayerForm, Place, RestForm, layer_forms};

/// Scenes of fewer Gaussians have one layer by default. Their files are small.
pub(in crate::packed) const LEAST_LAYERED: usize = 8000;
/// Shares of the Gaussians in all layers but the last, where there are several.
const SHARES: [f64; 1] = [0.14];
/// A Gaussian is drawn into a layer with a probability that grows with this power of the change of pictures without it. With
/// 1 those that show most would stand alone, with holes between them (docs/METHOD.md, "Layers").
const ENERGY_POWER: f64 = 0.6;
/// Steps of the search for the factor of these probabilities.
const FACTOR_STEPS: usize = 60;
/// Least and most Gaussians of a chunk, and a layer's number of chunks of a size between. Small ones arrive soon, and large
/// ones take fewer bytes.
const LEAST_CHUNK: usize = 8192;
pub(crate) const MOST_CHUNK: usize = 32_768;
const CHUNKS: usize = 6;
/// The last Gaussians of a layer join the chunk before them if they are at most its number over this.
const REST: usize = 2;
/// Sizes of nonzeros at which their parts end, where there are layers.
const PARTS: [u32; 3] = [12, 6, 1];
/// Levels of refinement of each layer.
const LEVELS: [u8; LAYERS] = [2, 1];
/// Number of layers, where there are several.
const LAYERS: usize = SHARES.len() + 1;

/// The layers of a file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::packed) struct Layering {
    /// Factors of the probabilities of all layers but the last; none if there is one layer.
    factors: Vec<f64>,
    /// Sums of the probabilities so far.
    sums: Vec<f64>,
    /// Gaussians of a chunk of each layer.
    chunks: Vec<usize>,
}

impl Layering {
    /// The layers of a scene of `gaussians` Gaussians, or one if these are fewer than `layers_from`. `energies` are the
    /// changes of pictures without each of some of the Gaussians, and for how many Gaussians each stands.
    pub(in crate::packed) fn new(
        gaussians: usize,
        layers_from: usize,
        energies: impl Iterator<Item = (f32, u64)>,
    ) -> Self {
        let mut factors = Vec::new();
        if gaussians >= layers_from.max(1) {
            let powers: Vec<(f64, f64)> =
                energies.map(|(energy, count)| (power(energy), count as f64)).collect();
            // The probability that a Gaussian is in no layer so far.
            let mut left = vec![1.0; powers.len()];
            for share in SHARES {
                let factor = factor(share, &powers, &left);
                left.iter_mut()
                    .zip(&powers)
                    .for_each(|(left, (power, _))| *left *= 1.0 - (factor * power).min(1.0));
                factors.push(factor);
            }
        }
        let count = factors.len();
        let last = 1.0 - SHARES.iter().sum::<f64>();
        let shares = SHARES.into_iter().chain([last]);
        let size = |share: f64| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
            let count = (share * gaussians as f64) as usize;
            (count / CHUNKS).next_power_of_two().clamp(LEAST_CHUNK, MOST_CHUNK)
        };
        let chunks = if count == 0 { vec![MOST_CHUNK] } else { shares.map(size).collect() };
        Self { sums: vec![0.5; count], factors, chunks }
    }

    /// The layer of the next Gaussian in the order of cells.
    pub(in crate::packed) fn layer(&mut self, energy: f32) -> usize {
        let power = power(energy);
        for (layer, (factor, sum)) in self.factors.iter().zip(&mut self.sums).enumerate() {
            // Sums that pass whole numbers draw Gaussians that lie far apart.
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

    /// How the layers are coded, with `parts` parts of nonzeros.
    pub(in crate::packed) fn forms(&self, parts: usize) -> Vec<LayerForm> {
        let levels: &[u8] = if self.layers() > 1 { &LEVELS } else { &[0] };
        layer_forms(levels, parts, self.layers() > 1)
    }

    /// Probability that a Gaussian is of layer `layer` if it is of no layer before.
    pub(in crate::packed) fn probability(&self, layer: usize, energy: f32) -> f64 {
        self.factors.get(layer).map_or(1.0, |factor| (factor * power(energy)).min(1.0))
    }

    /// Gaussians of the next chunk of a layer of which so many are left.
    pub(in crate::packed) fn next_chunk(&self, layer: usize, left: usize) -> usize {
        let size = self.chunks.get(layer).copied().unwrap_or(MOST_CHUNK);
        if left > size + size / REST { size } else { left }
    }

    /// How rows of `dim` coefficients are coded with `atoms` atoms.
    pub(in crate::packed) fn rest(&self, dim: usize, atoms: usize) -> RestForm {
        let least = match self.layers() {
            _ if dim == 0 => Vec::new(),
            1 => vec![1],
            _ => PARTS.to_vec(),
        };
        RestForm { dim, atoms, least }
    }

    /// The order of the ranges of `chunks` in the data, of which the first layers come first. Chunks have `parts` parts of
    /// nonzeros. `energies` are the changes of pictures without each chunk.
    pub(in crate::packed) fn order(&self, chunks: &[Chunk], energies: &[f64], parts: usize) -> Vec<Place> {
        let forms = self.forms(parts);
        let mut order = Order { parts, order: Vec::new(), finer: vec![0; chunks.len()] };
        let of = |layer: usize| (0..chunks.len()).filter(move |&c| chunks[c].layer == layer);
        // The first layer at once, one kind of range after the other, and of other layers chunk after chunk those that show
        // most for their bytes first.
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
                // Where a layer is there, those before become finer by a level.
                for before in (0..chunks.len()).filter(|&b| chunks[b].layer < layer) {
                    if !there[before] && overlapping(chunks, before, layer).all(|c| there[c]) {
                        order.finer(before, forms[chunks[before].layer]);
                        there[before] = true;
                    }
                }
            }
        }
        // The rest in all layers: larger nonzeros, what is left of coarse steps, the smallest nonzeros.
        let last = parts.saturating_sub(1);
        for part in 1..last {
            (0..chunks.len()).for_each(|c| order.part(c, forms[chunks[c].layer], part));
        }
        for c in 0..chunks.len() {
            let form = forms[chunks[c].layer];
            while order.finer(c, form) {}
        }
        if last > 0 {
            (0..chunks.len()).for_each(|c| order.part(c, forms[chunks[c].layer], last));
        }
        order.order
    }
}

/// An order of ranges that is being made.
struct Order {
    parts: usize,
    order: Vec<Place>,
    /// Levels of refinement of each chunk so far.
    finer: Vec<usize>,
}

impl Order {
    fn put(&mut self, chunk: usize, kind: usize) {
        #[expect(clippy::cast_possible_truncation, reason = "files have fewer chunks, and chunks few kinds")]
        self.order.push(Place { chunk: chunk as u32, kind: kind as u8 });
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
        if self.parts > 0 {
            self.part(chunk, form, 0);
        }
    }

    fn part(&mut self, chunk: usize, form: LayerForm, part: usize) {
        self.put(chunk, 1 + form.levels + part);
    }

    /// The next refinement of a chunk, if there is one.
    fn finer(&mut self, chunk: usize, form: LayerForm) -> bool {
        let level = self.finer[chunk];
        if level < form.levels {
            self.put(chunk, 1 + level);
            self.finer[chunk] += 1;
        }
        level < form.levels
    }
}

/// The chunks of a layer whose cells overlap those of a chunk of another.
fn overlapping(chunks: &[Chunk], own: usize, layer: usize) -> impl Iterator<Item = usize> {
    let end = |c: usize| match chunks.get(c + 1) {
        Some(next) if next.layer == chunks[c].layer => next.cell,
        _ => u64::MAX,
    };
    let cells = chunks[own].cell..end(own);
    let of = (0..chunks.len()).filter(move |&c| chunks[c].layer == layer);
    of.filter(move |&c| chunks[c].cell <= cells.end && end(c) >= cells.start)
}

/// What probabilities are proportional to, unless they are 1.
fn power(energy: f32) -> f64 {
    libm::pow(f64::from(energy).max(0.0), ENERGY_POWER)
}

/// The factor with which probabilities sum to `share` of all Gaussians. `powers` are those of some, and how many Gaussians each
/// stands for, of which these shares are left.
fn factor(share: f64, powers: &[(f64, f64)], left: &[f64]) -> f64 {
    let all: f64 = powers.iter().map(|p| p.1).sum();
    let wanted = (share * all).max(f64::MIN_POSITIVE);
    let sum = |factor: f64| {
        let of = |((power, count), left): (&(f64, f64), &f64)| left * (factor * power).min(1.0) * count;
        powers.iter().zip(left).map(of).sum::<f64>()
    };
    // As if all probabilities were below 1; more where some are not.
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
