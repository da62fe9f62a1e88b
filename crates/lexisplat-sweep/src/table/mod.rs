//! A table that can be written as Markdown, CSV, LaTeX or HTML.

mod html;
mod latex;
mod markdown;

pub(super) use markdown::escape as escape_markdown;

use lexisplat_eval::format;

/// What stands for a missing value; CSV leaves the cell empty.
const DASH: &str = "\u{2013}";

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cell {
    /// Words.
    Text(String),
    /// A finite number. CSV has it in full.
    Number {
        /// The number.
        value: f64,
        /// Digits after the point.
        digits: usize,
        /// Whether a sign is always printed: the number is a difference.
        signed: bool,
    },
    /// A whole number.
    Count(u64),
    /// No value: it was not measured, or does not exist.
    Missing,
}

impl Cell {
    /// Words.
    pub(crate) fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// A number. `None` and numbers that are not finite are missing.
    pub(crate) fn number(value: Option<f64>, digits: usize) -> Self {
        value.filter(|v| v.is_finite()).map_or(Self::Missing, |value| Self::Number {
            value,
            digits,
            signed: false,
        })
    }

    /// A difference, printed with its sign. `None` and numbers that are not finite are missing.
    pub(crate) fn change(value: Option<f64>, digits: usize) -> Self {
        match Self::number(value, digits) {
            Self::Number { value, digits, .. } => Self::Number { value, digits, signed: true },
            missing => missing,
        }
    }

    /// The number in the cell.
    pub(crate) fn value(&self) -> Option<f64> {
        match self {
            Self::Number { value, .. } => Some(*value),
            Self::Count(count) => Some(*count as f64),
            Self::Text(_) | Self::Missing => None,
        }
    }

    /// The text for people, not escaped for any format.
    pub(crate) fn shown(&self) -> String {
        match self {
            Self::Text(text) => one_line(text),
            Self::Number { value, digits, signed: true } => signed(*value, *digits),
            Self::Number { value, digits, signed: false } => {
                without_sign_of_zero(format!("{value:.digits$}"))
            }
            Self::Count(count) => format::count(*count),
            Self::Missing => DASH.to_owned(),
        }
    }

    /// The text for programs, not quoted.
    fn in_full(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number { value, .. } => without_sign_of_zero(value.to_string()),
            Self::Count(count) => count.to_string(),
            Self::Missing => String::new(),
        }
    }
}

/// `value` with its sign and `digits` after the point. What is rounded to zero has no sign.
pub(crate) fn signed(value: f64, digits: usize) -> String {
    without_sign_of_zero(format!("{value:+.digits$}"))
}

/// `text` without the sign if it is a zero.
fn without_sign_of_zero(text: String) -> String {
    match text.strip_prefix(['-', '+']) {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        _ => text,
    }
}

/// `text` with control characters, which would break a row, replaced by spaces.
fn one_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}

/// `text` on one line, with each character that has one of `words` replaced by it, and a backslash before each of
/// `marks`.
fn escaped(text: &str, marks: &str, words: &[(char, &str)]) -> String {
    let mut out = String::with_capacity(text.len());
    for c in one_line(text).chars() {
        if let Some((_, word)) = words.iter().find(|word| word.0 == c) {
            out.push_str(word);
            continue;
        }
        if marks.contains(c) {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

/// The kind of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Style {
    /// Measured values.
    #[default]
    Plain,
    /// Numbers of the paper.
    Paper,
    /// A sum or mean of the rows above.
    Total,
}

/// One row.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Row {
    /// One cell for each column. Missing ones are printed as dashes.
    pub(crate) cells: Vec<Cell>,
    /// The kind of the row.
    pub(crate) style: Style,
    /// Whether a line above separates the row from the rows before it.
    pub(crate) rule: bool,
}

impl Row {
    /// A row of `labels`, then `cells`.
    pub(crate) fn new<'a>(
        labels: impl IntoIterator<Item = &'a str>,
        cells: impl IntoIterator<Item = Cell>,
    ) -> Self {
        Self { cells: labels.into_iter().map(Cell::text).chain(cells).collect(), ..Self::default() }
    }

    /// The row with another style.
    pub(crate) fn styled(self, style: Style) -> Self {
        Self { style, ..self }
    }

    /// The cell of a column.
    fn cell(&self, column: usize) -> &Cell {
        self.cells.get(column).unwrap_or(&Cell::Missing)
    }
}

/// One column.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Column {
    /// Heading over this column and neighbours of the same group; may be empty.
    pub(crate) group: String,
    /// Heading of the column alone, with its unit.
    pub(crate) heading: String,
}

impl Column {
    /// A column that belongs to no group.
    pub(crate) fn new(heading: impl Into<String>) -> Self {
        Self { heading: heading.into(), ..Self::default() }
    }

    /// Both headings: `Size: bytes`.
    fn full(&self) -> String {
        if self.group.is_empty() { self.heading.clone() } else { format!("{}: {}", self.group, self.heading) }
    }
}

/// A column of a table whose rows are made from records of type `R`: group, heading, and the cell of a record.
pub(crate) type Field<'a, R> = (&'a str, &'a str, &'a dyn Fn(&R) -> Cell);

