//! The tables of a sweep. Where there is nothing to show a table has no rows.

mod beside;
mod bytes;
mod fidelity;
mod scenes;
mod truth;

pub use beside::{nonzeros, psnr};
pub use bytes::bytes;
pub use fidelity::{main, settings, views};
pub use scenes::{models, skipped, summary};
pub(super) use truth::change;
pub use truth::{drops, truth};

use super::grid::Grid;
use super::paper::{self, Quantity};
use super::table::{Cell, Row, Style, Table};
use super::{Method, Results};
use lexisplat_eval::metrics::Metric;

/// Every table that has rows, most important first.
#[must_use]
pub fn all(results: &Results) -> Vec<Table> {
    let tables = [
        summary(results),
        main(results, None),
        truth(results),
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

/// A row: what names it, then its cells.
fn row<const N: usize>(names: [String; N], cells: impl IntoIterator<Item = Cell>) -> Row {
    Row { cells: names.into_iter().map(Cell::Text).chain(cells).collect(), ..Row::default() }
}

/// Headings: what names rows, the scenes, and the mean.
fn header(names: &[&str], grid: &Grid<'_>) -> Vec<String> {
    let names = names.iter().map(|&name| name.to_owned());
    names.chain(grid.columns.iter().cloned()).chain(["Mean".to_owned()]).collect()
}

/// A metric as a row's name, with its unit.
fn heading(metric: Metric) -> String {
    if metric == Metric::Psnr { "PSNR, dB".to_owned() } else { metric.title().to_owned() }
}

/// What the paper calls a metric. Its LPIPS is taken for the 3DGS repository's.
fn printed(metric: Metric) -> Option<Quantity> {
    match metric {
        Metric::Psnr => Some(Quantity::Psnr),
        Metric::Ssim => Some(Quantity::Ssim),
        Metric::LpipsVggInria => Some(Quantity::Lpips),
        _ => None,
    }
}

/// A row of the paper's numbers for the scenes that are the paper's too; `None` if there are none.
fn paper_row<const N: usize>(
    names: [String; N],
    grid: &Grid<'_>,
    table: paper::Table,
    method: Method,
    quantity: Quantity,
    digits: usize,
) -> Option<Row> {
    let cells = grid.across(digits, |column| {
        Cell::number(paper::value(table, method, quantity, grid.name(column)), digits)
    });
    cells.iter().any(|cell| *cell != Cell::Missing).then(|| Row { style: Style::Paper, ..row(names, cells) })
}

/// Sets the first of `rows` off from what stands above.
fn ruled(mut rows: Vec<Row>) -> Vec<Row> {
    if let Some(first) = rows.first_mut() {
        first.rule = true;
    }
    rows
}

#[cfg(test)]
mod testing {
    use super::Table;

    /// Every cell as people read it.
    pub(super) fn shown(table: &Table) -> Vec<Vec<String>> {
        table.rows.iter().map(|row| row.cells.iter().map(super::Cell::shown).collect()).collect()
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
            let groups: usize = table.groups.iter().map(|group| group.1).sum();
            assert!(table.groups.is_empty() || groups == table.header.len(), "{}", table.name);
            for row in &table.rows {
                assert_eq!(row.cells.len(), table.header.len(), "{}: {row:?}", table.name);
            }
            crate::report::testing::check_nesting(&table.to_html());
        }
        assert!(tables[1].header.contains(&ODD.to_owned()));
    }

    #[test]
    fn nothing_gives_no_tables() {
        assert!(all(&Results::default()).is_empty());
    }
}
