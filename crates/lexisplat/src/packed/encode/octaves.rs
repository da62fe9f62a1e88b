//! Numbers of at least 0 as whole numbers of eighths of an octave, and histograms of them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::scene::sensitivity::AppearanceSensitivity;

/// Codes of an octave. Rounding changes a number by at most 4.4 %.
const PER_OCTAVE: f64 = 8.0;
/// The code of 0.
const NONE: i16 = i16::MIN;

/// Returns the code of a number that is at least 0: its binary logarithm in eighths of an octave.
pub(in crate::packed) fn octaves(number: f32) -> i16 {
    if number <= 0.0 || !number.is_finite() {
        return NONE;
    }
    #[expect(clippy::cast_possible_truncation, reason = "logarithms of f32 are below 150")]
    let octaves = libm::rint(libm::log2(f64::from(number)) * PER_OCTAVE) as i16;
    octaves
}

/// Returns the number of a code.
pub(in crate::packed) fn number(octaves: i16) -> f32 {
    if octaves == NONE {
        return 0.0;
    }
    #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
    let number = libm::exp2(f64::from(octaves) / PER_OCTAVE).min(f64::from(f32::MAX)) as f32;
    number
}

/// The sensitivities to the appearances of many Gaussians, in two bytes each.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::packed) struct RoundedSensitivities {
    /// The largest code of the sensitivities to colours, and of those to opacities.
    most: [i16; 2],
    /// Distance of each code from the largest: at most [`FARTHEST`], or [`ZERO`].
    below: Vec<[u8; 2]>,
}

/// Largest distance of a code from the largest, nearly 32 octaves. Sensitivities farther below count as this.
const FARTHEST: u8 = 254;
/// The distance that marks a sensitivity of 0.
const ZERO: u8 = 255;

impl RoundedSensitivities {
    pub(in crate::packed) fn of(sensitivities: &[AppearanceSensitivity]) -> Self {
        let mut most = [NONE; 2];
        for &AppearanceSensitivity { colour, opacity } in sensitivities {
            most = [most[0].max(octaves(colour)), most[1].max(octaves(opacity))];
        }
        let below = |k: usize, sensitivity: f32| match octaves(sensitivity) {
            NONE => ZERO,
            own => u8::try_from(most[k] - own).unwrap_or(FARTHEST).min(FARTHEST),
        };
        let codes = |s: &AppearanceSensitivity| [below(0, s.colour), below(1, s.opacity)];
        Self { most, below: sensitivities.iter().map(codes).collect() }
    }

    /// Returns the number of Gaussians.
    pub(in crate::packed) fn len(&self) -> usize {
        self.below.len()
    }

    /// Returns the rounded sensitivities.
    pub(in crate::packed) fn iter(&self) -> impl Iterator<Item = AppearanceSensitivity> {
        let tables: [Vec<f32>; 2] = [0, 1].map(|k| {
            let code = |below: u8| self.most[k].saturating_sub(below.into());
            (0..=ZERO).map(|below| if below == ZERO { 0.0 } else { number(code(below)) }).collect()
        });
        let [colours, opacities] = tables;
        self.below.iter().map(move |&[colour, opacity]| AppearanceSensitivity {
            colour: colours[usize::from(colour)],
            opacity: opacities[usize::from(opacity)],
        })
    }
}

/// A histogram of the codes of numbers.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::packed) struct Histogram(BTreeMap<i16, u64>);

impl Histogram {
    pub(in crate::packed) fn add(&mut self, number: f32) {
        *self.0.entry(octaves(number)).or_default() += 1;
    }

    /// Adds the numbers of `other`.
    pub(in crate::packed) fn merge(&mut self, other: &Self) {
        other.0.iter().for_each(|(octaves, count)| *self.0.entry(*octaves).or_default() += count);
    }

    /// Returns the numbers in rising order, and how often each occurs.
    pub(in crate::packed) fn iter(&self) -> impl Iterator<Item = (f32, u64)> {
        self.0.iter().map(|(&octaves, &count)| (number(octaves), count))
    }

    /// Returns how many numbers were added.
    pub(in crate::packed) fn count(&self) -> u64 {
        self.0.values().sum()
    }

    /// Returns the number below or at which `share` of all numbers are; 0 if there are none.
    pub(in crate::packed) fn quantile(&self, share: f64) -> f32 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
        let mut left = (self.count().saturating_sub(1) as f64 * share) as u64;
        for (number, count) in self.iter() {
            match left.checked_sub(count) {
                Some(rest) => left = rest,
                None => return number,
            }
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensitivities_come_back_within_a_sixteenth_of_an_octave() {
        let of = |colour: f32, opacity: f32| AppearanceSensitivity { colour, opacity };
        let array = |s: AppearanceSensitivity| [s.colour, s.opacity];
        let given: Vec<AppearanceSensitivity> =
            (0_u8..200).map(|i| of(1e-9 * f32::from(i), 1e3 * 0.8_f32.powi(i32::from(i)))).collect();
        let rounded = RoundedSensitivities::of(&given);
        assert_eq!(rounded.len(), 200);
        for (given, found) in given.into_iter().map(array).zip(rounded.iter().map(array)) {
            for k in 0..2 {
                // Sensitivities farther below the largest are raised to this.
                let least = [200e-9, 1e3][k] * 2.0_f32.powf(-f32::from(FARTHEST) / 8.0);
                let ratio = if given[k] == 0.0 { 1.0 } else { found[k] / given[k].max(least) };
                assert!((0.955..1.047).contains(&ratio), "{given:?} {found:?}");
                assert_eq!(given[k] == 0.0, found[k] == 0.0);
            }
        }
        let extreme = RoundedSensitivities::of(&[of(0.0, f32::MAX)]).iter().next().unwrap();
        assert!(extreme.colour == 0.0 && extreme.opacity.is_finite());
    }

    #[test]
    fn histograms_add_up_and_have_quantiles() {
        let numbers: Vec<f32> = (1_u16..=1000).map(f32::from).collect();
        let (mut all, mut halves) = (Histogram::default(), [Histogram::default(), Histogram::default()]);
        for (i, &x) in numbers.iter().enumerate() {
            all.add(x);
            halves[i % 2].add(x);
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
