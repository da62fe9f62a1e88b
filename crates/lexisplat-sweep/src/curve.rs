//! Means at each setting, which are the points of lines in figures.

use lexisplat_eval::{FrameRate, Summary};

use super::grid::Grid;
use super::measure::{Measure, mean};
use super::{Fps, Method, Point, SceneResult, Setting};

/// The models of one method at one setting: those of all scenes, or that of one scene.
#[derive(Debug, Clone)]
pub(super) struct At<'a> {
    pub(super) setting: Setting,
    models: Vec<(&'a SceneResult, &'a Point)>,
    /// Whether there is only one scene. Its quality is then summarised over its views.
    one_scene: bool,
}

impl At<'_> {
    /// Returns PSNR against the original, in dB, over scenes or over the views of a single scene. All values are `None`
    /// if the pictures are identical.
    pub(super) fn psnr(&self) -> Summary {
        match self.models.as_slice() {
            [(_, point)] if self.one_scene => point.to_original.psnr,
            models => Summary::of(models.iter().filter_map(|(_, point)| point.to_original.psnr.mean)),
        }
    }

    /// Returns the mean of a measure over the scenes that have it.
    pub(super) fn mean(&self, measure: Measure) -> Option<f64> {
        mean(self.models.iter().filter_map(|(scene, point)| measure.value(scene, Some(point))))
    }

    /// Returns the mean of the slowest rounds and the mean of the fastest rounds of a rate, over the scenes that have it.
    pub(super) fn rounds(&self, rate: fn(&Fps) -> FrameRate) -> Option<(f64, f64)> {
        let rates: Vec<FrameRate> =
            self.models.iter().filter_map(|(_, point)| point.fps.as_ref().map(rate)).collect();
        Some((mean(rates.iter().map(|rate| rate.least))?, mean(rates.iter().map(|rate| rate.most))?))
    }

    /// Returns the paper's ratio; `None` if nothing is coded.
    pub(super) fn ratio(&self) -> Option<f64> {
        self.mean(Measure::CoefficientRatio)
    }
}

/// Kinds of settings. Each kind makes a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Tolerances,
    Caps,
    Presets,
}

impl Kind {
    pub(super) const ALL: [Self; 3] = [Self::Tolerances, Self::Caps, Self::Presets];

    pub(super) fn of(setting: Setting) -> Self {
        match setting {
            Setting::Tolerance(_) => Self::Tolerances,
            Setting::MaxNonzeros(_) => Self::Caps,
            Setting::Preset(_) => Self::Presets,
        }
    }
}

/// Returns the settings of a kind, in ascending distance from the original, over all scenes or for the scene of one
/// column.
pub(super) fn curve<'a>(grid: &Grid<'a>, method: Method, kind: Kind, column: Option<usize>) -> Vec<At<'a>> {
    let scenes = grid.models(method, column);
    let of_setting = |&setting: &Setting| {
        let models: Vec<_> =
            scenes.iter().filter_map(|scene| Some((*scene, scene.point(setting)?))).collect();
        (!models.is_empty()).then_some(At { setting, models, one_scene: column.is_some() })
    };
    grid.settings.iter().filter(|&&setting| Kind::of(setting) == kind).filter_map(of_setting).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::results;
    use super::*;

    #[test]
    fn a_point_is_the_mean_over_scenes() {
        let results = results();
        let grid = Grid::new(&results);
        let over_scenes = curve(&grid, Method::Mcmc, Kind::Tolerances, None);
        assert_eq!(over_scenes.len(), 2);
        // Two scenes: 44 and 40 dB, ratios 3 and 9.
        assert_eq!(over_scenes[0].psnr(), Summary { mean: Some(42.0), min: Some(40.0), max: Some(44.0) });
        assert_eq!(
            [Measure::CoefficientRatio, Measure::SparseFps, Measure::DenseFps, Measure::BytesEach]
                .map(|measure| over_scenes[0].mean(measure)),
            [Some(6.0), Some(8.0), Some(6.0), Some(100.0)]
        );
        assert_eq!(over_scenes[1].mean(Measure::SparseFps), None);
        let one = curve(&grid, Method::Mcmc, Kind::Tolerances, Some(0));
        assert_eq!(one[0].psnr(), Summary { mean: Some(44.0), min: Some(43.0), max: Some(45.0) });
        let caps = curve(&grid, Method::Gs3d, Kind::Caps, None);
        assert_eq!(
            caps.iter().map(|at| at.mean(Measure::CoefficientRatio)).collect::<Vec<_>>(),
            [Some(11.25), Some(50.0), None]
        );
        assert_eq!(curve(&grid, Method::Gs3d, Kind::Presets, None).len(), 2);
        assert!(curve(&grid, Method::Eagles, Kind::Tolerances, None).is_empty());
    }
}
