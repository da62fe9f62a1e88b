//! The change of pictures with each value of each Gaussian, as plain numbers.

use crate::scene::splats::{Geometry, filter};
use crate::support::maths;

/// The sensitivity of pictures to the values of Gaussians. For each value of each Gaussian, it is the expected squared
/// change of a picture's colour values, averaged over pixels and channels, for a squared error of 1 in that value (the
/// diagonal of a Gauss-Newton matrix).
///
/// A renderer measures the sensitivity; [`Sensitivity::guess`] needs no renderer.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sensitivity {
    /// Sensitivity to one channel of the colour, which is the same for each channel.
    pub colour: Vec<f32>,
    /// Sensitivity to the logarithm of the opacity (after the sigmoid).
    pub opacity: Vec<f32>,
    /// Sensitivity to the position, in world units: the symmetric matrix xx, xy, xz, yy, yz, zz.
    pub position: Vec<[f32; 6]>,
    /// Sensitivity to the logarithm of the standard deviation along each axis, in the scene's order.
    pub scale: Vec<[f32; 3]>,
    /// Sensitivity to a rotation about each of the Gaussian's own axes, in radians.
    pub rotation: Vec<[f32; 3]>,
    /// Largest change of any colour value of any picture when the Gaussian is left out; infinite where this change is not
    /// known.
    pub removal: Vec<f32>,
    /// Mean squared change of the one picture that changes most when the Gaussian is left out; 0 where this change is not
    /// known.
    pub removal_view: Vec<f32>,
}

/// The sensitivity of pictures to the appearance of a Gaussian.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AppearanceSensitivity {
    /// Sensitivity to one channel of the colour.
    pub colour: f32,
    /// Sensitivity to the logarithm of the opacity (after the sigmoid).
    pub opacity: f32,
}

/// Sensitivity to the opacity, as a share of the sensitivity to the colour. This share and the shares below are averages of
/// scenes measured with a renderer.
const CONTRAST: f32 = 0.08;
/// Sensitivity to the standard deviation along each axis, longest first, as a share of the sensitivity to the opacity.
const SCALE_SHARES: [f32; 3] = [0.6, 0.1, 0.05];
/// Sensitivity to a turn, for each squared unit of lever, as a share of the sensitivity to the opacity.
const ROTATION_SHARE: f32 = 0.1;

/// Powers of the opacity and of the product of the two longest standard deviations. Measured sensitivities are about
/// proportional to both.
const ALPHA_POWER: f32 = 1.7;
const AREA_POWER: f32 = 0.6;
/// Smallest sum of guessed sensitivities. The reciprocal of a much smaller sum is not a finite f32.
const LEAST_TOTAL: f64 = 1e-30;
/// Share of the 90th percentile of sensitivities. A sensitivity that is not above this share counts as not seen.
const UNSEEN: f32 = 1e-4;

/// Smallest sensitivity to a Gaussian, as a share of the guessed sensitivity. Steps are then at most 2.6 times as large
/// as with the guess. From any viewpoint, a file is therefore not much worse than a file made with the guess.
const LEAST_OF_GUESS: f32 = 0.15;

