//! What a Gaussian shows, apart from its shape and its view-dependent colour.

use super::canonical::MIN_LOG_OPACITY;
use crate::scene::splats::{Geometry, all_finite};
use crate::support::error::{Error, Result};
use crate::support::maths::{log_sigmoid, logit_of_log};

/// Largest logarithm of an opacity. Its exponential, 0.9999, counts as opaque.
pub(super) const MAX_LOG_OPACITY: f32 = -1e-4;

/// The base colour and the opacity of a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Appearance {
    /// SH coefficients of degree 0.
    pub dc: [f32; 3],
    /// Natural logarithm of the opacity after the sigmoid; at most 0.
    pub log_opacity: f32,
}

/// By how much the look of a Gaussian changes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AppearanceChange {
    /// SH coefficients of degree 0.
    pub dc: [f32; 3],
    /// Natural logarithm of the opacity after the sigmoid.
    pub log_opacity: f32,
}

impl AppearanceChange {
    /// Refuses values that are not finite.
    pub(super) fn check(&self) -> Result<()> {
        let opacity = std::slice::from_ref(&self.log_opacity);
        all_finite([("changes of base colours", self.dc.as_slice()), ("changes of opacities", opacity)])
    }
}

impl Appearance {
    /// That of Gaussian `i` of `geometry`. The logarithm of its opacity is not below -100.
    ///
    /// # Panics
    /// If there is no Gaussian `i`.
    #[must_use]
    pub fn of(geometry: &Geometry, i: usize) -> Self {
        Self { dc: geometry.dc[i], log_opacity: log_sigmoid(geometry.opacities[i]).max(MIN_LOG_OPACITY) }
    }

    /// Gives it to Gaussian `i` of `geometry`. The logarithm of the opacity is then not above -0.0001.
    ///
    /// # Panics
    /// If there is no Gaussian `i`.
    pub fn give(self, geometry: &mut Geometry, i: usize) {
        geometry.dc[i] = self.dc;
        geometry.opacities[i] = logit_of_log(self.log_opacity.min(MAX_LOG_OPACITY));
    }

    /// Refuses values that are not finite, and opacities above 1.
    pub(super) fn check(&self) -> Result<()> {
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
    fn what_cannot_be_is_refused() {
        let good = Appearance { dc: [0.0; 3], log_opacity: 0.0 };
        good.check().unwrap();
        let refused = |appearance: Appearance| appearance.check().unwrap_err().to_string();
        assert!(refused(Appearance { dc: [0.0, f32::NAN, 0.0], ..good }).contains("base colours"));
        assert!(refused(Appearance { log_opacity: f32::NEG_INFINITY, ..good }).contains("opacities"));
        assert!(refused(Appearance { log_opacity: 0.1, ..good }).contains("at most 0"));
    }
}
