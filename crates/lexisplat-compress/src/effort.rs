//! How long refining takes.

use std::str::FromStr;

use crate::error::{Error, Result};

/// Name of the choice in errors.
pub(crate) const REFINE: &str = "refine";
/// Steps of the fit of all values with [`Refine::Quick`] and [`Refine::Thorough`].
const QUICK: usize = 800;
const THOROUGH: usize = 3200;
/// Number of these steps from which more Gaussians can go, because the steps win back more.
const MANY: usize = 2000;
/// Amounts by which the quality of the Gaussians that stay may fall short of the quality asked for before the first fit, in dB,
/// with given cameras: of less than [`MANY`] steps, and of others.
const FEW_BELOW: f64 = 1.8;
const MANY_BELOW: f64 = 2.5;
/// Steps of the other two fits, as shares of the steps of the first.
const RADIANCE: f64 = 0.6;
const APPEARANCE: f64 = 0.2;
/// Time of a step in seconds on one thread of a server processor of 2024 with AVX-512, by steps on bonsai-3dgs and
/// room-large: for each pixel of its view, and for each Gaussian of the scene.
const SECONDS_PER_PIXEL: f64 = 1.2e-7;
const SECONDS_PER_GAUSSIAN: f64 = 2e-7;
/// Usual number of files that are refined until one meets a target.
const FILES: f64 = 2.5;
/// Most steps, with which any scene takes days.
const MOST: f64 = 1e7;

/// The effort of refining (docs/METHOD.md, "Refining"). Each choice is a number of steps, so that the same choice gives the
/// same file on any machine.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Refine {
    /// A quarter of the steps of [`Self::Thorough`]. With given cameras more Gaussians stay.
    Quick,
    /// The steps after which more gain little.
    Thorough,
    /// As many steps as take about this many minutes on one thread, above 0. The steps are estimated from the scene and its
    /// views, not from a clock.
    Minutes(f64),
}

impl FromStr for Refine {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let minutes = || text.parse().ok().filter(|&minutes: &f64| minutes.is_finite() && minutes > 0.0);
        match text {
            "quick" => Ok(Self::Quick),
            "thorough" => Ok(Self::Thorough),
            _ => minutes().map(Self::Minutes).ok_or_else(|| {
                Error::parameter(REFINE, text, "quick, thorough or a number of minutes above 0, such as 5")
            }),
        }
    }
}

/// Numbers of steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RefineSteps {
    /// Of the fit of all values, before quantisation.
    pub(crate) all: usize,
    /// Of the fit of SH-rest, base colours and opacities to quantised positions and shapes.
    pub(crate) radiance: usize,
    /// Of the fit of base colours and opacities to quantised SH-rest.
    pub(crate) appearance: usize,
}

impl RefineSteps {
    /// Returns the amount by which the quality of the Gaussians that stay may fall short of the quality asked for before the
    /// first fit, in dB, with given cameras.
    pub(crate) fn below(self) -> f64 {
        if self.all < MANY { FEW_BELOW } else { MANY_BELOW }
    }
}

impl Refine {
    /// Returns an error for minutes out of range.
    pub(crate) fn check(self) -> Result<()> {
        match self {
            Self::Minutes(minutes) if !(minutes.is_finite() && minutes > 0.0) => {
                Err(Error::parameter(REFINE, minutes, "minutes above 0"))
            }
            _ => Ok(()),
        }
    }

    /// Returns the effort for a part of `part` Gaussians of a scene of `gaussians` Gaussians. All parts together take the minutes.
    pub(crate) fn of_part(self, part: usize, gaussians: usize) -> Self {
        match self {
            Self::Minutes(minutes) => Self::Minutes(minutes * part as f64 / gaussians.max(1) as f64),
            other => other,
        }
    }

    /// Returns the numbers of steps for views of `pixels` pixels each and a scene of `gaussians` Gaussians.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 1 and `MOST`")]
    pub(crate) fn steps(self, pixels: f64, gaussians: usize) -> RefineSteps {
        let all = match self {
            Self::Quick => QUICK as f64,
            Self::Thorough => THOROUGH as f64,
            Self::Minutes(minutes) => {
                let step = SECONDS_PER_PIXEL * pixels + SECONDS_PER_GAUSSIAN * gaussians as f64;
                60.0 * minutes / (step * (1.0 + FILES * (RADIANCE + APPEARANCE)))
            }
        };
        let share = |share: f64| (share * all).clamp(1.0, MOST).round() as usize;
        RefineSteps { all: share(1.0), radiance: share(RADIANCE), appearance: share(APPEARANCE) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn efforts_have_names_and_minutes() {
        assert_eq!("quick".parse::<Refine>().unwrap(), Refine::Quick);
        assert_eq!("thorough".parse::<Refine>().unwrap(), Refine::Thorough);
        assert_eq!("2.5".parse::<Refine>().unwrap(), Refine::Minutes(2.5));
        for wrong in ["", "slow", "0", "-1", "nan", "inf"] {
            assert!(wrong.parse::<Refine>().unwrap_err().to_string().contains("quick, thorough"), "{wrong}");
        }
        assert!(Refine::Minutes(f64::NAN).check().is_err() && Refine::Quick.check().is_ok());
    }

    #[test]
    fn twice_the_minutes_are_twice_the_steps() {
        let of = |minutes| Refine::Minutes(minutes).steps(1e5, 50_000);
        let (one, two) = (of(1.0), of(2.0));
        assert!(one.all > 100 && one.radiance < one.all && one.appearance < one.radiance, "{one:?}");
        assert!(two.all.abs_diff(2 * one.all) <= 1, "{one:?} {two:?}");
        assert_eq!(of(1e-12), RefineSteps { all: 1, radiance: 1, appearance: 1 });
        assert!(of(1e-12).below() < of(1e9).below());
        assert_eq!(of(1e300).all, 10_000_000);
        assert_eq!(Refine::Minutes(4.0).of_part(100, 400), Refine::Minutes(1.0));
        assert_eq!(Refine::Quick.of_part(100, 400), Refine::Quick);
    }
}
