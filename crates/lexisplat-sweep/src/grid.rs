//! The results as a grid: methods, scenes and settings in order.

use lexisplat_eval::metrics::Metric;

use super::measure::Measure;
use super::{Method, Results, SceneResult, Setting, paper, unique};

/// The methods, scenes and settings of a sweep, in the order of tables.
pub(super) struct Grid<'a> {
    /// Headings of scenes, in the order of the manifest. Each scene is a column of the grid.
    pub(super) headings: Vec<String>,
    /// Methods that have a model, in the order of the paper.
    pub(super) methods: Vec<Method>,
    /// Settings that have a point: tolerances in ascending order, then caps on nonzeros in descending order, then presets
    /// from large to small files.
    pub(super) settings: Vec<Setting>,
    cells: Vec<(usize, &'a SceneResult)>,
}

/// Returns a sort key for settings: by kind, then from near the original to far from it.
fn order(setting: Setting) -> (u8, f64) {
    match setting {
        Setting::Tolerance(tolerance) => (0, tolerance),
        Setting::MaxNonzeros(most) => (1, -f64::from(most)),
        Setting::Preset(preset) => (2, -preset.decibels()),
    }
}

/// Returns whether two results are of the same scene: their names are equal, and their data sets do not contradict each
/// other.
fn same_scene(a: &SceneResult, b: &SceneResult) -> bool {
    a.name.to_lowercase() == b.name.to_lowercase()
        && (a.dataset.is_empty()
            || b.dataset.is_empty()
            || a.dataset.to_lowercase() == b.dataset.to_lowercase())
}

impl<'a> Grid<'a> {
    pub(super) fn new(results: &'a Results) -> Self {
        // The first scene of a column gives it its name. A column has at most one scene of each method.
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
            let heading = unique(&heading, |heading| headings.iter().any(|other| other == heading));
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
        Self { headings, methods, settings, cells }
    }

    /// Returns the model of a method in a column.
    pub(super) fn scene(&self, method: Method, column: usize) -> Option<&'a SceneResult> {
        self.cells.iter().find(|(k, scene)| *k == column && scene.method == method).map(|(_, scene)| *scene)
    }

    /// Returns all models of a method, or its model in one column.
    pub(super) fn models(&self, method: Method, column: Option<usize>) -> Vec<&'a SceneResult> {
        let columns = column.map_or(0..self.headings.len(), |column| column..column + 1);
        columns.filter_map(|column| self.scene(method, column)).collect()
    }

    /// Returns the models column by column, each with its heading. Within a column they are in the order of methods.
    pub(super) fn scenes(&self) -> impl Iterator<Item = (&str, &'a SceneResult)> {
        self.headings.iter().enumerate().flat_map(move |(column, heading)| {
            self.methods
                .iter()
                .filter_map(move |&method| Some((heading.as_str(), self.scene(method, column)?)))
        })
    }

    /// Returns the tolerance nearest to the paper's main tolerance.
    pub(super) fn main_setting(&self) -> Option<Setting> {
        let apart = |setting: &Setting| match setting {
            Setting::Tolerance(tolerance) => Some((tolerance - paper::TOLERANCE).abs()),
            _ => None,
        };
        let tolerances = self.settings.iter().filter_map(|setting| Some((*setting, apart(setting)?)));
        tolerances.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(setting, _)| setting)
    }

    /// Returns the scores of one kind that at least one model has, in the order of tables.
    pub(super) fn scores(&self, kind: fn(Metric) -> Measure) -> Vec<Measure> {
        let is_of = |measure: &Measure, scene: &SceneResult| {
            let mut points = scene.points.iter().map(Some).chain([None]);
            points.any(|point| measure.value(scene, point).is_some())
        };
        let any = |measure: &Measure| self.cells.iter().any(|(_, scene)| is_of(measure, scene));
        Metric::ALL.into_iter().map(kind).filter(any).collect()
    }

    /// Returns the device on which frame rates were measured, for headings: `CPU`, the name of a GPU, or
    /// `several devices`. The text is empty if no frame rates were measured.
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
}
