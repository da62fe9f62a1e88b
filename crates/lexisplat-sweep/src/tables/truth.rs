//! Against photos: the paper's table against ground truth, and how much compressing loses there.

use super::{header, heading, paper_row, printed, row, ruled};
use crate::grid::{Grid, mean, score};
use crate::paper::{self, Quantity};
use crate::table::{Cell, Row, Style, Table};
use crate::{Method, Point, Results, SceneResult, Setting};

/// Digits of PSNR differences, as the paper prints them.
const DIGITS: usize = 2;

/// Compressed minus base PSNR against photos of one scene, in dB: negative where compressing lost something.
pub(crate) fn change(scene: &SceneResult, point: &Point) -> Option<f64> {
    Some(point.to_photos.as_ref()?.psnr.mean? - scene.to_photos.as_ref()?.psnr.mean?)
}

/// The same of a column.
fn change_at(grid: &Grid<'_>, method: Method, column: usize, setting: Setting) -> Option<f64> {
    change(grid.scene(method, column)?, grid.point(method, column, setting)?)
}

/// The paper's table against photos: models as trained and compressed at the tolerance nearest to 0.1.
#[must_use]
pub fn truth(results: &Results) -> Table {
    let grid = Grid::new(results);
    let metrics = grid.metrics_to_photos();
    let setting = grid.main_setting();
    let mut rows = Vec::new();
    for &method in &grid.methods {
        let (name, base) = match method {
            Method::EaglesNoSq => (Method::Eagles.title(), "No SQ"),
            _ => (method.title(), "Base."),
        };
        let compressed = setting.filter(|_| !method.is_competitor()).map(|setting| ("Comp.", Some(setting)));
        for (kind, setting) in [(base, None)].into_iter().chain(compressed) {
            let table = if setting.is_some() { paper::Table::Compressed } else { paper::Table::Base };
            let mut of_kind = Vec::new();
            for &metric in &metrics {
                let cells = grid.across(metric.digits(), |column| {
                    let comparison = match setting {
                        None => grid.scene(method, column).and_then(|scene| scene.to_photos.as_ref()),
                        Some(setting) => {
                            grid.point(method, column, setting).and_then(|point| point.to_photos.as_ref())
                        }
                    };
                    score(comparison, metric)
                });
                if cells.iter().all(|cell| *cell == Cell::Missing) {
                    continue;
                }
                of_kind.push(row([name.to_owned(), kind.to_owned(), heading(metric)], cells));
                if let Some(quantity) = printed(metric) {
                    let names = [format!("{name}, paper"), kind.to_owned(), heading(metric)];
                    of_kind.extend(paper_row(names, &grid, table, method, quantity, metric.digits()));
                }
            }
            if let Some(setting) = setting {
                let cells = grid
                    .across(DIGITS, |column| Cell::change(change_at(&grid, method, column, setting), DIGITS));
                if cells.iter().any(|cell| *cell != Cell::Missing) {
                    let names = [name, "Comp. \u{2212} Base.", "PSNR, dB"].map(str::to_owned);
                    of_kind.push(Row { style: Style::Total, ..row(names, cells) });
                }
            }
            rows.extend(ruled(of_kind));
        }
    }
    let at = setting.map_or_else(String::new, |setting| format!(" Comp. is at {}.", setting.label()));
    Table {
        name: "truth",
        title: "Against photos".to_owned(),
        caption: format!(
            "Base. is the model as trained.{at} The paper's numbers stand below ours for scenes that are the paper's too; a mean \
             is over the numbers in its row."
        ),
        header: header(&["Method", "Type", "Metric"], &grid),
        labels: 3,
        rows,
        ..Table::default()
    }
}

/// The paper's change of PSNR against photos over its 13 scenes: mean, worst, and where that is.
fn paper_drop(method: Method) -> Option<(f64, f64, &'static str)> {
    let change = |scene: &'static str| {
        let value = |table| paper::value(table, method, Quantity::Psnr, scene);
        Some((value(paper::Table::Compressed)? - value(paper::Table::Base)?, scene))
    };
    let changes: Vec<(f64, &str)> = paper::SCENES.into_iter().filter_map(change).collect();
    let (worst, scene) = changes.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((changes.iter().map(|change| change.0).sum::<f64>() / changes.len() as f64, worst, scene))
}

