//! What was evaluated, what it came to on average, and what was not.

use super::{heading, row, ruled};
use crate::Results;
use crate::grid::{Grid, mean, quotient, score};
use crate::table::{Cell, Table};
use lexisplat_eval::metrics::Metric;

/// Digits of nonzeros and ratios.
const DIGITS: usize = 2;

/// Every method in every setting, averaged over its scenes.
#[must_use]
pub fn summary(results: &Results) -> Table {
    let grid = Grid::new(results);
    let (original, photos) = (grid.metrics_to_original(), grid.metrics_to_photos());
    // Against photos the paper's three numbers are enough here; the whole is in another table.
    let photos: Vec<Metric> = photos.into_iter().filter(|m| super::printed(*m).is_some()).collect();
    let device = grid.device();
    let mut rows = Vec::new();
    for &method in &grid.methods {
        let mut of_method = Vec::new();
        if photos.iter().any(|&metric| {
            (0..grid.columns.len()).any(|column| {
                let comparison = grid.scene(method, column).and_then(|scene| scene.to_photos.as_ref());
                score(comparison, metric) != Cell::Missing
            })
        }) {
            let average = |metric: Metric| {
                let cell = |column| {
                    score(grid.scene(method, column).and_then(|scene| scene.to_photos.as_ref()), metric)
                };
                mean(&(0..grid.columns.len()).map(cell).collect::<Vec<_>>(), metric.digits())
            };
            let scenes = (0..grid.columns.len())
                .filter(|&column| grid.scene(method, column).is_some_and(|scene| scene.to_photos.is_some()))
                .count();
            let mut cells = vec![Cell::Count(scenes as u64)];
            cells.extend(original.iter().map(|_| Cell::Missing));
            cells.extend(photos.iter().map(|&metric| average(metric)));
            cells.extend([const { Cell::Missing }; 4]);
            if !device.is_empty() {
                cells.extend([const { Cell::Missing }; 2]);
            }
            of_method.push(row([method.title().to_owned(), "original".to_owned()], cells));
        }
        for &setting in grid.settings.iter().filter(|&&setting| grid.has(method, setting)) {
            let average = |digits: usize, cell: &dyn Fn(usize) -> Cell| {
                mean(&(0..grid.columns.len()).map(cell).collect::<Vec<_>>(), digits)
            };
            let number = |digits: usize, value: &dyn Fn(usize) -> Option<f64>| {
                average(digits, &|column| Cell::number(value(column), digits))
            };
            let point = |column| grid.point(method, column, setting);
            let scenes = (0..grid.columns.len()).filter(|&column| point(column).is_some()).count();
            let mut cells = vec![Cell::Count(scenes as u64)];
            cells.extend(original.iter().map(|&metric| {
                average(metric.digits(), &|column| score(point(column).map(|p| &p.to_original), metric))
            }));
            cells.extend(photos.iter().map(|&metric| {
                average(metric.digits(), &|column| {
                    score(point(column).and_then(|p| p.to_photos.as_ref()), metric)
                })
            }));
            cells.push(number(DIGITS, &|column| point(column).map(|p| p.mean_nonzeros)));
            cells.push(number(DIGITS, &|column| point(column)?.coefficient_ratio));
            cells.push(number(DIGITS, &|column| {
                quotient(grid.scene(method, column)?.ply_bytes as f64, point(column)?.file_bytes as f64)
            }));
            cells.push(number(DIGITS, &|column| {
                quotient(point(column)?.file_bytes as f64, grid.scene(method, column)?.gaussians as f64)
            }));
            if !device.is_empty() {
                cells.push(number(1, &|column| Some(point(column)?.fps?.sparse)));
                cells.push(number(1, &|column| Some(point(column)?.fps?.dense)));
            }
            of_method.push(row([method.title().to_owned(), setting.label()], cells));
        }
        rows.extend(ruled(of_method));
    }
    let mut groups = vec![(String::new(), 3)];
    let mut header: Vec<String> = ["Method", "Setting", "Scenes"].map(str::to_owned).into();
    for (name, metrics) in [("Against the original", &original), ("Against photos", &photos)] {
        if !metrics.is_empty() {
            groups.push((name.to_owned(), metrics.len()));
            header.extend(metrics.iter().map(|&metric| heading(metric)));
        }
    }
    groups.push(("Size".to_owned(), 4));
    header.extend(
        ["Mean nonzeros", "Comp Ratio (coefficients)", "Ratio of whole files", "Bytes a Gaussian"]
            .map(str::to_owned),
    );
    if !device.is_empty() {
        groups.push((format!("FPS, {device}"), 2));
        header.extend(["From codes", "Dense SH"].map(str::to_owned));
    }
    Table {
        name: "summary",
        title: "Means over scenes".to_owned(),
        caption: "A mean is over the scenes that have the number. A ratio says how many times smaller; that of coefficients is the \
                  paper's and counts neither indices nor anything but SH."
            .to_owned(),
        groups,
        header,
        labels: 2,
        rows,
    }
}

