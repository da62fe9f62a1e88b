//! Against photos: the paper's table, and how much compressing loses there.

use super::{beside_paper, is_any};
use crate::grid::Grid;
use crate::measure::{DIGITS, Measure};
use crate::paper::{self, Experiment, Quantity};
use crate::table::{Cell, Row, Style, Table};
use crate::{Method, Results, Setting};

/// The paper's table against photos: models as trained, and compressed at the tolerance nearest to 0.1.
pub(crate) fn vs_photos(results: &Results) -> Table {
    let grid = Grid::new(results);
    let setting = grid.main_setting();
    let at = setting.map_or_else(String::new, |setting| format!(" Comp. is at {}.", setting.label()));
    let caption = format!(
        "Base. is the model as trained.{at} The paper's numbers stand below ours for scenes that are the paper's too; a mean \
         is over the numbers in its row."
    );
    let mut table = Table::new("truth", "Against photos", caption)
        .with_columns(3, grid.columns(&["Method", "Type", "Metric"]));
    for &method in &grid.methods {
        let (name, base) = match method {
            Method::EaglesNoSq => (Method::Eagles.title(), "No SQ"),
            _ => (method.title(), "Base."),
        };
        let rows = |kind, setting, experiment| {
            let has = |measure: &Measure| is_any(&grid.measured(*measure, method, setting));
            let measures = grid.scores(Measure::ToPhotos).into_iter().filter(has);
            beside_paper(&grid, method, setting, (name, Some(kind)), measures, Some(experiment))
        };
        table.push_block(rows(base, None, Experiment::Base));
        if let Some(setting) = setting.filter(|_| !method.is_competitor()) {
            let mut block = rows("Comp.", Some(setting), Experiment::Compressed);
            let change = grid.measured(Measure::PhotoChange, method, Some(setting));
            if is_any(&change) {
                let labels = [name, "Comp. \u{2212} Base.", &Measure::PhotoChange.heading("")];
                block.push(Row::new(labels, change).styled(Style::Total));
            }
            table.push_block(block);
        }
    }
    table
}

/// Changes of PSNR against photos by compressing models of one method at one setting.
struct Drop<'a> {
    method: Method,
    setting: Setting,
    /// How many scenes there are.
    scenes: usize,
    mean: Cell,
    /// The largest loss, and the scene that has it.
    worst: (f64, &'a str),
    /// The paper's mean, worst, and scene.
    paper: Option<(f64, f64, &'static str)>,
}

/// The paper's change of PSNR against photos over its 13 scenes: mean, worst, and the scene that has it.
fn paper_drop(method: Method) -> Option<(f64, f64, &'static str)> {
    let change = |scene: &'static str| {
        let value = |experiment| paper::value(experiment, method, Quantity::Psnr, scene);
        Some((value(Experiment::Compressed)? - value(Experiment::Base)?, scene))
    };
    let changes: Vec<(f64, &str)> = paper::SCENES.iter().copied().filter_map(change).collect();
    let (worst, scene) = changes.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((changes.iter().map(|change| change.0).sum::<f64>() / changes.len() as f64, worst, scene))
}

fn drop_at<'a>(grid: &'a Grid<'_>, method: Method, setting: Setting) -> Option<Drop<'a>> {
    // One cell for each scene, then the mean.
    let changes = grid.measured(Measure::PhotoChange, method, Some(setting));
    let found: Vec<(f64, &str)> = changes
        .iter()
        .zip(&grid.headings)
        .filter_map(|(cell, heading)| Some((cell.value()?, heading.as_str())))
        .collect();
    let worst = found.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let paper = paper_drop(method).filter(|_| setting.is_tolerance(paper::TOLERANCE));
    Some(Drop { method, setting, scenes: found.len(), mean: changes.last()?.clone(), worst, paper })
}

/// How much PSNR against photos changes by compressing: mean and worst scene, beside the paper's.
pub(crate) fn drops(results: &Results) -> Table {
    let grid = Grid::new(results);
    let blocks = grid
        .methods
        .iter()
        .map(|&method| grid.settings.iter().filter_map(|&setting| drop_at(&grid, method, setting)).collect());
    let change = |value| Cell::change(value, DIGITS);
    let caption = "Change of the mean PSNR over a scene's views, in dB; negative is a loss. The paper's is over its 13 \
                   scenes; its table names no tolerance, 0.1 is assumed.";
    Table::new("drops", "What compressing costs against photos", caption).with_records::<Drop<'_>>(
        2,
        &[
            ("", "Method", &|row| Cell::text(row.method.title())),
            ("", "Setting", &|row| Cell::text(row.setting.label())),
            ("Ours", "Scenes", &|row| Cell::Count(row.scenes as u64)),
            ("Ours", "Mean, dB", &|row| row.mean.clone()),
            ("Ours", "Worst, dB", &|row| change(Some(row.worst.0))),
            ("Ours", "Worst scene", &|row| Cell::text(row.worst.1)),
            ("Paper", "Mean, dB", &|row| change(row.paper.map(|p| p.0))),
            ("Paper", "Worst, dB", &|row| change(row.paper.map(|p| p.1))),
            ("Paper", "Worst scene", &|row| row.paper.map_or(Cell::Missing, |p| Cell::text(p.2))),
        ],
        blocks,
    )
}

#[cfg(test)]
mod tests {
    use super::super::testing::shown;
    use super::*;
    use crate::testing::results;

    #[test]
    fn photos_by_hand() {
        let rows = shown(&vs_photos(&results()));
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
        assert!(vs_photos(&results).is_empty() && drops(&results).is_empty());
    }
}
