//! Tables as Markdown.

use std::fmt::Write;

use super::{Style, Table, escaped};

/// `text` with every character that has a meaning in a Markdown table escaped.
pub(crate) fn escape(text: &str) -> String {
    escaped(text, r"\|*_`[]~$#", &[('&', "&amp;"), ('<', "&lt;"), ('>', "&gt;")])
}

pub(super) fn write(table: &Table) -> String {
    let mut out = String::from("|");
    for column in &table.columns {
        let _ = write!(out, " {} |", escape(&column.full()));
    }
    out.push_str("\n|");
    for column in 0..table.columns.len() {
        out.push_str(if column < table.labels { "---|" } else { "---:|" });
    }
    out.push('\n');
    for row in &table.rows {
        out.push('|');
        for column in 0..table.columns.len() {
            let text = escape(&row.cell(column).shown());
            let mark = match row.style {
                Style::Total if !text.is_empty() => "**",
                Style::Paper if !text.is_empty() => "*",
                _ => "",
            };
            let _ = write!(out, " {mark}{text}{mark} |");
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::testing::odd;

    #[test]
    fn markup_is_escaped() {
        assert_eq!(
            odd().to_markdown(),
            "| Scene | Size &amp; more: a\\|b | Size &amp; more: n |\n\
             |---|---:|---:|\n\
             | x&amp;y\\|&lt;z&gt;\"\\_%\\$\\#\\\\^\\~\\*\\`\\[1\\] next | 0.00 | 1,234,567 |\n\
             | *p,q* | *+0.12* | *\u{2013}* |\n\
             | **short** | **\u{2013}** | **\u{2013}** |\n"
        );
    }
}
