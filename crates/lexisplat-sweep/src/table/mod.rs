//! A table that can be written as Markdown, CSV, LaTeX or HTML.

mod html;
mod latex;
mod markdown;

pub(super) use markdown::escape as escape_markdown;

use super::csv;
use lexisplat_eval::text;

/// What stands where there is nothing to print; CSV leaves the cell empty.
const DASH: &str = "\u{2013}";

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A finite number, printed with so many digits after the point; CSV has it in full.
    Number {
        /// The number.
        value: f64,
        /// Digits after the point.
        digits: usize,
    },
    /// A difference: as [`Cell::Number`], always with its sign.
    Change {
        /// The number.
        value: f64,
        /// Digits after the point.
        digits: usize,
    },
    /// A whole number.
    Count(u64),
    /// Nothing: not measured, or there is no such thing.
    Missing,
}

impl Cell {
    /// Words.
    #[must_use]
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// A number; missing if there is none or it is not finite.
    #[must_use]
    pub fn number(value: Option<f64>, digits: usize) -> Self {
        value.filter(|v| v.is_finite()).map_or(Self::Missing, |value| Self::Number { value, digits })
    }

    /// A difference; missing if there is none or it is not finite.
    #[must_use]
    pub fn change(value: Option<f64>, digits: usize) -> Self {
        value.filter(|v| v.is_finite()).map_or(Self::Missing, |value| Self::Change { value, digits })
    }

    /// The number in the cell.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Number { value, .. } | Self::Change { value, .. } => Some(*value),
            Self::Count(count) => Some(*count as f64),
            Self::Text(_) | Self::Missing => None,
        }
    }

    /// As people read it, not escaped.
    #[must_use]
    pub fn shown(&self) -> String {
        match self {
            Self::Text(text) => one_line(text),
            Self::Number { value, digits } => {
                let text = format!("{value:.digits$}");
                // A small negative number must not become "-0.00".
                if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
                    text.trim_start_matches('-').to_owned()
                } else {
                    text
                }
            }
            Self::Change { value, digits } => format!("{value:+.digits$}"),
            Self::Count(count) => text::count(*count),
            Self::Missing => DASH.to_owned(),
        }
    }

    /// As programs read it, not quoted.
    fn plain(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number { value, .. } | Self::Change { value, .. } => value.to_string(),
            Self::Count(count) => count.to_string(),
            Self::Missing => String::new(),
        }
    }
}

/// `text` without line ends and other control characters, which would break a row.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// What a row is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Style {
    /// A row like any other.
    #[default]
    Plain,
    /// Numbers of the paper.
    Paper,
    /// A sum or mean of the rows above.
    Total,
}

/// One row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// As many as the table has columns.
    pub cells: Vec<Cell>,
    /// What it is.
    pub style: Style,
    /// Whether a line above sets it off from the rows before.
    pub rule: bool,
}

/// A table. Rows with fewer cells than the header are filled up with dashes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Name for files: lower case, digits, `-`.
    pub name: &'static str,
    /// What it shows, in a few words.
    pub title: String,
    /// How to read it; may be empty.
    pub caption: String,
    /// Headings over several columns, from the left: text (may be empty) and number of columns. May be empty.
    pub groups: Vec<(String, usize)>,
    /// Heading of each column.
    pub header: Vec<String>,
    /// How many columns, from the left, name the row.
    pub labels: usize,
    /// From top to bottom.
    pub rows: Vec<Row>,
}

impl Table {
    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Headings with the group each stands in before it: `Size: bytes`.
    fn full_header(&self) -> Vec<String> {
        let mut groups =
            self.groups.iter().flat_map(|(name, columns)| std::iter::repeat_n(name.as_str(), *columns));
        self.header
            .iter()
            .map(|heading| match groups.next() {
                Some(group) if !group.is_empty() => format!("{group}: {heading}"),
                _ => heading.clone(),
            })
            .collect()
    }

    /// The cell of a row, or a missing one.
    fn cell(row: &Row, column: usize) -> &Cell {
        row.cells.get(column).unwrap_or(&Cell::Missing)
    }

    /// A Markdown table of the GitHub kind, without title and caption.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        markdown::write(self)
    }

    /// CSV with a header line; numbers in full, missing ones empty.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut out = String::new();
        csv::line(&mut out, self.full_header().iter().map(String::as_str));
        for row in &self.rows {
            let cells: Vec<String> =
                (0..self.header.len()).map(|column| Self::cell(row, column).plain()).collect();
            csv::line(&mut out, cells.iter().map(String::as_str));
        }
        out
    }

    /// A `table` with a `tabular` in it, for a document that uses `booktabs`. Letters beyond
    /// what the document's fonts have need another engine, such as `XeLaTeX`.
    #[must_use]
    pub fn to_latex(&self) -> String {
        latex::write(self)
    }

    /// A `table` element, caption included.
    #[must_use]
    pub fn to_html(&self) -> String {
        html::write(self)
    }
}

#[cfg(test)]
pub(super) mod testing {
    use super::*;

    /// Every kind of cell, with text that every format has to escape.
    pub(crate) fn odd() -> Table {
        Table {
            name: "odd",
            title: "Odd & <ends>".to_owned(),
            caption: "100% of a_b, \"quoted\" {braces}".to_owned(),
            groups: vec![(String::new(), 1), ("Size & more".to_owned(), 2)],
            header: vec!["Scene".to_owned(), "a|b".to_owned(), "n".to_owned()],
            labels: 1,
            rows: vec![
                Row {
                    cells: vec![
                        Cell::text("x&y|<z>\"_%$#\\^~*`[1]\nnext"),
                        Cell::number(Some(-0.001), 2),
                        Cell::Count(1_234_567),
                    ],
                    ..Row::default()
                },
                Row {
                    cells: vec![
                        Cell::text("p,q"),
                        Cell::change(Some(0.125), 2),
                        Cell::number(Some(f64::NAN), 1),
                    ],
                    style: Style::Paper,
                    rule: true,
                },
                Row { cells: vec![Cell::text("short")], style: Style::Total, rule: false },
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_print_what_they_hold() {
        assert_eq!(Cell::number(Some(2.0), 2).shown(), "2.00");
        assert_eq!(Cell::number(Some(-0.001), 2).shown(), "0.00");
        assert_eq!(Cell::number(Some(-0.01), 2).shown(), "-0.01");
        assert_eq!(Cell::number(Some(f64::INFINITY), 2), Cell::Missing);
        assert_eq!(Cell::change(Some(0.2), 1).shown(), "+0.2");
        assert_eq!(Cell::change(Some(-0.2), 1).shown(), "-0.2");
        assert_eq!(Cell::Count(1234).shown(), "1,234");
        assert_eq!(Cell::Missing.shown(), "\u{2013}");
        assert_eq!(Cell::Count(3).value(), Some(3.0));
        assert_eq!(Cell::text("3").value(), None);
    }

    #[test]
    fn csv_keeps_text_and_whole_numbers() {
        let csv = testing::odd().to_csv();
        assert_eq!(
            csv,
            "Scene,Size & more: a|b,Size & more: n\n\
             \"x&y|<z>\"\"_%$#\\^~*`[1]\nnext\",-0.001,1234567\n\
             \"p,q\",0.125,\n\
             short,,\n"
        );
    }
}
