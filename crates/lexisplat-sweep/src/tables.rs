//! The tables of results. Their columns are measures. The numbers of the paper are below ours.

use super::grid::Grid;
use super::measure::{Measure, mean};
use super::numbers::DASH;
use super::table::{Row, Table};
use super::{Point, Results, SceneResult, Setting, paper};
use lexisplat_eval::format::count;

/// Caption of both tables: the meaning of their numbers.
const CAPTION: &str = "Ratios say how many times smaller; Comp Ratio is the paper's, of coefficients, and counts neither indices \
                       nor anything but SH. Change is PSNR against photos of the compressed minus that of the original. Frames \
                       from codes and from dense SH are drawn in turn; \u{b1} is half of the range of rounds through all views. \
                       Pictures without any difference are \u{201c}identical\u{201d} and do not count in means.";

/// The data from which tables are made.
struct Source<'a> {
    grid: Grid<'a>,
    /// Measures that at least one model has, each with the heading of its group.
    measures: Vec<(String, Measure)>,
    results: &'a Results,
}

impl<'a> Source<'a> {
    fn new(results: &'a Results) -> Self {
        let grid = Grid::new(results);
        let photos = grid.scores(Measure::ToPhotos);
        let change = (!photos.is_empty()).then_some(Measure::PhotoChange);
        let size = [Measure::MeanNonzeros, Measure::CoefficientRatio, Measure::FileRatio, Measure::BytesEach];
        let fps = [Measure::SparseFps, Measure::SparseSpread, Measure::DenseFps, Measure::DenseSpread];
        let groups = [
            ("Against the original".to_owned(), grid.scores(Measure::ToOriginal)),
            ("Against photos".to_owned(), photos.into_iter().chain(change).collect()),
            ("Size".to_owned(), size.to_vec()),
            (
                format!("{} FPS", grid.device()),
                fps.into_iter().filter(|_| !grid.device().is_empty()).collect(),
            ),
        ];
        let named = |(group, of): (String, Vec<Measure>)| of.into_iter().map(move |m| (group.clone(), m));
        Self { measures: groups.into_iter().flat_map(named).collect(), grid, results }
    }

    /// Returns `table` with a column for each measure, and with a caption that begins with `caption`.
    fn with_measures(&self, mut table: Table, caption: &str) -> Table {
        table.add_columns(self.measures.iter().map(|(group, measure)| (&**group, measure.heading())));
        table.caption = format!("{caption} {CAPTION} {}", self.results.how()).trim().to_owned();
        table
    }

    /// Returns a row for each setting of `models`, which are of one method. A row begins with `names`, and has means over
    /// the models that have the number. Below it is a row with the paper's means over the same scenes. If the paper has
    /// none of these scenes and `has_count` is set, its means are over its 13 scenes.
    fn rows(&self, models: &[&'a SceneResult], names: &[&str], has_count: bool) -> Vec<Row> {
        let mut rows = Vec::new();
        for setting in [None].into_iter().chain(self.grid.settings.iter().copied().map(Some)) {
            let point = |scene: &&'a SceneResult| match setting {
                None => {
                    (scene.to_photos.is_some() || scene.shipped_bytes.is_some()).then_some((*scene, None))
                }
                Some(setting) => Some((*scene, Some(scene.point(setting)?))),
            };
            let at: Vec<(&SceneResult, Option<&Point>)> = models.iter().filter_map(point).collect();
            let Some((SceneResult { method, .. }, _)) = at.first() else { continue };
            let label = setting.map_or_else(|| "original".to_owned(), Setting::label);
            let row = |label: &str, scenes: usize, value: &dyn Fn(Measure) -> Option<f64>| {
                let names = names.iter().copied().chain([label]).map(str::to_owned);
                let count = has_count.then(|| count(scenes as u64));
                let values = self.measures.iter().map(|(_, measure)| measure.shown(value(*measure)));
                Row::new(names.chain(count).chain(values))
            };
            rows.push(row(&label, at.len(), &|m| {
                mean(at.iter().filter_map(|(scene, point)| m.value(scene, *point)))
            }));
            // Models as trained have no pursuit.
            let is_other = setting.is_some() && self.results.pursuit != paper::PURSUIT;
            let pursuit = if is_other { " (OMP)" } else { "" };
            let same: Vec<&str> =
                at.iter().map(|(scene, _)| &*scene.name).filter(|name| paper::has(name)).collect();
            let scenes = if has_count && same.is_empty() { &*paper::SCENES } else { &same };
            let value = |m| mean(scenes.iter().filter_map(|scene| paper::value(m, *method, setting, scene)));
            if self.measures.iter().any(|(_, measure)| value(*measure).is_some()) {
                let row = row(&format!("paper{pursuit}"), scenes.len(), &value);
                rows.push(Row { is_paper: true, ..row });
            }
        }
        rows
    }
}

