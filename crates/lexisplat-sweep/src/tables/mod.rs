//! The tables of a sweep. A table has no rows where there is nothing to show.

mod bytes;
mod fidelity;
mod scenes;
mod vs_paper;
mod vs_photos;

pub(crate) use bytes::bytes;
pub(crate) use fidelity::{main, settings, views};
pub(crate) use scenes::{models, skipped, summary};
pub(crate) use vs_paper::{nonzeros, psnr};
pub(crate) use vs_photos::{drops, vs_photos};

use super::grid::Grid;
use super::measure::Measure;
use super::paper::{self, Experiment};
use super::table::{Cell, Row, Style, Table};
use super::{Method, Results, Setting};

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
            rows.push(row(&format!("{name}, paper"), theirs).styled(Style::Paper));
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
    }

    #[test]
    fn nothing_gives_no_tables() {
        assert!(all(&Results::default()).is_empty());
    }
}
