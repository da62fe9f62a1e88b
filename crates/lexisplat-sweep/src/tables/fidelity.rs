//! How close the compressed is to the original: the paper's Table 1, all settings, and view by view.

use super::{header, heading, paper_row, printed, row, ruled};
use crate::grid::{Grid, IDENTICAL, quotient, score};
use crate::paper::{self, Quantity};
use crate::table::{Cell, Row, Style, Table};
use crate::{Method, Results, Setting};
use lexisplat_eval::Comparison;
use lexisplat_eval::metrics::Metric;

/// Digits of ratios and of bytes a Gaussian, as the paper prints its ratio.
const RATIO_DIGITS: usize = 2;
/// Digits of frames a second, as the paper prints them.
const FPS_DIGITS: usize = 1;

/// What a row of [`main`] shows of a scene.
#[derive(Clone, Copy)]
enum Quality {
    Score(Metric),
    Coefficients,
    WholeFile,
    BytesEach,
    Fps,
    FpsDense,
}

impl Quality {
    fn name(self, device: &str) -> String {
        match self {
            Self::Score(metric) => heading(metric),
            Self::Coefficients => "Comp Ratio (coefficients)".to_owned(),
            Self::WholeFile => "Ratio of whole files".to_owned(),
            Self::BytesEach => "Bytes a Gaussian".to_owned(),
            Self::Fps => format!("{device} FPS"),
            Self::FpsDense => format!("{device} FPS(-Comp)"),
        }
    }

    fn digits(self) -> usize {
        match self {
            Self::Score(metric) => metric.digits(),
            Self::Coefficients | Self::WholeFile | Self::BytesEach => RATIO_DIGITS,
            Self::Fps | Self::FpsDense => FPS_DIGITS,
        }
    }

    /// The paper's name for it. Its FPS are of another device and not set beside ours.
    fn printed(self) -> Option<Quantity> {
        match self {
            Self::Score(metric) => printed(metric),
            Self::Coefficients => Some(Quantity::Ratio),
            _ => None,
        }
    }

    fn cell(self, grid: &Grid<'_>, method: Method, column: usize, setting: Setting) -> Cell {
        let (Some(scene), Some(point)) = (grid.scene(method, column), grid.point(method, column, setting))
        else {
            return Cell::Missing;
        };
        let (file, ply) = (point.file_bytes as f64, scene.ply_bytes as f64);
        let value = match self {
            Self::Score(metric) => return score(Some(&point.to_original), metric),
            Self::Coefficients => point.coefficient_ratio,
            Self::WholeFile => quotient(ply, file),
            Self::BytesEach => quotient(file, scene.gaussians as f64),
            Self::Fps => point.fps.map(|fps| fps.sparse),
            Self::FpsDense => point.fps.map(|fps| fps.dense),
        };
        Cell::number(value, self.digits())
    }
}

fn qualities(grid: &Grid<'_>, device: &str) -> Vec<Quality> {
    let mut all: Vec<Quality> = grid.metrics_to_original().into_iter().map(Quality::Score).collect();
    all.extend([Quality::Coefficients, Quality::WholeFile, Quality::BytesEach]);
    if !device.is_empty() {
        all.extend([Quality::Fps, Quality::FpsDense]);
    }
    all
}

/// Says what a PSNR of words means, if there is one.
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
#[must_use]
pub fn main(results: &Results, tolerance: Option<f64>) -> Table {
    let grid = Grid::new(results);
    let Some(setting) = tolerance.map(Setting::Tolerance).or_else(|| grid.main_setting()) else {
        return Table::default();
    };
    let device = grid.device();
    let beside_paper = matches!(setting, Setting::Tolerance(t) if paper::same_tolerance(t, paper::TOLERANCE));
    let mut rows = Vec::new();
    for &method in grid.methods.iter().filter(|&&method| grid.has(method, setting)) {
        let mut of_method = Vec::new();
        for quality in qualities(&grid, &device) {
            let names = |method: String| [method, quality.name(&device)];
            let cells = grid.across(quality.digits(), |column| quality.cell(&grid, method, column, setting));
            of_method.push(row(names(method.title().to_owned()), cells));
            if let Some(quantity) = quality.printed().filter(|_| beside_paper) {
                let label = names(format!("{}, paper", method.title()));
                of_method.extend(paper_row(
                    label,
                    &grid,
                    paper::Table::Main,
                    method,
                    quantity,
                    quality.digits(),
                ));
            }
        }
        rows.extend(ruled(of_method));
    }
    Table {
        name: "main",
        title: format!("Compressed at {} against the original's pictures", setting.label()),
        caption: format!(
            "Means over views. FPS(-Comp) is the original, drawn from dense SH. The paper's numbers stand below ours for \
             scenes that are the paper's too; a mean is over the numbers in its row.{}",
            about_identical(&grid)
        ),
        header: header(&["Method", "Metric"], &grid),
        labels: 2,
        rows,
        ..Table::default()
    }
}

