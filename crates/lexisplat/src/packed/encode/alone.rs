//! What the Gaussians of a first layer look like while those of the second are not there.
//!
//! They grow and become more opaque by what is missing around them (docs/METHOD.md, "Layers"). Pictures may say more, and
//! their colours too.

use super::appearance::AppearanceChange;
use crate::packed::bitstream::parameters::Parameters;
use crate::packed::bitstream::{CHANGES, KINDS};
use crate::packed::curve::MortonKey;
use crate::scene::splats::Geometry;
use crate::support::maths::log_sigmoid;
use crate::support::parallel::{GAUSSIANS_PER_TASK, map_chunks};

/// Steps of the changes: of logarithms of scales and opacities, and of base colours as SH coefficients.
pub(in crate::packed) const STEPS: [f64; KINDS] = [0.4, 0.5, 0.6];
/// Most steps by which scales grow.
const MOST_GROWTH: f64 = 2.0;
/// Growth of the logarithm of scales by what is missing, GROWTH ln(1 + MISSING x), where x is what of opacity times area is
/// missing over what the Gaussian has, and by the probability p with which it was drawn, RARE ln p.
const GROWTH: f64 = 0.25;
const MISSING: f64 = 0.3;
const RARE: f64 = -0.15;
/// Growth of the logarithm of the opacity, as a multiple of ln(1 + x).
const OPACITY: f64 = 0.3;
/// Most steps of a change of an opacity and of a colour.
const MOST_STEPS: f64 = 1000.0;
/// Gaussians on both sides along the Morton curve among which the nearest is looked for.
const NEIGHBOURS: usize = 16;

/// How a first layer stands in for a second one.
#[derive(Debug, Default)]
pub(in crate::packed) struct Alone {
    /// Of each Gaussian of the first layer the steps by which its scales grow.
    growth: Vec<i32>,
    /// And those by which its opacity grows, if pictures say nothing.
    opacity: Vec<i32>,
    /// Number of layers that change.
    layers: usize,
}

impl Alone {
    /// The changes of the Gaussians at these places of `g`, which are all layers in the order of the file, of so many
    /// Gaussians each. `probability` says how probable a Gaussian was to be drawn into its layer.
    pub(in crate::packed) fn new(
        g: &Geometry,
        places: &[MortonKey],
        layers: &[usize],
        probability: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let mut alone = Self { layers: layers.len().saturating_sub(1), ..Self::default() };
        let mut start = 0;
        for (layer, count) in layers.iter().enumerate().take(alone.layers) {
            let end = start + count;
            let missing = missing(g, places, end);
            for (i, x) in (start..end).zip(missing.into_iter().skip(start)) {
                let rare = libm::log(probability(layer, i).max(f64::MIN_POSITIVE));
                let grows = GROWTH * libm::log1p(MISSING * x) + RARE * rare;
                alone.growth.push(steps(grows.clamp(0.0, MOST_GROWTH * STEPS[0]), STEPS[0]));
                alone.opacity.push(steps(OPACITY * libm::log1p(x), STEPS[1]));
            }
            start = end;
        }
        alone
    }

    /// Whether Gaussians of a layer change.
    pub(in crate::packed) fn has(&self, layer: usize) -> bool {
        layer < self.layers
    }

    /// The steps of Gaussian `i` in the order of the file, if pictures say nothing or if they ask for `change`.
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

/// The nearest number of steps.
#[expect(clippy::cast_possible_truncation, reason = "clamped")]
pub(in crate::packed) fn steps(x: f64, step: f64) -> i32 {
    libm::rint(x / step).clamp(-MOST_STEPS, MOST_STEPS) as i32
}

/// Returns for each Gaussian before `first` the ratio `sum / own`. `own` is its opacity times its area. `sum` is that of the
/// Gaussians from `first` on that are nearer to it than to any other before `first`.
fn missing(g: &Geometry, places: &[MortonKey], first: usize) -> Vec<f64> {
    let area = |place: &MortonKey| {
        let mut scales = g.scales[place.index()];
        scales.sort_by(f32::total_cmp);
        (scales[1] + scales[2]).exp()
    };
    let area: Vec<f32> = places.iter().map(area).collect();
    let mass = |i: usize| f64::from(log_sigmoid(g.opacities[places[i].index()]).exp() * area[i]);
    let (ours, others) = places.split_at(first.min(places.len()));
    // In the order of cells, which each layer is in.
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
