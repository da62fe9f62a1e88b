//! What was evaluated, the means, and what was skipped.

use crate::grid::Grid;
use crate::measure::Measure;
use crate::table::{Cell, Column, Row, Table};
use crate::{Results, SceneResult, Skipped};

/// Every method at every setting, averaged over its scenes.
pub(crate) fn summary(results: &Results) -> Table {
    let grid = Grid::new(results);
    let device = grid.device();
    let mut measures: Vec<(&str, String, Measure)> = Vec::new();
    let mut add = |group, measure: Measure| measures.push((group, measure.heading(device), measure));
    grid.scores(Measure::ToOriginal).into_iter().for_each(|m| add("Against the original", m));
    // Against photos the paper's three numbers are enough here. Another table has all.
    let photos = || grid.scores(Measure::ToPhotos).into_iter().filter(|m| m.in_paper().is_some());
    photos().for_each(|m| add("Against photos", m));
    for measure in [Measure::MeanNonzeros, Measure::CoefficientRatio, Measure::FileRatio, Measure::BytesEach]
    {
        add("Size", measure);
    }
    let fps = format!("FPS, {device}");
    if !device.is_empty() {
        measures.push((&fps, "From codes".to_owned(), Measure::SparseFps));
        measures.push((&fps, "Dense SH".to_owned(), Measure::DenseFps));
    }
    let columns = measures
        .iter()
        .map(|(group, heading, _)| Column { group: (*group).to_owned(), heading: heading.clone() });
    let caption = "A mean is over the scenes that have the number. A ratio says how many times smaller; that of coefficients is the \
                   paper's and counts neither indices nor anything but SH.";
    let mut table = Table::new("summary", "Means over scenes", caption)
        .with_columns(2, ["Method", "Setting", "Scenes"].map(Column::new).into_iter().chain(columns));
    for &method in &grid.methods {
        let scenes = || (0..grid.headings.len()).filter_map(|column| grid.scene(method, column));
        let has_photos = photos().any(|m| scenes().any(|scene| m.cell(scene, None) != Cell::Missing));
        let original = has_photos.then(|| {
            let count = scenes().filter(|scene| scene.to_photos.is_some()).count();
            ("original".to_owned(), count, None)
        });
        let settings = grid
            .settings_of(method)
            .map(|setting| (setting.label(), grid.points(method, setting).count(), Some(setting)));
        table.push_block(original.into_iter().chain(settings).map(|(label, count, setting)| {
            let cells = measures.iter().map(|(_, _, measure)| {
                grid.measured(*measure, method, setting).pop().unwrap_or(Cell::Missing)
            });
            Row::new([method.title(), &label], std::iter::once(Cell::Count(count as u64)).chain(cells))
        }));
    }
    table
}

/// Every model that was evaluated.
pub(crate) fn models(results: &Results) -> Table {
    let grid = Grid::new(results);
    let dataset = |scene: &SceneResult| match &*scene.dataset {
        "" => Cell::Missing,
        dataset => Cell::text(dataset),
    };
    Table::new("models", "Models", "").with_records::<(&str, &SceneResult)>(
        2,
        &[
            ("", "Scene", &|model| Cell::text(model.0)),
            ("", "Method", &|model| Cell::text(model.1.method.title())),
            ("", "Data set", &|model| dataset(model.1)),
            ("", "File", &|model| Cell::text(&model.1.model)),
            ("", "Gaussians", &|model| Cell::Count(model.1.gaussians)),
            ("", "SH degree", &|model| Cell::Count(model.1.sh_degree.into())),
            ("", "PLY bytes", &|model| Cell::Count(model.1.ply_bytes)),
            ("", "Views", &|model| Cell::Count(model.1.views as u64)),
            ("", "Views from", &|model| Cell::text(&model.1.views_from)),
            ("", "First picture", &|model| {
                Cell::text(format!("{} \u{d7} {}", model.1.size[0], model.1.size[1]))
            }),
            ("", "Drawn on", &|model| Cell::text(&model.1.device)),
            ("", "Photos", &|model| Cell::text(if model.1.to_photos.is_some() { "yes" } else { "no" })),
        ],
        [grid.scenes().collect()],
    )
}

/// What could not be evaluated, and why.
pub(crate) fn skipped(results: &Results) -> Table {
    Table::new("skipped", "Skipped", "").with_records::<&Skipped>(
        4,
        &[
            ("", "Scene", &|skipped| Cell::text(&skipped.name)),
            ("", "Method", &|skipped| Cell::text(skipped.method.title())),
            ("", "Data set", &|skipped| Cell::text(&skipped.dataset)),
            ("", "Reason", &|skipped| Cell::text(&skipped.reason)),
        ],
        [results.skipped.iter().collect()],
    )
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
        assert!(table.columns.iter().rev().take(2).all(|column| column.group == "FPS, CPU"));
        assert_eq!(table.columns.iter().filter(|column| column.group == "FPS, CPU").count(), 2);
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
