//! Results as a grid: one row for each method, one column for each scene, settings in order.

use lexisplat_eval::metrics::Metric;

use super::measure::{IDENTICAL, Measure};
use super::table::{Cell, Column};
use super::{Method, Point, Results, SceneResult, Setting, paper};

/// The methods, scenes and settings of a sweep, in the order of tables.
pub(super) struct Grid<'a> {
    /// Headings of the columns of scenes, in the manifest's order.
    pub(super) headings: Vec<String>,
    /// The scenes' own names, column by column.
    names: Vec<&'a str>,
    /// Methods that have a model, in the paper's order.
    pub(super) methods: Vec<Method>,
    /// Settings that have a point: tolerances from small to large, then caps from many to few nonzeros, then presets
    /// from large to small files.
    pub(super) settings: Vec<Setting>,
    cells: Vec<(usize, &'a SceneResult)>,
    /// The pursuit of all points with exact geometry.
    pursuit: &'a str,
}

/// A key that sorts settings by kind, then from close to the original to far from it.
fn order(setting: Setting) -> (u8, f64) {
    match setting {
        Setting::Tolerance(tolerance) => (0, tolerance),
        Setting::MaxNonzeros(most) => (1, -f64::from(most)),
        Setting::Preset(preset) => (2, -preset.decibels()),
    }
}

/// Whether two results are of one scene: the same name, and data sets that do not contradict each other.
fn same_scene(a: &SceneResult, b: &SceneResult) -> bool {
    a.name.to_lowercase() == b.name.to_lowercase()
        && (a.dataset.is_empty()
            || b.dataset.is_empty()
            || a.dataset.to_lowercase() == b.dataset.to_lowercase())
}

impl<'a> Grid<'a> {
    pub(super) fn new(results: &'a Results) -> Self {
        // The first scene of a column names it. A column has at most one scene of each method.
        let mut first: Vec<&SceneResult> = Vec::new();
        let mut cells: Vec<(usize, &SceneResult)> = Vec::new();
        for scene in &results.scenes {
            let taken = |column| cells.iter().any(|(k, other)| *k == column && other.method == scene.method);
            let column = (0..first.len())
                .find(|&column| same_scene(first[column], scene) && !taken(column))
                .unwrap_or_else(|| {
                    first.push(scene);
                    first.len() - 1
                });
            cells.push((column, scene));
        }
        let mut headings: Vec<String> = Vec::new();
        for scene in &first {
            let mut heading = scene.name.clone();
            if headings.contains(&heading) && !scene.dataset.is_empty() {
                heading = format!("{} ({})", scene.name, scene.dataset);
            }
            let plain = heading.clone();
            let mut copy = 2;
            while headings.contains(&heading) {
                heading = format!("{plain} ({copy})");
                copy += 1;
            }
            headings.push(heading);
        }
        let points = results.scenes.iter().flat_map(|scene| &scene.points);
        let mut settings: Vec<Setting> = points.map(|point| point.setting).collect();
        settings.sort_by(|a, b| {
            let (a, b) = (order(*a), order(*b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        settings.dedup();
        let methods = Method::ALL
            .into_iter()
            .filter(|method| results.scenes.iter().any(|scene| scene.method == *method))
            .collect();
        let names = first.iter().map(|scene| scene.name.as_str()).collect();
        Self { headings, names, methods, settings, cells, pursuit: &results.pursuit }
    }

    /// The name of a column's scene without what makes its heading unique. Empty beyond the last column.
    pub(super) fn name(&self, column: usize) -> &'a str {
        self.names.get(column).copied().unwrap_or_default()
    }

    /// What rows of the paper's numbers for `name` are called. Beside another pursuit than the paper's its own is named.
    pub(super) fn paper_label(&self, name: &str) -> String {
        let pursuit = if self.pursuit == paper::PURSUIT { "" } else { " (OMP)" };
        format!("{name}, paper{pursuit}")
    }

    /// The model of a method in a column.
    pub(super) fn scene(&self, method: Method, column: usize) -> Option<&'a SceneResult> {
        self.cells.iter().find(|(k, scene)| *k == column && scene.method == method).map(|(_, scene)| *scene)
    }

    /// The same model at one setting.
    pub(super) fn point(
        &self,
        method: Method,
        column: usize,
        setting: Setting,
    ) -> Option<(&'a SceneResult, &'a Point)> {
        let scene = self.scene(method, column)?;
        Some((scene, scene.point(setting)?))
    }

    /// All models of a method at one setting, in the order of columns.
    pub(super) fn points(
        &self,
        method: Method,
        setting: Setting,
    ) -> impl Iterator<Item = (&'a SceneResult, &'a Point)> {
        (0..self.headings.len()).filter_map(move |column| self.point(method, column, setting))
    }

    /// Models column by column with their heading, methods in order within a column.
    pub(super) fn scenes(&self) -> impl Iterator<Item = (&str, &'a SceneResult)> {
        self.headings.iter().enumerate().flat_map(move |(column, heading)| {
            self.methods
                .iter()
                .filter_map(move |&method| Some((heading.as_str(), self.scene(method, column)?)))
        })
    }

    /// The settings that models of a method were compressed at.
    pub(super) fn settings_of(&self, method: Method) -> impl Iterator<Item = Setting> {
        self.settings.iter().copied().filter(move |&setting| self.points(method, setting).next().is_some())
    }

    /// Columns of a table with `labels`, one cell for each scene, and the mean.
    pub(super) fn columns(&self, labels: &[&str]) -> Vec<Column> {
        let labels = labels.iter().copied().map(Column::new);
        let scenes = self.headings.iter().map(Column::new);
        labels.chain(scenes).chain([Column::new("Mean")]).collect()
    }

    /// One cell for each column, then their mean.
    pub(super) fn across(&self, cell: impl FnMut(usize) -> Cell) -> Vec<Cell> {
        let mut cells: Vec<Cell> = (0..self.headings.len()).map(cell).collect();
        cells.push(mean(&cells));
        cells
    }

    /// A measure of a method in each column, then the mean. Without a setting it is that of the models as trained.
    pub(super) fn measured(&self, measure: Measure, method: Method, setting: Option<Setting>) -> Vec<Cell> {
        self.across(|column| {
            let Some(scene) = self.scene(method, column) else { return Cell::Missing };
            match setting.map(|setting| scene.point(setting)) {
                None => measure.cell(scene, None),
                Some(Some(point)) => measure.cell(scene, Some(point)),
                Some(None) => Cell::Missing,
            }
        })
    }

    /// The tolerance that is nearest to the paper's main one.
    pub(super) fn main_setting(&self) -> Option<Setting> {
        let apart = |setting: &Setting| match setting {
            Setting::Tolerance(tolerance) => Some((tolerance - paper::TOLERANCE).abs()),
            _ => None,
        };
        let tolerances = self.settings.iter().filter_map(|setting| Some((*setting, apart(setting)?)));
        tolerances.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(setting, _)| setting)
    }

    /// The scores of one kind that any model has, in the order of tables.
    pub(super) fn scores(&self, kind: fn(Metric) -> Measure) -> Vec<Measure> {
        let any = |measure: &Measure| {
            self.cells.iter().any(|(_, scene)| {
                let points = scene.points.iter().map(Some).chain([None]);
                points.into_iter().any(|point| measure.is_measured(scene, point))
            })
        };
        Metric::ALL.into_iter().map(kind).filter(any).collect()
    }

    /// The device that FPS were measured on, for headings: `CPU`, a GPU's name, or `several devices`. Empty if
    /// none were measured.
    pub(super) fn device(&self) -> &'a str {
        let timed =
            self.cells.iter().filter(|(_, scene)| scene.points.iter().any(|point| point.fps.is_some()));
        let mut names: Vec<&str> =
            timed.map(|(_, scene)| if scene.on_gpu { scene.device.as_str() } else { "CPU" }).collect();
        names.sort_unstable();
        names.dedup();
        match names.as_slice() {
            [name] => name,
            [] => "",
            _ => "several devices",
        }
    }
}

