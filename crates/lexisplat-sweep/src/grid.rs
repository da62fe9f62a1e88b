//! Results as a grid: methods down, scenes across, settings in a sensible order.

use super::table::Cell;
use super::{Method, Point, Results, SceneResult, Setting, paper};
use lexisplat_eval::Comparison;
use lexisplat_eval::metrics::Metric;

/// How methods, scenes and settings of a sweep stand to each other.
pub(super) struct Grid<'a> {
    /// Headings of the columns of scenes, in the manifest's order.
    pub(super) columns: Vec<String>,
    /// The scenes' own names, column by column.
    names: Vec<&'a str>,
    /// Methods there are, in the paper's order.
    pub(super) methods: Vec<Method>,
    /// Settings there are: tolerances from small to large, then caps from many to few nonzeros, then presets
    /// from large to small files.
    pub(super) settings: Vec<Setting>,
    cells: Vec<(usize, &'a SceneResult)>,
}

/// Sorts settings by kind, then from close to far from the original.
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
        // Each column is known by its first scene. A method has one scene in a column.
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
        let mut columns: Vec<String> = Vec::new();
        for scene in &first {
            let mut heading = scene.name.clone();
            if columns.contains(&heading) && !scene.dataset.is_empty() {
                heading = format!("{} ({})", scene.name, scene.dataset);
            }
            let plain = heading.clone();
            let mut copy = 2;
            while columns.contains(&heading) {
                heading = format!("{plain} ({copy})");
                copy += 1;
            }
            columns.push(heading);
        }
        let mut settings: Vec<Setting> = Vec::new();
        for point in results.scenes.iter().flat_map(|scene| &scene.points) {
            if !settings.contains(&point.setting) {
                settings.push(point.setting);
            }
        }
        settings.sort_by(|a, b| {
            let (a, b) = (order(*a), order(*b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        let methods = Method::ALL
            .into_iter()
            .filter(|method| results.scenes.iter().any(|scene| scene.method == *method))
            .collect();
        let names = first.iter().map(|scene| scene.name.as_str()).collect();
        Self { columns, names, methods, settings, cells }
    }

    /// The name of a column's scene, as its heading may not be; empty beyond the last.
    pub(super) fn name(&self, column: usize) -> &'a str {
        self.names.get(column).copied().unwrap_or_default()
    }

    /// The scene of a column by a method.
    pub(super) fn scene(&self, method: Method, column: usize) -> Option<&'a SceneResult> {
        self.cells.iter().find(|(k, scene)| *k == column && scene.method == method).map(|(_, scene)| *scene)
    }

    /// The same, compressed in a way.
    pub(super) fn point(&self, method: Method, column: usize, setting: Setting) -> Option<&'a Point> {
        self.scene(method, column)?.points.iter().find(|point| point.setting == setting)
    }

    /// Scenes column by column with their heading, methods in order within.
    pub(super) fn scenes(&self) -> impl Iterator<Item = (&str, &'a SceneResult)> {
        self.columns.iter().enumerate().flat_map(move |(column, heading)| {
            self.methods
                .iter()
                .filter_map(move |&method| Some((heading.as_str(), self.scene(method, column)?)))
        })
    }

    /// One cell a scene, then their mean.
    pub(super) fn across(&self, digits: usize, cell: impl FnMut(usize) -> Cell) -> Vec<Cell> {
        let mut cells: Vec<Cell> = (0..self.columns.len()).map(cell).collect();
        cells.push(mean(&cells, digits));
        cells
    }

    /// Whether a method was compressed in this way anywhere.
    pub(super) fn has(&self, method: Method, setting: Setting) -> bool {
        (0..self.columns.len()).any(|column| self.point(method, column, setting).is_some())
    }

    /// The tolerance there is that is nearest to the paper's main one.
    pub(super) fn main_setting(&self) -> Option<Setting> {
        self.settings
            .iter()
            .filter_map(|&setting| match setting {
                Setting::Tolerance(tolerance) => Some((setting, (tolerance - paper::TOLERANCE).abs())),
                _ => None,
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(setting, _)| setting)
    }

    /// Metrics that any comparison picked by `pick` has, in the order of tables.
    pub(super) fn metrics(&self, pick: impl Fn(&SceneResult) -> Vec<&Comparison>) -> Vec<Metric> {
        let has = |metric: Metric| {
            self.cells.iter().any(|(_, scene)| {
                pick(scene)
                    .iter()
                    .any(|comparison| comparison.get(metric).is_some() && !comparison.views.is_empty())
            })
        };
        Metric::ALL.into_iter().filter(|&metric| has(metric)).collect()
    }

    /// Metrics measured against the original.
    pub(super) fn metrics_to_original(&self) -> Vec<Metric> {
        self.metrics(|scene| scene.points.iter().map(|point| &point.to_original).collect())
    }

    /// Metrics measured against photos.
    pub(super) fn metrics_to_photos(&self) -> Vec<Metric> {
        self.metrics(|scene| {
            scene.to_photos.iter().chain(scene.points.iter().filter_map(|p| p.to_photos.as_ref())).collect()
        })
    }

    /// What FPS were measured on, for headings: `CPU`, a GPU's name, or `several devices`.
    pub(super) fn device(&self) -> String {
        let mut names: Vec<&str> = Vec::new();
        for (_, scene) in &self.cells {
            if scene.points.iter().all(|point| point.fps.is_none()) {
                continue;
            }
            let name = if scene.on_gpu { scene.device.as_str() } else { "CPU" };
            if !names.contains(&name) {
                names.push(name);
            }
        }
        match names.as_slice() {
            [name] => (*name).to_owned(),
            [] => String::new(),
            _ => "several devices".to_owned(),
        }
    }
}

