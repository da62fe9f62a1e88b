//! The appearance of a Gaussian: its base colour and its opacity.

use super::canonical::MIN_LOG_OPACITY;
use crate::packed::bitstream::KINDS;
use crate::scene::splats::{Geometry, all_finite};
use crate::support::error::{Error, Result};
use crate::support::maths::{log_sigmoid, logit_of_log};

/// Largest logarithm of an opacity. Its exponential, 0.9999, counts as opaque.
const MAX_LOG_OPACITY: f32 = -1e-4;
/// Steps of the interim changes: of the natural logarithm of scales, of that of the opacity, and of SH coefficients of the
/// base colour.
pub(in crate::packed) const STEPS: [f64; KINDS] = [0.4, 0.5, 0.6];
/// Largest absolute number of steps of a change.
const MOST_STEPS: f64 = 1000.0;

/// The base colour and the opacity of a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Appearance {
    /// SH coefficients of degree 0.
    pub dc: [f32; 3],
    /// Natural logarithm of the opacity after the sigmoid; at most 0.
    pub log_opacity: f32,
}

/// The change of the appearance and the size of a Gaussian.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AppearanceChange {
    /// Change of the SH coefficients of degree 0.
    pub dc: [f32; 3],
    /// Change of the natural logarithm of the opacity after the sigmoid.
    pub log_opacity: f32,
    /// Change of the natural logarithms of all scales.
    pub log_scale: f32,
}

impl AppearanceChange {
    /// Rounds the changes of scales and of the opacity to the nearest ones that a file holds. The change of the base colour
    /// stays.
    #[must_use]
    pub fn rounded(self) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "to single precision")]
        let [log_scale, log_opacity] = [(self.log_scale, STEPS[0]), (self.log_opacity, STEPS[1])]
            .map(|(x, step)| (f64::from(steps(f64::from(x), step)) * step) as f32);
        Self { log_opacity, log_scale, ..self }
    }

    /// Applies the change to Gaussian `i` of `geometry`. The logarithm of its opacity is then at most -0.0001.
    ///
    /// # Panics
    /// If there is no Gaussian `i`.
    pub fn make(&self, geometry: &mut Geometry, i: usize) {
        let Appearance { dc, log_opacity } = Appearance::of(geometry, i);
        let dc = std::array::from_fn(|c| dc[c] + self.dc[c]);
        Appearance { dc, log_opacity: log_opacity + self.log_opacity }.give(geometry, i);
        geometry.scales[i].iter_mut().for_each(|scale| *scale += self.log_scale);
    }

    /// Refuses values that are not finite.
    pub(in crate::packed) fn check(&self) -> Result<()> {
        let [opacity, scale] = [&self.log_opacity, &self.log_scale].map(std::slice::from_ref);
        all_finite([
            ("changes of base colours", self.dc.as_slice()),
            ("changes of opacities", opacity),
            ("changes of scales", scale),
        ])
    }
}

/// Returns `x / step`, rounded to the nearest number of steps.
#[expect(clippy::cast_possible_truncation, reason = "clamped")]
pub(in crate::packed) fn steps(x: f64, step: f64) -> i32 {
    libm::rint(x / step).clamp(-MOST_STEPS, MOST_STEPS) as i32
}

impl Appearance {
    /// Returns the appearance of Gaussian `i` of `geometry`. A logarithm of its opacity below -100 becomes -100.
    ///
    /// # Panics
    /// If there is no Gaussian `i`.
    #[must_use]
    pub fn of(geometry: &Geometry, i: usize) -> Self {
        Self { dc: geometry.dc[i], log_opacity: log_sigmoid(geometry.opacities[i]).max(MIN_LOG_OPACITY) }
    }

    /// Sets the appearance of Gaussian `i` of `geometry`. The logarithm of its opacity is then at most -0.0001.
    ///
    /// # Panics
    /// If there is no Gaussian `i`.
    pub fn give(self, geometry: &mut Geometry, i: usize) {
        geometry.dc[i] = self.dc;
        geometry.opacities[i] = logit_of_log(self.log_opacity.min(MAX_LOG_OPACITY));
    }

    /// Refuses values that are not finite, and opacities above 1.
    pub(in crate::packed) fn check(&self) -> Result<()> {
        let opacity = std::slice::from_ref(&self.log_opacity);
        all_finite([("base colours", self.dc.as_slice()), ("opacities", opacity)])?;
        match self.log_opacity > 0.0 {
            true => Err(Error::parameter("logarithm of an opacity", self.log_opacity, "at most 0")),
            false => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_is_found() {
        let mut geometry = crate::support::testing::scene(3, 1).geometry;
        let given = Appearance { dc: [0.1, -2.0, 3.0], log_opacity: -0.7 };
        given.give(&mut geometry, 1);
        let found = Appearance::of(&geometry, 1);
        assert!(found.dc == given.dc && (found.log_opacity - given.log_opacity).abs() < 1e-6, "{found:?}");
        Appearance { log_opacity: 0.0, ..given }.give(&mut geometry, 1);
        assert!(geometry.opacities[1].is_finite() && Appearance::of(&geometry, 1).log_opacity > -1.1e-4);
        geometry.opacities[1] = -1000.0;
        assert!((Appearance::of(&geometry, 1).log_opacity - MIN_LOG_OPACITY).abs() < 1e-6);
    }

    #[test]
    fn changes_are_rounded_and_made() {
        let change = AppearanceChange { dc: [0.1, 0.0, -0.2], log_opacity: -0.3, log_scale: 0.7 };
        let rounded = change.rounded();
        assert!(rounded.log_opacity == -0.5 && (rounded.log_scale - 0.8).abs() < 1e-6, "{rounded:?}");
        assert_eq!((rounded.dc, rounded.rounded()), (change.dc, rounded));
        let mut geometry = crate::support::testing::scene(3, 1).geometry;
        geometry.opacities[1] = 1.0;
        let (before, scales) = (Appearance::of(&geometry, 1), geometry.scales[1]);
        rounded.make(&mut geometry, 1);
        let after = Appearance::of(&geometry, 1);
        assert!((after.log_opacity - before.log_opacity + 0.5).abs() < 1e-6, "{after:?} {before:?}");
        assert!((after.dc[2] - before.dc[2] + 0.2).abs() < 1e-6, "{after:?} {before:?}");
        assert_eq!(geometry.scales[1], scales.map(|scale| scale + rounded.log_scale));
        AppearanceChange { log_opacity: 9.0, ..rounded }.make(&mut geometry, 1);
        assert!(geometry.opacities[1].is_finite());
        assert!(AppearanceChange { log_scale: f32::NAN, ..rounded }.check().is_err());
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let good = Appearance { dc: [0.0; 3], log_opacity: 0.0 };
        good.check().unwrap();
        let refused = |appearance: Appearance| appearance.check().unwrap_err().to_string();
        assert!(refused(Appearance { dc: [0.0, f32::NAN, 0.0], ..good }).contains("base colours"));
        assert!(refused(Appearance { log_opacity: f32::NEG_INFINITY, ..good }).contains("opacities"));
        assert!(refused(Appearance { log_opacity: 0.1, ..good }).contains("at most 0"));
    }
}
