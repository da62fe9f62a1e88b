//! How close the compressed is to the original: the paper's Table 1, all settings, and every single view.

use lexisplat_eval::metrics::Metric;
use lexisplat_eval::{Comparison, Summary};

use super::beside_paper;
use crate::grid::Grid;
use crate::measure::{IDENTICAL, Measure};
use crate::paper::{self, Experiment};
use crate::table::{Cell, Column, Row, Style, Table};
use crate::{Results, Setting};

/// Explains a PSNR that is a word, if there is one.
fn about_identical(grid: &Grid<'_>) -> &'static str {
    let identical = |c: &Comparison| c.views.iter().any(|view| view.identical);
    let any = grid.scenes().any(|(_, scene)| scene.points.iter().any(|p| identical(&p.to_original)));
    if any {
        " Pictures without any difference are \u{201c}identical\u{201d}, have no PSNR, and do not count in its mean."
    } else {
        ""
    }
}

/// The paper's Table 1: every method at one tolerance, scene by scene. `tolerance` is the one nearest to 0.1
/// unless given.
pub(crate) fn main(results: &Results, tolerance: Option<f64>) -> Table {
    let grid = Grid::new(results);
    let Some(setting) = tolerance.map(Setting::Tolerance).or_else(|| grid.main_setting()) else {
        return Table::default();
    };
    let device = grid.device();
    let mut measures = grid.scores(Measure::ToOriginal);
    measures.extend([Measure::CoefficientRatio, Measure::FileRatio, Measure::BytesEach]);
    if !device.is_empty() {
        let rates = [Measure::SparseFps, Measure::SparseSpread, Measure::DenseFps, Measure::DenseSpread];
        measures.extend(rates);
    }
    let caption = format!(
        "Means over views. FPS(-Comp) is the original, drawn from dense SH, a frame of each in turn; \u{b1} is half of the range \
         of rounds through all views. The paper's numbers stand below ours for \
         scenes that are the paper's too; a mean is over the numbers in its row.{}",
        about_identical(&grid)
    );
    let title = format!("Compressed at {} against the original's pictures", setting.label());
    let mut table = Table::new("main", title, caption).with_columns(2, grid.columns(&["Method", "Metric"]));
    let experiment = setting.is_tolerance(paper::TOLERANCE).then_some(Experiment::Main);
    for &method in grid.methods.iter().filter(|&&method| grid.points(method, setting).next().is_some()) {
        let measures = measures.iter().copied();
        let names = (method.title(), None);
        table.push_block(beside_paper(&grid, method, Some(setting), names, measures, experiment));
    }
    table
}

/// Every method at every setting against the original's pictures, scene by scene.
pub(crate) fn settings(results: &Results) -> Table {
    let grid = Grid::new(results);
    let mut measures = grid.scores(Measure::ToOriginal);
    measures.push(Measure::CoefficientRatio);
    let caption = format!(
        "tol: SH within this L2 norm. nnz: at most so many nonzeros a Gaussian, without a promise. Names: packed \
         files with everything quantised.{}",
        about_identical(&grid)
    );
    let mut table = Table::new("settings", "Every setting against the original's pictures", caption)
        .with_columns(3, grid.columns(&["Method", "Setting", "Metric"]));
    for &method in &grid.methods {
        for setting in grid.settings_of(method) {
            table.push_block(measures.iter().map(|&measure| {
                let labels = [method.title(), &setting.label(), &measure.heading("")];
                Row::new(labels, grid.measured(measure, method, Some(setting)))
            }));
        }
    }
    table
}

/// Every single view, then mean, minimum and maximum over the views.
pub(crate) fn views(results: &Results) -> Table {
    let grid = Grid::new(results);
    let (original, photos) = (grid.scores(Measure::ToOriginal), grid.scores(Measure::ToPhotos));
    let is_measured = |&metric: &Metric| {
        original.contains(&Measure::ToOriginal(metric)) || photos.contains(&Measure::ToPhotos(metric))
    };
    let metrics: Vec<Metric> = Metric::ALL.into_iter().filter(is_measured).collect();
    let labels = ["Scene", "Method", "Setting", "Against", "View"].map(str::to_owned);
    let headings = metrics.iter().map(|&metric| Measure::ToOriginal(metric).heading(""));
    let caption = "Mean, minimum and maximum PSNR are over the views that are not identical.";
    let mut table = Table::new("views", "View by view", caption)
        .with_columns(labels.len(), labels.into_iter().chain(headings).map(Column::new));
    let cell = |metric: Metric, identical: bool, value: Option<f64>| match metric {
        Metric::Psnr if identical => Cell::text(IDENTICAL),
        metric => Cell::number(value, metric.digits()),
    };
    for (heading, scene) in grid.scenes() {
        let mut comparisons: Vec<(String, &str, &Comparison)> = Vec::new();
        comparisons.extend(scene.to_photos.as_ref().map(|c| ("original".to_owned(), "photos", c)));
        for point in &scene.points {
            comparisons.push((point.setting.label(), "original", &point.to_original));
            comparisons.extend(point.to_photos.as_ref().map(|c| (point.setting.label(), "photos", c)));
        }
        comparisons.retain(|(_, _, comparison)| !comparison.views.is_empty());
        for (setting, against, comparison) in &comparisons {
            let row = |view: &str, value: &dyn Fn(Metric) -> (bool, Option<f64>)| {
                let cells = metrics.iter().map(|&metric| cell(metric, value(metric).0, value(metric).1));
                Row::new([heading, scene.method.title(), setting, against, view], cells)
            };
            let views =
                comparison.views.iter().map(|view| row(&view.name, &|m| (view.identical, view.get(m))));
            let total = |name, pick: fn(&Summary) -> Option<f64>| {
                let value = |metric| (comparison.identical, comparison.get(metric).as_ref().and_then(pick));
                row(name, &value).styled(Style::Total)
            };
            let totals = Summary::PARTS.map(|(name, pick)| total(name, pick));
            table.push_block(views.chain(totals));
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::super::testing::shown;
    use super::*;
    use crate::testing::results;

    #[test]
    fn main_table_by_hand() {
        let table = main(&results(), None);
        assert_eq!(table.title, "Compressed at tol 0.1 against the original's pictures");
        let rows = shown(&table);
        let line = |method: &str, metric: &str| {
            let found: Vec<&Vec<String>> =
                rows.iter().filter(|row| row[0] == method && row[1] == metric).collect();
            assert_eq!(found.len(), 1, "{method} {metric}");
            found[0][2..].join(" ")
        };
        // bonsai, garden, the odd one, mean.
        assert_eq!(line("3DGS", "PSNR, dB"), "42.00 identical \u{2013} 42.00");
        assert_eq!(line("3DGS", "SSIM"), "0.9000 1.0000 \u{2013} 0.9500");
        assert_eq!(line("3DGS", "LPIPS (VGG, as 3DGS)"), "0.2500 0.0000 \u{2013} 0.1250");
        assert_eq!(line("3DGS", "Comp Ratio (coefficients)"), "5.00 4.00 \u{2013} 4.50");
        assert_eq!(line("3DGS", "Ratio of whole files"), "2.50 2.50 \u{2013} 2.50");
        assert_eq!(line("3DGS", "Bytes a Gaussian"), "100.00 100.00 \u{2013} 100.00");
        assert_eq!(line("3DGS", "CPU FPS"), "12.0 \u{2013} \u{2013} 12.0");
        assert_eq!(line("3DGS", "CPU FPS(-Comp)"), "10.0 \u{2013} \u{2013} 10.0");
        assert_eq!(line("MCMC", "PSNR, dB"), "44.00 \u{2013} 40.00 42.00");
        assert_eq!(line("MCMC", "Comp Ratio (coefficients)"), "3.00 \u{2013} 9.00 6.00");
        assert_eq!(line("MCMC", "CPU FPS"), "10.0 \u{2013} 6.0 8.0");
        // The paper's bonsai and garden.
        assert_eq!(line("3DGS, paper", "PSNR, dB"), "41.03 37.97 \u{2013} 39.50");
        assert_eq!(line("MCMC, paper", "Comp Ratio (coefficients)"), "3.22 2.85 \u{2013} 3.04");
        assert!(!rows.iter().any(|row| row[0].starts_with("EAGLES")), "nothing was compressed");
        assert!(table.caption.contains("identical"));
    }

    #[test]
    fn another_tolerance_has_no_paper_beside_it() {
        let table = main(&results(), Some(1.0));
        let rows = shown(&table);
        assert_eq!(rows[0].join(" "), "3DGS PSNR, dB 30.00 \u{2013} \u{2013} 30.00");
        assert!(!rows.iter().any(|row| row[0].contains("paper")));
        assert!(main(&results(), Some(0.7)).is_empty());
    }

    #[test]
    fn a_gpu_is_named() {
        let mut results = results();
        for scene in &mut results.scenes {
            scene.on_gpu = true;
            scene.device = "A & B".to_owned();
        }
        assert!(shown(&main(&results, None)).iter().any(|row| row[1] == "A & B FPS(-Comp)"));
        results.scenes[0].on_gpu = false;
        assert!(shown(&main(&results, None)).iter().any(|row| row[1] == "several devices FPS"));
    }

    #[test]
    fn every_setting_has_its_rows() {
        let rows = shown(&settings(&results()));
        let psnr = |method: &str, setting: &str| {
            let found = rows.iter().find(|row| row[0] == method && row[1] == setting && row[2] == "PSNR, dB");
            found.map(|row| row[3..].join(" "))
        };
        assert_eq!(psnr("3DGS", "nnz 1").unwrap(), "29.00 \u{2013} \u{2013} 29.00");
        assert_eq!(psnr("3DGS", "small").unwrap(), "35.00 \u{2013} \u{2013} 35.00");
        assert_eq!(psnr("MCMC", "tol 1").unwrap(), "31.00 \u{2013} \u{2013} 31.00");
        assert_eq!(psnr("MCMC", "nnz 1"), None);
        let ratio = rows.iter().find(|row| row[1] == "nnz 0" && row[2].starts_with("Comp Ratio")).unwrap();
        assert_eq!(ratio[3], "\u{2013}", "nothing is coded");
        // 8 settings of 3DGS and 2 of MCMC, with 3 metrics and the ratio each.
        assert_eq!(rows.len(), 10 * 4);
    }

    #[test]
    fn views_are_listed_with_their_summary() {
        let rows = shown(&views(&results()));
        let of: Vec<String> = rows
            .iter()
            .filter(|row| row[..4] == ["bonsai", "3DGS", "tol 0.1", "photos"].map(str::to_owned))
            .map(|row| row[4..6].join(" "))
            .collect();
        assert_eq!(of, ["front 30.75", "back|< 32.75", "mean 31.75", "minimum 30.75", "maximum 32.75"]);
        assert!(rows.iter().any(|row| row[..6].join(" ") == "garden 3DGS tol 0.1 original front identical"));
        // 12 points and 8 comparisons with photos, of 2 views and 3 lines of summary each.
        assert_eq!(rows.len(), (12 + 8) * 5);
    }
}
