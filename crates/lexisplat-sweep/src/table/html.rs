//! Tables as HTML.

use maud::{Markup, html};

use super::{Cell, Row, Style, Table};

/// The classes of a row in the page's style sheet.
fn classes(row: &Row) -> Option<&'static str> {
    match (row.rule, row.style) {
        (false, Style::Plain) => None,
        (true, Style::Plain) => Some("rule"),
        (false, Style::Paper) => Some("paper"),
        (true, Style::Paper) => Some("rule paper"),
        (false, Style::Total) => Some("total"),
        (true, Style::Total) => Some("rule total"),
    }
}

pub(super) fn write(table: &Table) -> Markup {
    let groups = table.groups();
    let name = |column| (column < table.labels).then_some("name");
    html! {
        table {
            @if !table.caption.is_empty() { caption { (table.caption) } }
            thead {
                @if !groups.is_empty() {
                    tr { @for (name, wide) in groups { th scope="colgroup" colspan=(wide) { (name) } } }
                }
                tr { @for (i, column) in table.columns.iter().enumerate() { th scope="col" class=[name(i)] { (column.heading) } } }
            }
            tbody {
                "\n"
                @for row in &table.rows {
                    tr class=[classes(row)] {
                        @for column in 0..table.columns.len() {
                            @let cell = row.cell(column);
                            @if column < table.labels {
                                th scope="row" class="name" { (cell.shown()) }
                            } @else {
                                td class=[(*cell == Cell::Missing).then_some("none")] { (cell.shown()) }
                            }
                        }
                    }
                    "\n"
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::odd;
    use crate::report::testing::check_nesting;

    #[test]
    fn markup_is_escaped_and_well_nested() {
        let html = odd().to_html();
        check_nesting(&html);
        assert!(html.contains("<caption>100% of a_b, &quot;quoted&quot; {braces}</caption>"));
        assert!(html.contains("<th scope=\"colgroup\" colspan=\"2\">Size &amp; more</th>"));
        assert!(
            html.contains("<th scope=\"row\" class=\"name\">x&amp;y|&lt;z&gt;&quot;_%$#\\^~*`[1] next</th>")
        );
        assert!(html.contains("<td>1,234,567</td>") && html.contains("<td class=\"none\">\u{2013}</td>"));
        assert!(html.contains("<tr class=\"rule paper\">") && html.contains("<tr class=\"total\">"));
        assert_eq!(html.matches("<tr").count(), 5);
    }
}