/// How much PSNR against photos changes by compressing: mean and worst scene, beside the paper's.
#[must_use]
pub fn drops(results: &Results) -> Table {
    let grid = Grid::new(results);
    let mut rows = Vec::new();
    for &method in &grid.methods {
        let mut of_method = Vec::new();
        for &setting in &grid.settings {
            let changes: Vec<Cell> = (0..grid.columns.len())
                .map(|column| Cell::change(change_at(&grid, method, column, setting), DIGITS))
                .collect();
            let worst = (0..changes.len())
                .filter_map(|column| Some((changes[column].value()?, column)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((worst, column)) = worst else {
                continue;
            };
            let scenes = changes.iter().filter(|cell| **cell != Cell::Missing).count();
            let is_main =
                matches!(setting, Setting::Tolerance(t) if paper::same_tolerance(t, paper::TOLERANCE));
            let paper = paper_drop(method).filter(|_| is_main);
            of_method.push(row(
                [method.title().to_owned(), setting.label()],
                [
                    Cell::Count(scenes as u64),
                    mean(&changes, DIGITS),
                    Cell::change(Some(worst), DIGITS),
                    Cell::text(grid.columns[column].clone()),
                    Cell::change(paper.map(|p| p.0), DIGITS),
                    Cell::change(paper.map(|p| p.1), DIGITS),
                    paper.map_or(Cell::Missing, |p| Cell::text(p.2)),
                ],
            ));
        }
        rows.extend(ruled(of_method));
    }
    Table {
        name: "drops",
        title: "What compressing costs against photos".to_owned(),
        caption: "Change of the mean PSNR over a scene's views, in dB; negative is a loss. The paper's is over its 13 \
                  scenes; its table names no tolerance, 0.1 is assumed."
            .to_owned(),
        groups: vec![(String::new(), 2), ("Ours".to_owned(), 4), ("Paper".to_owned(), 3)],
        header: [
            "Method",
            "Setting",
            "Scenes",
            "Mean, dB",
            "Worst, dB",
            "Worst scene",
            "Mean, dB",
            "Worst, dB",
            "Worst scene",
        ]
        .map(str::to_owned)
        .into(),
        labels: 2,
        rows,
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::shown;
    use super::*;
    use crate::testing::results;

    #[test]
    fn truth_by_hand() {
        let rows = shown(&truth(&results()));
        let line = |method: &str, kind: &str, metric: &str| {
            let found: Vec<&Vec<String>> =
                rows.iter().filter(|row| row[0] == method && row[1] == kind && row[2] == metric).collect();
            assert_eq!(found.len(), 1, "{method} {kind} {metric}");
            found[0][3..].join(" ")
        };
        assert_eq!(line("3DGS", "Base.", "PSNR, dB"), "32.00 \u{2013} \u{2013} 32.00");
        assert_eq!(line("3DGS", "Comp.", "PSNR, dB"), "31.75 \u{2013} \u{2013} 31.75");
        assert_eq!(line("3DGS", "Comp. \u{2212} Base.", "PSNR, dB"), "-0.25 \u{2013} \u{2013} -0.25");
        assert_eq!(line("MCMC", "Base.", "PSNR, dB"), "33.00 \u{2013} 28.00 30.50");
        assert_eq!(line("MCMC", "Comp. \u{2212} Base.", "PSNR, dB"), "-0.50 \u{2013} -1.00 -0.75");
        assert_eq!(line("EAGLES", "Base.", "PSNR, dB"), "31.00 \u{2013} \u{2013} 31.00");
        assert_eq!(line("EAGLES", "No SQ", "PSNR, dB"), "31.50 \u{2013} \u{2013} 31.50");
        assert_eq!(line("EAGLES, paper", "Base.", "PSNR, dB"), "31.24 28.53 \u{2013} 29.88");
        assert_eq!(line("EAGLES, paper", "No SQ", "LPIPS (VGG, as 3DGS)"), "0.2096 0.0742 \u{2013} 0.1419");
        assert_eq!(line("MCMC, paper", "Comp.", "SSIM"), "0.9443 0.9250 \u{2013} 0.9346");
    }

    #[test]
    fn drops_stand_beside_the_papers() {
        let rows = shown(&drops(&results()));
        assert_eq!(
            rows.iter().map(|row| row.join(" ")).collect::<Vec<_>>(),
            [
                "3DGS tol 0.1 1 -0.25 -0.25 bonsai -0.14 -0.37 bonsai",
                "MCMC tol 0.1 2 -0.75 -1.00 a&b|<c>\"_%$ -0.19 -0.44 bonsai",
            ]
        );
        let (mean, worst, scene) = paper_drop(Method::PixelGs).unwrap();
        assert!((mean + 0.18).abs() < 0.005 && (worst + 0.52).abs() < 1e-9 && scene == "bonsai");
        assert_eq!(paper_drop(Method::Eagles), None);
    }

    #[test]
    fn without_photos_there_is_no_table() {
        let mut results = results();
        for scene in &mut results.scenes {
            scene.to_photos = None;
            scene.points.iter_mut().for_each(|point| point.to_photos = None);
        }
        assert!(truth(&results).is_empty() && drops(&results).is_empty());
    }
}