/// Returns the table of every method at every setting, averaged over its scenes.
pub(crate) fn means(results: &Results) -> Table {
    let source = Source::new(results);
    let table = Table::new("means", "Means over scenes", 2, &["Method", "Setting", "Scenes"]);
    let caption = "Means are over the scenes that have the number. Rows of the paper are its means over the same scenes, or \
                   over its 13 where it has none of them.";
    let mut table = source.with_measures(table, caption);
    for &method in &source.grid.methods {
        table.push_block(source.rows(&source.grid.models(method, None), &[method.title()], true));
    }
    table
}

/// Returns the table of every model at every setting.
pub(crate) fn scenes(results: &Results) -> Table {
    let source = Source::new(results);
    let table = Table::new("scenes", "Scene by scene", 3, &["Scene", "Method", "Setting"]);
    let mut table = source.with_measures(table, "");
    for (heading, scene) in source.grid.scenes() {
        table.push_block(source.rows(&[scene], &[heading, scene.method.title()], false));
    }
    table
}

/// Returns the table of every model that was evaluated.
pub(crate) fn models(results: &Results) -> Table {
    let headings = [
        "Scene",
        "Method",
        "Data set",
        "File",
        "Gaussians",
        "SH degree",
        "PLY bytes",
        "Shipped bytes",
        "Views",
        "Views from",
        "First picture",
        "Drawn on",
        "Photos",
    ];
    let mut table = Table::new("models", "Models", 2, &headings);
    let grid = Grid::new(results);
    table.push_block(grid.scenes().map(|(heading, scene)| {
        let text = |text: &str| if text.is_empty() { DASH.to_owned() } else { text.to_owned() };
        Row::new([
            text(heading),
            text(scene.method.title()),
            text(&scene.dataset),
            text(&scene.model),
            count(scene.gaussians),
            scene.sh_degree.to_string(),
            count(scene.ply_bytes),
            scene.shipped_bytes.map_or_else(|| DASH.to_owned(), count),
            count(scene.views as u64),
            text(&scene.views_from),
            format!("{} \u{d7} {}", scene.size[0], scene.size[1]),
            text(&scene.device),
            text(if scene.to_photos.is_some() { "yes" } else { "no" }),
        ])
    }));
    table
}

