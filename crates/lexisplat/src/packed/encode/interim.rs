//! Interim changes: how the Gaussians of the first layer are drawn while the second layer is missing.
//!
//! A Gaussian grows and becomes more opaque with the opacity and area of the Gaussians that are missing around it
//! (docs/METHOD.md, "Layers"). Fitting to pictures may change its opacity in another way, change its colour, and add to its
//! growth.

use super::appearance::{AppearanceChange, STEPS, steps};
use crate::packed::bitstream::CHANGES;
use crate::packed::bitstream::parameters::Parameters;
use crate::packed::curve::MortonKey;
use crate::scene::splats::Geometry;
use crate::support::maths::log_sigmoid;
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_chunks};

/// Most steps by which scales grow without pictures.
const MOST_GROWTH: f64 = 2.0;
/// The natural logarithms of scales grow by `GROWTH * ln(1 + MISSING * x) + RARE * ln(p)`. `x` is the opacity times area of
/// the missing Gaussians nearest to this one, over its own. `p` is the probability with which the Gaussian was drawn into
/// its layer.
const GROWTH: f64 = 0.25;
const MISSING: f64 = 0.3;
const RARE: f64 = -0.15;
/// The natural logarithm of the opacity grows by `OPACITY * ln(1 + x)`, with the `x` of [`GROWTH`].
const OPACITY: f64 = 0.3;
/// Number of Gaussians on each side along the Morton curve among which the nearest one is searched for.
const NEIGHBOURS: usize = 16;

/// The interim changes of all layers but the last.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct InterimChanges {
    /// For each Gaussian of these layers, the number of steps by which its scales grow.
    growth: Vec<i32>,
    /// For each of these Gaussians, the number of steps by which its opacity grows if there are no changes from pictures.
    opacity: Vec<i32>,
    /// Number of layers that have interim changes: all but the last.
    layers: usize,
}

impl InterimChanges {
    /// Computes the changes of the Gaussians at `keys` of `g`. `keys` holds all layers in the order of the file, and
    /// `layers` the number of Gaussians of each. `probability(layer, i)` is the probability with which Gaussian `i` of
    /// `keys` was drawn into `layer`.
    pub(in crate::packed) fn new(
        g: &Geometry,
        keys: &[MortonKey],
        layers: &[usize],
        probability: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let mut changes = Self { layers: layers.len().saturating_sub(1), ..Self::default() };
        let mut start = 0;
        for (layer, count) in layers.iter().enumerate().take(changes.layers) {
            let end = start + count;
            let missing = missing(g, &keys[start..], *count);
            for (i, x) in (start..end).zip(missing) {
                let rare = libm::log(probability(layer, i).max(f64::MIN_POSITIVE));
                let grows = GROWTH * libm::log1p(MISSING * x) + RARE * rare;
                changes.growth.push(steps(grows.clamp(0.0, MOST_GROWTH * STEPS[0]), STEPS[0]));
                changes.opacity.push(steps(OPACITY * libm::log1p(x), STEPS[1]));
            }
            start = end;
        }
        changes
    }

    /// Returns whether the Gaussians of `layer` have interim changes.
    pub(in crate::packed) fn has(&self, layer: usize) -> bool {
        layer < self.layers
    }

    /// Returns the interim changes, in steps, of Gaussian `i` in the order of the file. `change` is the result of
    /// fitting to pictures, if there was any.
    pub(in crate::packed) fn steps(
        &self,
        i: usize,
        change: Option<&AppearanceChange>,
        parameters: &Parameters,
    ) -> [i32; CHANGES] {
        let growth = self.growth.get(i).copied().unwrap_or(0);
        let Some(AppearanceChange { dc, log_opacity, log_scale }) = change else {
            return [growth, self.opacity.get(i).copied().unwrap_or(0), 0, 0, 0];
        };
        let [a, b, c] = parameters.dc_turned(*dc).map(|d| steps(f64::from(d), STEPS[2]));
        let grows = growth + steps(f64::from(*log_scale), STEPS[0]);
        [grows, steps(f64::from(*log_opacity), STEPS[1]), a, b, c]
    }
}

/// Returns the ratio `sum / own` for each Gaussian before `first`. `own` is its opacity times its area. `sum` is the
/// opacity times area of all Gaussians from `first` on to which it is the nearest one before `first`.
fn missing(g: &Geometry, keys: &[MortonKey], first: usize) -> Vec<f64> {
    let area = |key: &MortonKey| {
        let mut scales = g.scales[key.index()];
        scales.sort_by(f32::total_cmp);
        (scales[1] + scales[2]).exp()
    };
    let area: Vec<f32> = keys.iter().map(area).collect();
    let mass = |i: usize| f64::from(log_sigmoid(g.opacities[keys[i].index()]).exp() * area[i]);
    let (ours, others) = keys.split_at(first.min(keys.len()));
    // Each layer is in the order of cells, but several layers one after the other are not.
    let mut near: Vec<usize> = (0..ours.len()).collect();
    near.sort_by_key(|&i| ours[i].cell);
    let mut sums = vec![0.0_f64; ours.len()];
    if ours.is_empty() {
        return sums;
    }
    let nearest = |j: usize| -> usize {
        let own = others[j];
        let position = g.positions[own.index()];
        let at = near.partition_point(|&i| ours[i].cell <= own.cell);
        let near = &near[at.saturating_sub(NEIGHBOURS)..(at + NEIGHBOURS).min(ours.len())];
        let apart = |&i: &usize| {
            let other = g.positions[ours[i].index()];
            let square = (0..3).map(|k| (position[k] - other[k]).powi(2)).sum::<f32>();
            square / (area[i] + area[first + j]).max(f32::MIN_POSITIVE)
        };
        near.iter().copied().min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(0)
    };
    let owners = map_chunks(others.len(), GAUSSIANS_PER_TASK, |range| range.map(nearest).collect::<Vec<_>>());
    for (j, owner) in (first..).zip(owners.concat()) {
        sums[owner] += mass(j);
    }
    (0..ours.len()).map(|i| sums[i] / mass(i).max(f64::MIN_POSITIVE)).collect()
}