/// Every method in every setting against the original's pictures, scene by scene.
#[must_use]
pub fn settings(results: &Results) -> Table {
    let grid = Grid::new(results);
    let mut qualities: Vec<Quality> = grid.metrics_to_original().into_iter().map(Quality::Score).collect();
    qualities.push(Quality::Coefficients);
    let mut rows = Vec::new();
    for &method in &grid.methods {
        for &setting in grid.settings.iter().filter(|&&setting| grid.has(method, setting)) {
            let of_setting = qualities.iter().map(|quality| {
                let cells =
                    grid.across(quality.digits(), |column| quality.cell(&grid, method, column, setting));
                row([method.title().to_owned(), setting.label(), quality.name("")], cells)
            });
            rows.extend(ruled(of_setting.collect()));
        }
    }
    Table {
        name: "settings",
        title: "Every setting against the original's pictures".to_owned(),
        caption: format!(
            "tol: SH within this L2 norm. nnz: at most so many nonzeros a Gaussian, without a promise. Names: packed \
             files with everything quantised.{}",
            about_identical(&grid)
        ),
        header: header(&["Method", "Setting", "Metric"], &grid),
        labels: 3,
        rows,
        ..Table::default()
    }
}

/// Every single view, then mean, minimum and maximum over the views.
#[must_use]
pub fn views(results: &Results) -> Table {
    let grid = Grid::new(results);
    let photos = grid.metrics_to_photos();
    let metrics: Vec<Metric> = {
        let original = grid.metrics_to_original();
        Metric::ALL.into_iter().filter(|m| original.contains(m) || photos.contains(m)).collect()
    };
    let mut rows = Vec::new();
    for (heading, scene) in grid.scenes() {
        let mut add = |setting: String, against: &str, comparison: &Comparison| {
            let names =
                |view: &str| [heading, scene.method.title(), &setting, against, view].map(str::to_owned);
            let mut of_setting: Vec<Row> = comparison
                .views
                .iter()
                .map(|view| {
                    row(
                        names(&view.name),
                        metrics.iter().map(|&metric| {
                            if metric == Metric::Psnr && view.identical {
                                Cell::text(IDENTICAL)
                            } else {
                                Cell::number(view.get(metric), metric.digits())
                            }
                        }),
                    )
                })
                .collect();
            if of_setting.is_empty() {
                return;
            }
            for (name, pick) in [("mean", 0), ("minimum", 1), ("maximum", 2)] {
                let cells = metrics.iter().map(|&metric| {
                    let summary = comparison.get(metric);
                    let value = summary.and_then(|s| [s.mean, s.min, s.max][pick]);
                    if metric == Metric::Psnr && comparison.identical {
                        Cell::text(IDENTICAL)
                    } else {
                        Cell::number(value, metric.digits())
                    }
                });
                of_setting.push(Row { style: Style::Total, ..row(names(name), cells) });
            }
            rows.extend(ruled(of_setting));
        };
        if let Some(comparison) = &scene.to_photos {
            add("original".to_owned(), "photos", comparison);
        }
        for point in &scene.points {
            add(point.setting.label(), "original", &point.to_original);
            if let Some(comparison) = &point.to_photos {
                add(point.setting.label(), "photos", comparison);
            }
        }
    }
    Table {
        name: "views",
        title: "View by view".to_owned(),
        caption: "Mean, minimum and maximum PSNR are over the views that are not identical.".to_owned(),
        header: ["Scene", "Method", "Setting", "Against", "View"]
            .into_iter()
            .map(str::to_owned)
            .chain(metrics.iter().map(|&metric| heading(metric)))
            .collect(),
        labels: 5,
        rows,
        ..Table::default()
    }
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
