//! The tables of a sweep. A table has no rows where there is nothing to show.

mod bytes;
mod fidelity;
mod scenes;
mod vs_paper;
mod vs_photos;

pub use bytes::bytes;
pub use fidelity::{main, settings, views};
pub use scenes::{models, skipped, summary};
pub use vs_paper::{nonzeros, psnr};
pub use vs_photos::{drops, vs_photos};

use super::grid::Grid;
use super::measure::Measure;
use super::paper::{self, Experiment};
use super::table::{Cell, Row, Style, Table};
use super::{Method, Results};

/// Every table that has rows, most important first.
#[must_use]
pub fn all(results: &Results) -> Vec<Table> {
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

/// A row of the paper's numbers for the scenes that are the paper's too. `None` if there are none.
fn paper_row<const N: usize>(
    labels: [&str; N],
    grid: &Grid<'_>,
    experiment: Experiment,
    method: Method,
    measure: Measure,
) -> Option<Row> {
    let quantity = measure.in_paper()?;
    let value = |column| paper::value(experiment, method, quantity, grid.name(column));
    let cells = grid.across(|column| Cell::number(value(column), measure.digits()));
    let any = cells.iter().any(|cell| *cell != Cell::Missing);
    any.then(|| Row::new(labels, cells).styled(Style::Paper))
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
