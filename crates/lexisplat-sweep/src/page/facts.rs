//! What the page's summary says, computed once.

use lexisplat::packed::Preset;

use crate::grid::{Grid, quotient};
use crate::tables::change;
use crate::{Point, Results, SceneResult, Setting};
use lexisplat_eval::Summary;

/// The preset that the summary tells of: the default of packed files.
const TOLD: Preset = Preset::Balanced;

/// Means over every model that was compressed in one way.
pub(super) struct Means {
    pub(super) setting: Setting,
    pub(super) psnr: Option<f64>,
    /// PLY bytes over file bytes.
    pub(super) whole: Option<f64>,
    /// The paper's ratio.
    pub(super) coefficients: Option<f64>,
    /// Frames from codes over frames from dense SH.
    pub(super) speedup: Option<f64>,
    /// Change of PSNR against photos, in dB.
    pub(super) photos: Summary,
}

pub(super) struct Facts<'a> {
    pub(super) results: &'a Results,
    pub(super) grid: Grid<'a>,
    pub(super) main: Option<Means>,
    pub(super) packed: Option<Means>,
}

impl<'a> Facts<'a> {
    pub(super) fn new(results: &'a Results) -> Self {
        let grid = Grid::new(results);
        let main = grid.main_setting().map(|setting| means(&grid, setting));
        let told = Setting::Preset(TOLD);
        let packed = grid.settings.contains(&told).then(|| means(&grid, told));
        Self { results, grid, main, packed }
    }
}

fn means(grid: &Grid<'_>, setting: Setting) -> Means {
    let points: Vec<(&SceneResult, &Point)> = grid
        .scenes()
        .filter_map(|(_, scene)| Some((scene, scene.points.iter().find(|p| p.setting == setting)?)))
        .collect();
    let mean = |value: &dyn Fn(&SceneResult, &Point) -> Option<f64>| {
        Summary::of(points.iter().filter_map(|(scene, point)| value(scene, point))).mean
    };
    Means {
        setting,
        psnr: mean(&|_, point| point.to_original.psnr.mean),
        whole: mean(&|scene, point| quotient(scene.ply_bytes as f64, point.file_bytes as f64)),
        coefficients: mean(&|_, point| point.coefficient_ratio),
        speedup: mean(&|_, point| point.fps.and_then(|fps| quotient(fps.sparse, fps.dense))),
        photos: Summary::of(points.iter().filter_map(|(scene, point)| change(scene, point))),
    }
}