/// Returns the table of the models that could not be evaluated, with the reasons.
pub(crate) fn skipped(results: &Results) -> Table {
    let mut table = Table::new("skipped", "Skipped", 4, &["Scene", "Method", "Data set", "Reason"]);
    table.push_block(results.skipped.iter().map(|skipped| {
        let title = skipped.method.title();
        Row::new([&skipped.name, title, &skipped.dataset, &skipped.reason].map(str::to_owned))
    }));
    table
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ODD, results};
    use super::*;

    /// The cells of the paper's row below the only row that begins with `labels`.
    fn below(table: &Table, labels: &[&str]) -> String {
        let is_it = |row: &Row| row.cells.iter().zip(labels).all(|(a, b)| a == b);
        let index = table.rows.iter().position(is_it).unwrap();
        let row = table.rows.get(index + 1).filter(|row| row.is_paper);
        row.map_or(String::new(), |row| row.cells[labels.len()..].join(" ").replace('\u{2013}', "-"))
    }

    /// The cells of the only row that begins with `labels`, without them.
    fn line(table: &Table, labels: &[&str]) -> String {
        let found: Vec<&Row> =
            table.rows.iter().filter(|row| row.cells.iter().zip(labels).all(|(a, b)| a == b)).collect();
        assert_eq!(found.len(), 1, "{labels:?}: {found:?}");
        found[0].cells[labels.len()..].join(" ").replace('\u{2013}', "-")
    }

    #[test]
    fn every_table_is_rectangular() {
        let results = results();
        for table in [means(&results), scenes(&results), models(&results), skipped(&results)] {
            assert!(!table.rows.is_empty());
            for row in &table.rows {
                assert_eq!(row.cells.len(), table.columns.len(), "{}: {row:?}", table.name);
            }
            crate::report::testing::check_nesting(&table.to_html().into_string());
            let has_points = ["means", "scenes"].contains(&table.name);
            let how = "Pursuit: OMP, the paper\u{2019}s (ours is OLS). Layout: f16.";
            assert_eq!(table.caption.ends_with(how), has_points, "{}: {}", table.name, table.caption);
        }
    }

    #[test]
    fn means_by_hand() {
        let table = means(&results());
        // Scenes; PSNR, SSIM, LPIPS twice, the change; nonzeros, ratios, bytes; FPS.
        assert_eq!(
            line(&table, &["MCMC", "tol 0.1"]),
            "2 42.00 0.9000 0.2500 29.75 0.9000 0.2500 -0.75 10.00 6.00 2.50 100.00 8.0 5.0 6.0 5.0"
        );
        assert_eq!(line(&table, &["MCMC", "original"]), "2 - - - 30.50 0.9000 0.2500 - - - - - - - - -");
        // As shipped.
        assert_eq!(
            line(&table, &["EAGLES", "original"]),
            "1 - - - 31.00 0.9000 0.2500 - - - 5.00 50.00 - - - -"
        );
        // Bonsai and garden, whose pictures are identical.
        assert_eq!(
            line(&table, &["3DGS", "tol 0.1"]),
            "2 42.00 0.9500 0.1250 31.75 0.9000 0.2500 -0.25 10.12 4.50 2.50 100.00 12.0 5.0 10.0 5.0"
        );
        assert!(line(&table, &["3DGS", "nnz 0"]).contains(" 0.00 - 2.50 "), "nothing is coded");
        assert!(table.columns.iter().rev().take(4).all(|column| column.group == "CPU FPS"));
    }

    #[test]
    fn the_paper_stands_below_ours() {
        let table = means(&results());
        let starts = |labels: &[&str], with: &str| {
            let found = below(&table, labels);
            assert!(found.starts_with(with), "{labels:?}: {found}");
        };
        // Bonsai and garden, of which our garden has no photos.
        starts(&["3DGS", "tol 0.1"], "2 39.50 0.9836 0.0280 ");
        starts(&["MCMC", "tol 0.1"], "1 43.09 ");
        starts(&["3DGS", "tol 0.05"], "1 44.14 ");
        starts(&["EAGLES", "original"], "1 - - - 31.24 ");
        for labels in [["3DGS", "tol 1"], ["3DGS", "nnz 1"], ["3DGS", "small"]] {
            assert_eq!(below(&table, &labels), "", "{labels:?}");
        }
        let mut others = results();
        others.scenes.iter_mut().for_each(|scene| scene.name = "elsewhere".to_owned());
        let table = means(&others);
        assert!(below(&table, &["3DGS", "tol 0.1"]).starts_with("13 39.57 "));
        assert!(below(&table, &["MCMC", "tol 0.1"]).starts_with("13 42.95 "));
        let table = scenes(&results());
        assert!(below(&table, &["bonsai", "3DGS", "tol 0.05"]).starts_with("44.14 "));
        // Compressed against photos 31.69 dB, 32.06 before.
        assert!(below(&table, &["bonsai", "3DGS", "tol 0.1"]).contains(" -0.37 - 4.65 - - "));
        assert!(below(&table, &["bonsai", "MCMC", "tol 0.1"]).ends_with("- 3.22 - - - - - -"));
        assert!(below(&table, &["bonsai", "EAGLES", "original"]).starts_with("- - - 31.24 "));
        assert!(!table.rows.iter().any(|row| row.cells[0] == ODD && row.is_paper));
    }

    #[test]
    fn scenes_by_hand() {
        let table = scenes(&results());
        assert_eq!(
            line(&table, &["bonsai", "3DGS", "tol 0.1"]),
            "42.00 0.9000 0.2500 31.75 0.9000 0.2500 -0.25 9.00 5.00 2.50 100.00 12.0 5.0 10.0 5.0"
        );
        assert!(
            line(&table, &["garden", "3DGS", "tol 0.1"])
                .starts_with("identical 1.0000 0.0000 - - - - 11.25 4.00")
        );
        assert!(
            line(&table, &[ODD, "MCMC", "tol 0.1"])
                .starts_with("40.00 0.9000 0.2500 27.00 0.9000 0.2500 -1.00")
        );
        assert!(line(&table, &["bonsai", "3DGS", "small"]).ends_with(" 3.00 15.00 12.50 20.00 - - - -"));
    }

    #[test]
    fn beside_another_pursuit_the_papers_is_named() {
        let names = |pursuit: &str| -> Vec<String> {
            let results = Results { pursuit: pursuit.to_owned(), ..results() };
            let rows = scenes(&results).rows.into_iter().filter(|row| row.is_paper);
            rows.map(|row| row.cells[2].clone()).collect()
        };
        assert!(!names("omp").is_empty() && names("omp").iter().all(|name| name == "paper"));
        // Models as trained know no pursuit.
        assert_eq!(names("ols").iter().filter(|name| *name == "paper").count(), 4);
        assert!(names("ols").iter().all(|name| name == "paper" || name == "paper (OMP)"));
        assert!(names("ols").iter().any(|name| name == "paper (OMP)"));
    }

    #[test]
    fn a_gpu_is_named() {
        let mut results = results();
        for scene in &mut results.scenes {
            scene.on_gpu = true;
            scene.device = "A & B".to_owned();
        }
        let group = |results: &Results| means(results).columns.last().map(|column| column.group.clone());
        assert_eq!(group(&results).as_deref(), Some("A & B FPS"));
        results.scenes[0].on_gpu = false;
        assert_eq!(group(&results).as_deref(), Some("several devices FPS"));
    }

    #[test]
    fn without_photos_and_speed_there_are_no_columns_of_them() {
        let mut results = results();
        for scene in &mut results.scenes {
            scene.to_photos = None;
            scene.points.iter_mut().for_each(|point| (point.to_photos, point.fps) = (None, None));
        }
        let groups: Vec<String> = means(&results).columns.into_iter().map(|column| column.group).collect();
        assert!(!groups.iter().any(|group| group.contains("photos") || group.contains("FPS")), "{groups:?}");
    }

    #[test]
    fn what_was_skipped_keeps_its_reason() {
        let table = skipped(&results());
        assert_eq!(
            table.rows[0].cells,
            ["play<room>", "PixelGS", "Deep Blending", "no such file: a|b & \"c\""]
        );
        assert_eq!(models(&results()).rows.len(), results().scenes.len());
    }

    #[test]
    fn unknown_sizes_divide_by_nothing() {
        let mut results = results();
        results.scenes.iter_mut().for_each(|scene| (scene.gaussians, scene.sh_degree) = (0, 200));
        let shown = format!("{:?}", scenes(&results));
        assert!(!shown.contains("NaN") && !shown.contains("inf"));
        assert!(means(&Results::default()).rows.is_empty() && scenes(&Results::default()).rows.is_empty());
    }
}