impl Sensitivity {
    /// Returns the sensitivity of pictures that depend on none of `count` Gaussians.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self {
            colour: vec![0.0; count],
            opacity: vec![0.0; count],
            position: vec![[0.0; 6]; count],
            scale: vec![[0.0; 3]; count],
            rotation: vec![[0.0; 3]; count],
            removal: vec![0.0; count],
            removal_view: vec![0.0; count],
        }
    }

    /// Returns the number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.colour.len()
    }

    /// Returns whether there are no Gaussians.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.colour.is_empty()
    }

    /// Returns the sensitivity to the appearance of Gaussian `i`.
    ///
    /// # Panics
    /// If there is no Gaussian `i`.
    #[must_use]
    pub fn appearance(&self, i: usize) -> AppearanceSensitivity {
        AppearanceSensitivity { colour: self.colour[i], opacity: self.opacity[i] }
    }

    /// Returns [`Self::appearance`] of all Gaussians.
    #[must_use]
    pub fn appearances(&self) -> Vec<AppearanceSensitivity> {
        (0..self.len()).map(|i| self.appearance(i)).collect()
    }

    /// Keeps only the Gaussians for which `keep` is true, in order. `keep` has one entry for each Gaussian.
    ///
    /// # Panics
    /// If `keep` differs in length.
    pub fn retain(&mut self, keep: &[bool]) {
        assert_eq!(self.len(), keep.len(), "one entry a Gaussian");
        filter(&mut self.colour, keep);
        filter(&mut self.opacity, keep);
        filter(&mut self.position, keep);
        filter(&mut self.scale, keep);
        filter(&mut self.rotation, keep);
        filter(&mut self.removal, keep);
        filter(&mut self.removal_view, keep);
    }

    /// Returns the sensitivity in the order that the scene had before [`Splats::gathered`](crate::Splats::gathered): entry
    /// `k` becomes entry `order[k]`.
    ///
    /// # Panics
    /// If `order` is not a permutation of the Gaussians.
    #[must_use]
    pub fn scattered(&self, order: &[u32]) -> Self {
        assert_eq!(self.len(), order.len(), "one entry a Gaussian");
        let mut out = Self::zeros(order.len());
        for (k, &to) in order.iter().enumerate() {
            let to = to as usize;
            out.colour[to] = self.colour[k];
            out.opacity[to] = self.opacity[k];
            out.position[to] = self.position[k];
            out.scale[to] = self.scale[k];
            out.rotation[to] = self.rotation[k];
            out.removal[to] = self.removal[k];
            out.removal_view[to] = self.removal_view[k];
        }
        out
    }

    /// Multiplies all sensitivities except `removal` by `factor`. For example, if only one picture in ten shows these
    /// Gaussians, pictures depend on them by a tenth. `removal`, the largest change of one picture, stays as it is.
    pub(crate) fn scale(&mut self, factor: f32) {
        let shapes = self.position.as_flattened_mut().iter_mut();
        let shapes = shapes.chain(self.scale.as_flattened_mut()).chain(self.rotation.as_flattened_mut());
        let whole = self.colour.iter_mut().chain(&mut self.opacity).chain(&mut self.removal_view);
        whole.chain(shapes).for_each(|v| *v *= factor);
    }

    /// Estimates the sensitivity from the Gaussians alone. It is largest for opaque and large Gaussians. The estimate
    /// does not know which Gaussians hide others, so files made with it are larger than files of the same quality made
    /// with a measured sensitivity.
    #[must_use]
    pub fn guess(geometry: &Geometry) -> Self {
        Self::guess_of_part(geometry, guessed_total(0.0, geometry))
    }

    /// Estimates the sensitivity as [`Self::guess`] does, for a part of a scene. `total` stands for the [`guessed_total`] of
    /// the whole scene.
    pub(crate) fn guess_of_part(geometry: &Geometry, total: f64) -> Self {
        let n = geometry.len();
        let mut out = Self::zeros(n);
        out.removal.fill(f32::INFINITY);
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let unit = (1.0 / (3.0 * total.max(LEAST_TOTAL))) as f32;
        for i in 0..n {
            out.set_guess(geometry, i, unscaled_guess(geometry, i) * unit);
        }
        out
    }

    /// Sets the sensitivities of Gaussian `i`, except for its removal, to estimates from its sensitivity to colour,
    /// `colour`.
    fn set_guess(&mut self, geometry: &Geometry, i: usize, colour: f32) {
        let shape = CONTRAST * colour;
        self.colour[i] = colour;
        self.opacity[i] = shape;
        let scales = geometry.scales[i];
        let order = maths::longest_first(scales);
        for (&axis, share) in order.iter().zip(SCALE_SHARES) {
            self.scale[i][axis] = share * shape;
        }
        for k in 0..3 {
            let ratio = maths::exp(scales[(k + 1) % 3] - scales[(k + 2) % 3]);
            let lever = (ratio - 1.0 / ratio).clamp(-100.0, 100.0);
            self.rotation[i][k] = ROTATION_SHARE * shape * lever * lever;
        }
        let middle = scales[order[1]];
        let along = shape * maths::exp(-2.0 * middle.clamp(-30.0, 30.0));
        self.position[i] = [along, 0.0, 0.0, along, 0.0, along];
    }

    /// Mixes the measured sensitivity with the guessed sensitivity, which does not depend on views. Each sensitivity becomes
    /// the geometric mean of the measured and the guessed one, in which the guessed one has the exponent `share`. The result
    /// is not 0 for Gaussians that the views hardly showed, because other views may show them. `geometry` has the same
    /// Gaussians.
    ///
    /// # Panics
    /// If the sensitivity and `geometry` differ in length.
    pub fn blend_with_prior(&mut self, geometry: &Geometry, share: f32) {
        assert_eq!(self.len(), geometry.len(), "one entry a Gaussian in both");
        let n = self.len();
        let total: f64 = self.colour.iter().map(|&v| f64::from(v)).sum();
        if total <= 0.0 {
            let [removal, removal_view] = [&mut self.removal, &mut self.removal_view].map(std::mem::take);
            *self = Self { removal, removal_view, ..Self::guess(geometry) };
            return;
        }
        let mut sorted = self.colour.clone();
        sorted.sort_by(f32::total_cmp);
        let floor = sorted[sorted.len() * 9 / 10] * UNSEEN;
        drop(sorted);
        let guessed: f64 = (0..n).map(|i| f64::from(unscaled_guess(geometry, i))).sum();
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let unit = (total / guessed.max(LEAST_TOTAL)) as f32;
        let mixed: Vec<f32> = (0..n)
            .map(|i| {
                let guessed = (unscaled_guess(geometry, i) * unit).max(f32::MIN_POSITIVE);
                let seen = self.colour[i].max(floor).max(f32::MIN_POSITIVE);
                let mixed = maths::exp((1.0 - share) * maths::ln(seen) + share * maths::ln(guessed));
                mixed.max(LEAST_OF_GUESS * guessed)
            })
            .collect();
        #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
        let back = (total / mixed.iter().map(|&v| f64::from(v)).sum::<f64>()) as f32;
        for (i, &mixed) in mixed.iter().enumerate() {
            let wanted = mixed * back;
            let seen = self.colour[i];
            if seen <= floor {
                self.set_guess(geometry, i, wanted);
                continue;
            }
            let factor = wanted / seen;
            self.colour[i] = wanted;
            self.opacity[i] *= factor;
            let rows = self.position[i].iter_mut().chain(&mut self.scale[i]).chain(&mut self.rotation[i]);
            rows.for_each(|v| *v *= factor);
        }
    }
}