/// A score of a comparison, averaged over its views.
pub(super) fn score(comparison: Option<&Comparison>, metric: Metric) -> Cell {
    let Some(comparison) = comparison.filter(|comparison| !comparison.views.is_empty()) else {
        return Cell::Missing;
    };
    if metric == Metric::Psnr && comparison.identical {
        return Cell::text(IDENTICAL);
    }
    Cell::number(comparison.get(metric).and_then(|summary| summary.mean), metric.digits())
}

/// What stands for the PSNR of pictures that do not differ.
pub(super) const IDENTICAL: &str = "identical";

/// The mean of the numbers among `cells`. Words and missing ones do not count; if there are words alone, it is
/// those.
pub(super) fn mean(cells: &[Cell], digits: usize) -> Cell {
    let values: Vec<f64> = cells.iter().filter_map(Cell::value).collect();
    if values.is_empty() {
        return cells
            .iter()
            .find(|cell| matches!(cell, Cell::Text(text) if text == IDENTICAL))
            .cloned()
            .unwrap_or(Cell::Missing);
    }
    let mean = Some(values.iter().sum::<f64>() / values.len() as f64);
    if cells.iter().any(|cell| matches!(cell, Cell::Change { .. })) {
        Cell::change(mean, digits)
    } else {
        Cell::number(mean, digits)
    }
}

/// `a / b`; nothing if `b` is 0.
pub(super) fn quotient(a: f64, b: f64) -> Option<f64> {
    (b > 0.0).then(|| a / b)
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
        assert_eq!(grid.columns, ["Room", "room", "Room (a)"]);
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
        assert_eq!(mean(&[number(1.0), Cell::Missing, number(4.0), Cell::text(IDENTICAL)], 2), number(2.5));
        assert_eq!(mean(&[Cell::Missing, Cell::text(IDENTICAL)], 2), Cell::text(IDENTICAL));
        assert_eq!(mean(&[Cell::Missing], 2), Cell::Missing);
        assert_eq!(mean(&[Cell::change(Some(-1.0), 1)], 1), Cell::change(Some(-1.0), 1));
    }
}