/// The mean of the numbers among `cells`, with their digits. Words and missing values do not count. Without
/// numbers it is [`IDENTICAL`] if any cell is.
pub(super) fn mean(cells: &[Cell]) -> Cell {
    let values: Vec<f64> = cells.iter().filter_map(Cell::value).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let number = cells.iter().find(|cell| matches!(cell, Cell::Number { .. }));
    let identical = || cells.iter().find(|cell| **cell == Cell::text(IDENTICAL));
    match number.or_else(identical) {
        Some(&Cell::Number { digits, signed, .. }) => Cell::Number { value: mean, digits, signed },
        other => other.cloned().unwrap_or(Cell::Missing),
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::packed::Preset;

    use super::super::testing::{results, scene};
    use super::*;

    #[test]
    fn scenes_of_one_name_share_a_column_unless_they_cannot() {
        let mut results = Results::default();
        for (dataset, name, method) in [
            ("a", "Room", Method::Gs3d),
            ("", "room", Method::Mcmc),
            ("b", "room", Method::Gs3d),
            ("A", "ROOM", Method::PixelGs),
            ("a", "Room", Method::Gs3d),
        ] {
            results.scenes.push(scene(dataset, name, method));
        }
        let grid = Grid::new(&results);
        assert_eq!(grid.headings, ["Room", "room", "Room (a)"]);
        assert_eq!(grid.scene(Method::Mcmc, 0).unwrap().name, "room");
        assert_eq!(grid.scene(Method::PixelGs, 0).unwrap().name, "ROOM");
        assert_eq!(grid.scene(Method::Gs3d, 1).unwrap().dataset, "b");
        assert!(grid.scene(Method::PixelGs, 1).is_none());
        assert_eq!(grid.scenes().count(), results.scenes.len(), "none is lost");
    }

    #[test]
    fn settings_go_from_close_to_far() {
        let results = results();
        let grid = Grid::new(&results);
        assert_eq!(
            grid.settings,
            [
                Setting::Tolerance(0.05),
                Setting::Tolerance(0.1),
                Setting::Tolerance(1.0),
                Setting::MaxNonzeros(4),
                Setting::MaxNonzeros(1),
                Setting::MaxNonzeros(0),
                Setting::Preset(Preset::High),
                Setting::Preset(Preset::Small),
            ]
        );
        assert_eq!(grid.main_setting(), Some(Setting::Tolerance(0.1)));
        assert_eq!(grid.methods, [Method::Gs3d, Method::Mcmc, Method::Eagles, Method::EaglesNoSq]);
    }

    #[test]
    fn means_skip_what_is_missing() {
        let number = |v| Cell::number(Some(v), 2);
        assert_eq!(mean(&[number(1.0), Cell::Missing, number(4.0), Cell::text(IDENTICAL)]), number(2.5));
        assert_eq!(mean(&[Cell::Missing, Cell::text(IDENTICAL)]), Cell::text(IDENTICAL));
        assert_eq!(mean(&[Cell::Missing]), Cell::Missing);
        assert_eq!(mean(&[Cell::change(Some(-1.0), 1)]), Cell::change(Some(-1.0), 1));
    }
}