/// A table.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Table {
    /// Name for files: lower case, digits, `-`.
    pub(crate) name: &'static str,
    /// What the table shows, in a few words.
    pub(crate) title: String,
    /// How to read it; may be empty.
    pub(crate) caption: String,
    /// From left to right.
    pub(crate) columns: Vec<Column>,
    /// How many columns, from the left, name the row.
    pub(crate) labels: usize,
    /// From top to bottom.
    pub(crate) rows: Vec<Row>,
}

impl Table {
    /// A table without columns and rows.
    pub(crate) fn new(name: &'static str, title: impl Into<String>, caption: impl Into<String>) -> Self {
        Self { name, title: title.into(), caption: caption.into(), ..Self::default() }
    }

    /// The table with these columns, of which the first `labels` name the row.
    pub(crate) fn with_columns(mut self, labels: usize, columns: impl IntoIterator<Item = Column>) -> Self {
        self.labels = labels;
        self.columns.extend(columns);
        self
    }

    /// The table with a column for each of `fields` and a row for each record. A line separates the blocks.
    pub(crate) fn with_records<R>(
        self,
        labels: usize,
        fields: &[Field<'_, R>],
        blocks: impl IntoIterator<Item = Vec<R>>,
    ) -> Self {
        let columns = fields
            .iter()
            .map(|&(group, heading, _)| Column { group: group.to_owned(), heading: heading.to_owned() });
        let mut table = self.with_columns(labels, columns);
        for block in blocks {
            let row = |record| Row {
                cells: fields.iter().map(|field| field.2(record)).collect(),
                ..Row::default()
            };
            table.push_block(block.iter().map(row));
        }
        table
    }

    /// Appends rows, and separates them from those above.
    pub(crate) fn push_block(&mut self, rows: impl IntoIterator<Item = Row>) {
        let first = self.rows.len();
        self.rows.extend(rows);
        if let Some(row) = self.rows.get_mut(first).filter(|_| first > 0) {
            row.rule = true;
        }
    }

    /// Whether there are no rows.
    pub(crate) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Groups of neighbouring columns and how many columns each has. Empty if no column has a group.
    fn groups(&self) -> Vec<(&str, usize)> {
        if self.columns.iter().all(|column| column.group.is_empty()) {
            return Vec::new();
        }
        let runs = self.columns.chunk_by(|a, b| a.group == b.group);
        runs.map(|run| (run[0].group.as_str(), run.len())).collect()
    }

    /// A Markdown table of the GitHub kind, without title and caption.
    pub(crate) fn to_markdown(&self) -> String {
        markdown::write(self)
    }

    /// CSV with a header line. Numbers are written in full, missing ones are empty.
    pub(crate) fn to_csv(&self) -> String {
        let header = self.columns.iter().map(Column::full).collect();
        let cells = |row: &Row| (0..self.columns.len()).map(|column| row.cell(column).in_full()).collect();
        csv_text(std::iter::once(header).chain(self.rows.iter().map(cells)))
    }

    /// A `table` environment for a document of one or two columns that uses `booktabs` and `graphicx`, or, if it has more rows
    /// than a page, a `longtable` for one that uses `longtable` too. It is never wider than its place: it is scaled
    /// down, and if that would make it too small to read, split into several parts. Letters beyond what the
    /// document's fonts have need another engine, such as `XeLaTeX`.
    pub(crate) fn to_latex(&self) -> String {
        latex::write(self)
    }

    /// A `table` element, caption included.
    pub(crate) fn to_html(&self) -> String {
        html::write(self).into_string()
    }
}

/// Records as CSV (RFC 4180, lines end with a line feed). Text that a spreadsheet would take for a formula begins with `'`.
pub(crate) fn csv_text(records: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut writer = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    for record in records {
        // Writing to memory cannot fail.
        let _ = writer.write_record(record.iter().map(|cell| format::csv_cell(cell).into_owned()));
    }
    String::from_utf8_lossy(&writer.into_inner().unwrap_or_default()).into_owned()
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
            columns: [("", "Scene"), ("Size & more", "a|b"), ("Size & more", "n")]
                .map(|(group, heading)| Column { group: group.to_owned(), heading: heading.to_owned() })
                .into(),
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
        assert_eq!([-0.004, 0.004].map(|v| Cell::change(Some(v), 2).shown()), ["0.00", "0.00"]);
        assert_eq!(Cell::number(Some(-0.0), 2).in_full(), "0");
        assert_eq!(Cell::Count(1234).shown(), "1,234");
        assert_eq!(Cell::Missing.shown(), "\u{2013}");
        assert_eq!(Cell::Count(3).value(), Some(3.0));
        assert_eq!(Cell::text("3").value(), None);
    }

    #[test]
    fn csv_holds_no_formulas() {
        let cells = ["=HYPERLINK(1)", "-0.5", "@b", "-x"].map(str::to_owned);
        assert_eq!(csv_text([cells.into()]), "'=HYPERLINK(1),-0.5,'@b,'-x\n");
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
