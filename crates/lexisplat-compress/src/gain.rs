//! The gain of quality by refitting.

/// Share of what quantisation loses that fits of a refined scene win back, about: with given cameras and with found views.
const REFINED_GIVEN: f64 = 0.35;
const REFINED_FOUND: f64 = 0.03;
/// Least loss by quantisation from which a share is measured, in dB.
const LEAST_LOSS: f64 = 0.5;
/// Largest share that is expected after a measurement.
const MOST_SHARE: f64 = 0.8;

/// The gain of quality by refitting, expected or measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Gain {
    /// The same amount at every step.
    Amount(f64),
    /// A share of what quantisation loses of a quality.
    Share {
        share: f64,
        /// The quality before quantisation, in dB.
        of: f64,
    },
}

impl Gain {
    /// Returns the expected gain of a refined scene, whose quality before quantisation is `of`. `given` tells whether cameras were
    /// given or found.
    pub(crate) fn refined(of: f64, given: bool) -> Self {
        Self::Share { share: if given { REFINED_GIVEN } else { REFINED_FOUND }, of }
    }

    /// Returns the value after refitting of a file that has the value `plain` without.
    pub(crate) fn after(self, plain: f64) -> f64 {
        match self {
            Self::Amount(amount) => plain + amount,
            Self::Share { share, of } => plain + share * (of - plain),
        }
    }

    /// Returns the value without refitting of a file that has this `value` after it.
    pub(crate) fn before(self, value: f64) -> f64 {
        match self {
            Self::Amount(amount) => value - amount,
            Self::Share { share, of } => (value - share * of) / (1.0 - share),
        }
    }

    /// Returns the gain of a file that has the value `plain` without refitting, and this `value` after it.
    pub(crate) fn measured(self, plain: f64, value: f64) -> Self {
        match self {
            Self::Share { of, .. } if of - plain > LEAST_LOSS => {
                Self::Share { share: ((value - plain) / (of - plain)).min(MOST_SHARE), of }
            }
            _ => Self::Amount(value - plain),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn before_is_the_inverse_of_after() {
        for gain in [Gain::Amount(2.5), Gain::refined(43.0, true), Gain::refined(39.0, false)] {
            for plain in [30.0, 39.0, 50.0] {
                assert!((gain.before(gain.after(plain)) - plain).abs() < 1e-9, "{gain:?}");
            }
        }
    }

    #[test]
    fn measured_gains_give_what_was_measured() {
        for gain in [Gain::Amount(2.5), Gain::refined(43.0, true)] {
            for (plain, value) in [(37.0, 39.5), (40.0, 39.8), (44.0, 44.1)] {
                let measured = gain.measured(plain, value);
                assert!((measured.after(plain) - value).abs() < 1e-9, "{measured:?}");
            }
        }
        // A finer step loses less, so it gains less.
        let gain = Gain::refined(43.0, true).measured(37.0, 39.5);
        assert!(gain.after(40.0) < 42.0 && gain.after(40.0) > 41.0, "{gain:?}");
        // Nearly all of a loss is not expected again.
        assert!(Gain::refined(43.0, true).measured(30.0, 44.0).after(40.0) < 43.0);
    }
}
