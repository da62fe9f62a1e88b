//! The tables of a sweep. A table has no rows where there is nothing to show.

mod bytes;
mod fidelity;
mod scenes;
mod vs_paper;
mod vs_photos;

pub(crate) use scenes::{models, skipped};

use super::grid::Grid;
use super::measure::Measure;
use super::paper::{self, Experiment};
use super::table::{Cell, Row, Style, Table};
use super::{Method, Results, Setting};

/// `table` with the pursuit and the layout of its points in its caption.
fn told(table: Table, results: &Results) -> Table {
    Table { caption: format!("{} {}", table.caption, results.how()).trim().to_owned(), ..table }
}

/// Tables of points, each with the pursuit and the layout in its caption.
macro_rules! tables_of_points {
    ($($(#[$doc:meta])* $name:ident from $module:ident;)*) => {
        $($(#[$doc])* pub(crate) fn $name(results: &Results) -> Table { told($module::$name(results), results) })*
    };
}

tables_of_points! {
    /// As [`scenes::summary`].
    summary from scenes;
    /// As [`vs_photos::vs_photos`].
    vs_photos from vs_photos;
    /// As [`vs_photos::drops`].
    drops from vs_photos;
    /// As [`vs_paper::psnr`].
    psnr from vs_paper;
    /// As [`vs_paper::nonzeros`].
    nonzeros from vs_paper;
    /// As [`bytes::bytes`].
    bytes from bytes;
    /// As [`fidelity::settings`].
    settings from fidelity;
    /// As [`fidelity::views`].
    views from fidelity;
}

/// As [`fidelity::main`], with the pursuit and the layout in its caption.
pub(crate) fn main(results: &Results, tolerance: Option<f64>) -> Table {
    told(fidelity::main(results, tolerance), results)
}

/// Every table that has rows, most important first.
pub(crate) fn all(results: &Results) -> Vec<Table> {
    let tables = [
        summary(results),
        main(results, None),
        vs_photos(results),
        drops(results),
        psnr(results),
        nonzeros(results),
        bytes(results),
        settings(results),
        models(results),
        skipped(results),
        views(results),
    ];
    tables.into_iter().filter(|table| !table.is_empty()).collect()
}

/// A row for each of `measures` of a method, named `name` and `kind`. Below each stand the paper's numbers of
/// `experiment`, if it has any of these scenes.
fn beside_paper(
    grid: &Grid<'_>,
    method: Method,
    setting: Option<Setting>,
    (name, kind): (&str, Option<&str>),
    measures: impl IntoIterator<Item = Measure>,
    experiment: Option<Experiment>,
) -> Vec<Row> {
    let mut rows = Vec::new();
    for measure in measures {
        let heading = measure.heading(grid.device());
        let row = |name, cells| Row::new([Some(name), kind, Some(&*heading)].into_iter().flatten(), cells);
        rows.push(row(name, grid.measured(measure, method, setting)));
        let Some((experiment, quantity)) = experiment.zip(measure.in_paper()) else { continue };
        let value = |column| paper::value(experiment, method, quantity, grid.name(column));
        let theirs = grid.across(|column| Cell::number(value(column), measure.digits()));
        if is_any(&theirs) {
            // Models as trained know no pursuit.
            let label = if setting.is_some() { grid.paper_label(name) } else { format!("{name}, paper") };
            rows.push(row(&label, theirs).styled(Style::Paper));
        }
    }
    rows
}

/// Whether any of `cells` has a value.
fn is_any(cells: &[Cell]) -> bool {
    cells.iter().any(|cell| *cell != Cell::Missing)
}

#[cfg(test)]
mod testing {
    use super::Table;

    /// Every cell as people read it.
    pub(super) fn shown(table: &Table) -> Vec<Vec<String>> {
        table.rows.iter().map(|row| row.cells.iter().map(crate::table::Cell::shown).collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::super::testing::{ODD, results};
    use super::*;

    #[test]
    fn every_table_is_rectangular_and_named_once() {
        let tables = all(&results());
        assert_eq!(tables.len(), 11);
        let names: HashSet<&str> = tables.iter().map(|table| table.name).collect();
        assert_eq!(names.len(), tables.len());
        for table in &tables {
            for row in &table.rows {
                assert_eq!(row.cells.len(), table.columns.len(), "{}: {row:?}", table.name);
            }
            crate::report::testing::check_nesting(&table.to_html());
        }
        assert!(tables[1].columns.iter().any(|column| column.heading == ODD));
        for table in tables.iter().filter(|table| !["models", "skipped"].contains(&table.name)) {
            assert!(
                table.caption.ends_with("Pursuit: OMP, the paper\u{2019}s (ours is OLS). Layout: f16."),
                "{}: {}",
                table.name,
                table.caption
            );
        }
    }

    #[test]
    fn beside_another_pursuit_the_papers_is_named() {
        let names = |pursuit: &str| -> HashSet<String> {
            let results = Results { pursuit: pursuit.to_owned(), ..results() };
            let tables = [psnr(&results), main(&results, None)].into_iter();
            let cells = tables.flat_map(|table| table.rows).flat_map(|row| row.cells.into_iter().take(2));
            cells.map(|cell| cell.shown()).filter(|name| name.contains("paper")).collect()
        };
        assert!(names("omp").iter().all(|name| name.ends_with(", paper")), "{:?}", names("omp"));
        assert!(names("ols").iter().all(|name| name.ends_with(", paper (OMP)")), "{:?}", names("ols"));
        assert!(!names("omp").is_empty() && !names("ols").is_empty());
    }

    #[test]
    fn nothing_gives_no_tables() {
        assert!(all(&Results::default()).is_empty());
    }
}