/// Every model that was evaluated.
#[must_use]
pub fn models(results: &Results) -> Table {
    let grid = Grid::new(results);
    let rows = grid.scenes().map(|(heading, scene)| {
        row(
            [heading.to_owned(), scene.method.title().to_owned()],
            [
                if scene.dataset.is_empty() { Cell::Missing } else { Cell::text(scene.dataset.clone()) },
                Cell::text(scene.model.clone()),
                Cell::Count(scene.gaussians),
                Cell::Count(u64::from(scene.sh_degree)),
                Cell::Count(scene.ply_bytes),
                Cell::Count(scene.views as u64),
                Cell::text(scene.views_from.clone()),
                Cell::text(format!("{} \u{d7} {}", scene.size[0], scene.size[1])),
                Cell::text(scene.device.clone()),
                Cell::text(if scene.to_photos.is_some() { "yes" } else { "no" }),
            ],
        )
    });
    Table {
        name: "models",
        title: "Models".to_owned(),
        caption: String::new(),
        header: [
            "Scene",
            "Method",
            "Data set",
            "File",
            "Gaussians",
            "SH degree",
            "PLY bytes",
            "Views",
            "Views from",
            "First picture",
            "Drawn on",
            "Photos",
        ]
        .map(str::to_owned)
        .into(),
        labels: 2,
        rows: rows.collect(),
        ..Table::default()
    }
}

/// What could not be evaluated, and why.
#[must_use]
pub fn skipped(results: &Results) -> Table {
    let rows = results.skipped.iter().map(|skipped| {
        let names = [skipped.name.clone(), skipped.method.title().to_owned()];
        row(names, [Cell::text(skipped.dataset.clone()), Cell::text(skipped.reason.clone())])
    });
    Table {
        name: "skipped",
        title: "Skipped".to_owned(),
        caption: String::new(),
        header: ["Scene", "Method", "Data set", "Reason"].map(str::to_owned).into(),
        labels: 4,
        rows: rows.collect(),
        ..Table::default()
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::shown;
    use super::*;
    use crate::testing::results;

    #[test]
    fn summary_by_hand() {
        let table = summary(&results());
        let rows = shown(&table);
        let line = |method: &str, setting: &str| {
            rows.iter().find(|row| row[0] == method && row[1] == setting).unwrap()[2..].join(" ")
        };
        // Scenes; PSNR, SSIM, LPIPS twice; nonzeros, ratios, bytes; FPS.
        assert_eq!(
            line("MCMC", "tol 0.1"),
            "2 42.00 0.9000 0.2500 29.75 0.9000 0.2500 10.00 6.00 2.50 100.00 8.0 6.0"
        );
        assert_eq!(
            line("EAGLES", "original"),
            format!("1{0}{0}{0} 31.00 0.9000 0.2500{0}{0}{0}{0}{0}{0}", " \u{2013}")
        );
        assert!(line("3DGS", "nnz 0").contains(" 0.00 \u{2013} 2.50 "));
        assert_eq!(table.groups.last().unwrap(), &("FPS, CPU".to_owned(), 2));
    }

    #[test]
    fn skipped_scenes_keep_their_reason() {
        let table = skipped(&results());
        assert_eq!(
            shown(&table),
            [["play<room>", "PixelGS", "Deep Blending", "no such file: a|b & \"c\""].map(str::to_owned)]
        );
        assert!(table.to_markdown().contains("no such file: a\\|b &amp; \"c\""));
        assert!(table.to_latex().contains("play\\textless{}room\\textgreater{}"));
        assert!(table.to_csv().contains("\"no such file: a|b & \"\"c\"\"\""));
    }

    #[test]
    fn models_are_all_there() {
        assert_eq!(models(&results()).rows.len(), results().scenes.len());
    }
}
