//! What settings come to on average: the points of lines in figures.

use super::grid::{Grid, quotient};
use super::{Method, Point, SceneResult, Setting};
use lexisplat_eval::Summary;

/// One setting of a method, averaged over scenes or of one scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct At {
    pub(super) setting: Setting,
    /// The paper's ratio; `None` where nothing is coded.
    pub(super) ratio: Option<f64>,
    /// Against the original, in dB: over scenes, or over the views of one. All `None` if pictures are identical.
    pub(super) psnr: Summary,
    /// Bytes of the whole file over Gaussians.
    pub(super) bytes_each: Option<f64>,
    /// Frames a second from codes.
    pub(super) fps: Option<f64>,
    /// Frames a second of the original from dense SH.
    pub(super) fps_dense: Option<f64>,
}

/// Kinds of settings that make a line each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Tolerances,
    Caps,
    Presets,
}

impl Kind {
    pub(super) const ALL: [Self; 3] = [Self::Tolerances, Self::Caps, Self::Presets];

    fn of(setting: Setting) -> Self {
        match setting {
            Setting::Tolerance(_) => Self::Tolerances,
            Setting::MaxNonzeros(_) => Self::Caps,
            Setting::Preset(_) => Self::Presets,
        }
    }
}

fn mean(values: impl IntoIterator<Item = Option<f64>>) -> Option<f64> {
    Summary::of(values.into_iter().flatten().filter(|value| value.is_finite())).mean
}

/// The settings of a kind, close to the original first. Over all scenes, or of one column's.
pub(super) fn curve(grid: &Grid<'_>, method: Method, kind: Kind, column: Option<usize>) -> Vec<At> {
    let columns: Vec<usize> = column.map_or_else(|| (0..grid.columns.len()).collect(), |column| vec![column]);
    let of_setting = |&setting: &Setting| {
        let found: Vec<(&SceneResult, &Point)> = columns
            .iter()
            .filter_map(|&k| Some((grid.scene(method, k)?, grid.point(method, k, setting)?)))
            .collect();
        let (_, point) = *found.first()?;
        let psnr = if column.is_some() {
            point.to_original.psnr
        } else {
            Summary::of(found.iter().filter_map(|(_, point)| point.to_original.psnr.mean))
        };
        Some(At {
            setting,
            ratio: mean(found.iter().map(|(_, point)| point.coefficient_ratio)),
            psnr,
            bytes_each: mean(
                found.iter().map(|(scene, point)| quotient(point.file_bytes as f64, scene.gaussians as f64)),
            ),
            fps: mean(found.iter().map(|(_, point)| point.fps.map(|fps| fps.sparse))),
            fps_dense: mean(found.iter().map(|(_, point)| point.fps.map(|fps| fps.dense))),
        })
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
        assert_eq!(over_scenes[0].psnr, Summary { mean: Some(42.0), min: Some(40.0), max: Some(44.0) });
        assert_eq!(
            [over_scenes[0].ratio, over_scenes[0].fps, over_scenes[0].fps_dense, over_scenes[0].bytes_each],
            [Some(6.0), Some(8.0), Some(6.0), Some(100.0)]
        );
        assert_eq!(over_scenes[1].fps, None);
        let one = curve(&grid, Method::Mcmc, Kind::Tolerances, Some(0));
        assert_eq!(one[0].psnr, Summary { mean: Some(44.0), min: Some(43.0), max: Some(45.0) });
        let caps = curve(&grid, Method::Gs3d, Kind::Caps, None);
        assert_eq!(caps.iter().map(|at| at.ratio).collect::<Vec<_>>(), [Some(11.25), Some(50.0), None]);
        assert_eq!(curve(&grid, Method::Gs3d, Kind::Presets, None).len(), 2);
        assert!(curve(&grid, Method::Eagles, Kind::Tolerances, None).is_empty());
    }
}
