//! Weights as whole numbers of parts of an octave, and histograms of them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Parts of an octave. Rounding a weight to a part changes it by at most 4.4 %.
const PER_OCTAVE: f64 = 8.0;
/// The code of a weight of 0.
const NONE: i16 = i16::MIN;

/// Returns the code of a weight that is at least 0: its binary logarithm in parts of an octave.
pub(in crate::packed) fn octaves(weight: f32) -> i16 {
    if weight <= 0.0 || !weight.is_finite() {
        return NONE;
    }
    #[expect(clippy::cast_possible_truncation, reason = "logarithms of f32 are below 150")]
    let octaves = libm::rint(libm::log2(f64::from(weight)) * PER_OCTAVE) as i16;
    octaves
}

/// Returns the weight of a code.
pub(in crate::packed) fn weight(octaves: i16) -> f32 {
    if octaves == NONE {
        return 0.0;
    }
    #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
    let weight = libm::exp2(f64::from(octaves) / PER_OCTAVE).min(f64::from(f32::MAX)) as f32;
    weight
}

/// Pairs of weights of many Gaussians, in two bytes each.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::packed) struct Pairs {
    /// The largest code of each weight of a pair.
    most: [i16; 2],
    /// Distance of each code from the largest: at most [`FARTHEST`], or [`ZERO`].
    below: Vec<[u8; 2]>,
}

/// Largest distance of a code from the largest, nearly 32 octaves. Weights farther below count as this.
const FARTHEST: u8 = 254;
/// The distance that marks a weight of 0.
const ZERO: u8 = 255;

impl Pairs {
    pub(in crate::packed) fn of(weights: &[[f32; 2]]) -> Self {
        let mut most = [NONE; 2];
        for pair in weights {
            (0..2).for_each(|k| most[k] = most[k].max(octaves(pair[k])));
        }
        let below = |k: usize, weight: f32| match octaves(weight) {
            NONE => ZERO,
            own => u8::try_from(most[k] - own).unwrap_or(FARTHEST).min(FARTHEST),
        };
        Self { most, below: weights.iter().map(|pair| [below(0, pair[0]), below(1, pair[1])]).collect() }
    }

    /// Returns the number of pairs.
    pub(in crate::packed) fn len(&self) -> usize {
        self.below.len()
    }

    /// Returns the pairs, as rounded.
    pub(in crate::packed) fn iter(&self) -> impl Iterator<Item = [f32; 2]> {
        let tables: [Vec<f32>; 2] = [0, 1].map(|k| {
            let number = |below: u8| self.most[k].saturating_sub(below.into());
            (0..=ZERO).map(|below| if below == ZERO { 0.0 } else { weight(number(below)) }).collect()
        });
        self.below.iter().map(move |pair| [0, 1].map(|k| tables[k][usize::from(pair[k])]))
    }
}

/// A histogram of the codes of weights.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::packed) struct Histogram(BTreeMap<i16, u64>);

impl Histogram {
    pub(in crate::packed) fn add(&mut self, weight: f32) {
        *self.0.entry(octaves(weight)).or_default() += 1;
    }

    /// Adds the weights of `other`.
    pub(in crate::packed) fn merge(&mut self, other: &Self) {
        other.0.iter().for_each(|(octaves, count)| *self.0.entry(*octaves).or_default() += count);
    }

    /// Returns the weights in rising order, and how often each occurs.
    pub(in crate::packed) fn iter(&self) -> impl Iterator<Item = (f32, u64)> {
        self.0.iter().map(|(&octaves, &count)| (weight(octaves), count))
    }

    /// Returns the number of weights.
    pub(in crate::packed) fn count(&self) -> u64 {
        self.0.values().sum()
    }

    /// Returns the weight below or at which `share` of all weights are; 0 if there are no weights.
    pub(in crate::packed) fn quantile(&self, share: f64) -> f32 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
        let mut left = (self.count().saturating_sub(1) as f64 * share) as u64;
        for (weight, count) in self.iter() {
            match left.checked_sub(count) {
                Some(rest) => left = rest,
                None => return weight,
            }
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_come_back_within_a_sixteenth_of_an_octave() {
        let weights: Vec<[f32; 2]> =
            (0_u8..200).map(|i| [1e-9 * f32::from(i), 1e3 * 0.8_f32.powi(i32::from(i))]).collect();
        let pairs = Pairs::of(&weights);
        assert_eq!(pairs.len(), 200);
        for (given, found) in weights.iter().zip(pairs.iter()) {
            for k in 0..2 {
                // Weights farther below the largest are raised to this.
                let least = [200e-9, 1e3][k] * 2.0_f32.powf(-f32::from(FARTHEST) / 8.0);
                let ratio = if given[k] == 0.0 { 1.0 } else { found[k] / given[k].max(least) };
                assert!((0.955..1.047).contains(&ratio), "{given:?} {found:?}");
                assert_eq!(given[k] == 0.0, found[k] == 0.0);
            }
        }
        assert_eq!(Pairs::of(&[[0.0, f32::MAX]]).iter().next().unwrap()[0], 0.0);
        assert!(Pairs::of(&[[0.0, f32::MAX]]).iter().all(|pair| pair[1].is_finite()));
    }

    #[test]
    fn histograms_add_up_and_have_quantiles() {
        let weights: Vec<f32> = (1_u16..=1000).map(f32::from).collect();
        let (mut all, mut halves) = (Histogram::default(), [Histogram::default(), Histogram::default()]);
        for (i, &w) in weights.iter().enumerate() {
            all.add(w);
            halves[i % 2].add(w);
        }
        let [mut sum, other] = halves;
        sum.merge(&other);
        assert_eq!(sum, all);
        assert_eq!(all.count(), 1000);
        for share in [0.1, 0.5, 0.9, 1.0] {
            let (found, expected) = (f64::from(all.quantile(share)), 1000.0 * share);
            assert!((found / expected - 1.0).abs() < 0.06, "{share}: {found}");
        }
        assert_eq!(Histogram::default().quantile(0.5), 0.0);
    }
}