/// Returns `sum` plus the guessed sensitivities of all Gaussians, before they are scaled. They are added one after the
/// other.
pub(crate) fn guessed_total(sum: f64, geometry: &Geometry) -> f64 {
    (0..geometry.len()).fold(sum, |sum, i| sum + f64::from(unscaled_guess(geometry, i)))
}

/// Returns the guessed sensitivity to the colour of Gaussian `i`, before it is scaled.
fn unscaled_guess(geometry: &Geometry, i: usize) -> f32 {
    let scales = geometry.scales[i];
    let [longest, middle, _] = maths::longest_first(scales).map(|k| scales[k]);
    let alpha = maths::log_sigmoid(geometry.opacities[i]);
    let guess = maths::exp(ALPHA_POWER * alpha + AREA_POWER * (longest + middle));
    if guess.is_finite() { guess } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_sensitivity_is_far_below_the_guess() {
        let geometry = crate::support::testing::scene(400, 5).geometry;
        let guessed = Sensitivity::guess(&geometry);
        let mut measured = guessed.clone();
        // The views saw only the first half of the scene, and hardly saw one of its Gaussians.
        for (i, colour) in measured.colour.iter_mut().enumerate() {
            *colour *= if i < 200 { 1.0 } else { 1e-9 };
        }
        measured.colour[7] *= 1e-3;
        measured.blend_with_prior(&geometry, 0.3);
        let total = |s: &Sensitivity| s.colour.iter().map(|&w| f64::from(w)).sum::<f64>();
        let unit = total(&measured) / total(&guessed);
        let shares = (0..400).map(|i| f64::from(measured.colour[i]) / (f64::from(guessed.colour[i]) * unit));
        let least = shares.fold(f64::INFINITY, f64::min);
        // The sum of all sensitivities is kept, which changes each of them a little.
        let expected = f64::from(LEAST_OF_GUESS);
        assert!((0.8 * expected..1.25 * expected).contains(&least), "{least}");
    }
}
