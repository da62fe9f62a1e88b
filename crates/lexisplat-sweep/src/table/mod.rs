//! Tables that can be written as HTML or LaTeX.

mod html;
mod latex;

/// A row of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Row {
    /// Text of each column, without escapes.
    pub(crate) cells: Vec<String>,
    /// Whether the numbers are those of the paper.
    pub(crate) is_paper: bool,
    /// Whether a line above separates the row from the rows before it.
    pub(crate) rule: bool,
}

impl Row {
    /// Returns a row of `cells`. Control characters, which would break the row, become spaces.
    pub(crate) fn new(cells: impl IntoIterator<Item = String>) -> Self {
        let one_line = |cell: String| cell.replace(char::is_control, " ");
        Self { cells: cells.into_iter().map(one_line).collect(), is_paper: false, rule: false }
    }
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Column {
    /// Heading over this column and neighbours of the same group; may be empty.
    pub(crate) group: String,
    /// Heading of the column alone, with its unit.
    pub(crate) heading: String,
}

/// A table.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Table {
    /// Name for files: lower-case letters, digits and `-`.
    pub(crate) name: &'static str,
    /// Title: the contents of the table in a few words.
    pub(crate) title: &'static str,
    /// Explanation of how to read the table; may be empty.
    pub(crate) caption: String,
    /// Columns from left to right.
    pub(crate) columns: Vec<Column>,
    /// Number of columns, from the left, that name the row.
    pub(crate) labels: usize,
    /// Rows from top to bottom.
    pub(crate) rows: Vec<Row>,
}

impl Table {
    /// Returns a table without rows, with columns of these headings. The first `labels` columns name the row.
    pub(crate) fn new(name: &'static str, title: &'static str, labels: usize, headings: &[&str]) -> Self {
        let mut table = Self { name, title, labels, ..Self::default() };
        table.add_columns(headings.iter().map(|heading| ("", *heading)));
        table
    }

    /// Appends columns, given by groups and headings.
    pub(crate) fn add_columns<'a>(&mut self, columns: impl IntoIterator<Item = (&'a str, &'a str)>) {
        let column = |(group, heading): (&str, &str)| Column { group: group.into(), heading: heading.into() };
        self.columns.extend(columns.into_iter().map(column));
    }

    /// Appends rows, and separates them from the rows above.
    pub(crate) fn push_block(&mut self, rows: impl IntoIterator<Item = Row>) {
        let first = self.rows.len();
        self.rows.extend(rows);
        if let Some(row) = self.rows.get_mut(first).filter(|_| first > 0) {
            row.rule = true;
        }
    }

    /// Returns the runs of neighbouring columns of the same group among `columns`.
    fn runs<'a>(&self, columns: &'a [usize]) -> impl Iterator<Item = (&str, &'a [usize])> {
        let runs = columns.chunk_by(|&a, &b| self.columns[a].group == self.columns[b].group);
        runs.map(|run| (self.columns[run[0]].group.as_str(), run))
    }

    /// Returns the table as a `table` element, without the caption.
    pub(crate) fn to_html(&self) -> maud::Markup {
        html::write(self)
    }

    /// Returns the table as a `table` environment for a document of one or two columns that uses `booktabs` and
    /// `graphicx`. A table with more rows than a page is a `longtable`, and the document must use `longtable` too. The
    /// table is never wider than its place: it is scaled down, and if it would become too small to read, it is split into
    /// several parts. Letters that the document's fonts lack need another engine, such as `XeLaTeX`.
    pub(crate) fn to_latex(&self) -> String {
        latex::write(self)
    }
}

#[cfg(test)]
pub(super) mod testing {
    use super::*;

    /// Returns a table with text that every format must escape, and with every kind of row.
    pub(crate) fn odd() -> Table {
        let mut table = Table::new("odd", "Odd & <ends>", 1, &["Scene"]);
        table.caption = "100% of a_b, \"quoted\" {braces}".to_owned();
        table.add_columns([("Size & more", "a|b"), ("Size & more", "n")]);
        let row = |cells: [&str; 3]| Row::new(cells.map(str::to_owned));
        table.push_block([row(["x&y|<z>\"_%$#\\^~*`[1]\nnext", "0.00", "1,234,567"])]);
        table.push_block([Row { is_paper: true, ..row(["p,q", "-0.12", "\u{2013}"]) }]);
        table
    }
}
