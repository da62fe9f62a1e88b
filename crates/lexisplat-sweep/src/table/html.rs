//! Writes tables as HTML.

use maud::{Markup, html};

use super::Table;
use crate::numbers::DASH;

pub(super) fn write(table: &Table) -> Markup {
    let all: Vec<usize> = (0..table.columns.len()).collect();
    let name = |column| (column < table.labels).then_some("name");
    html! {
        table {
            thead {
                @if table.columns.iter().any(|column| !column.group.is_empty()) {
                    tr { @for (group, run) in table.runs(&all) { th scope="colgroup" colspan=(run.len()) { (group) } } }
                }
                tr { @for (i, column) in table.columns.iter().enumerate() { th scope="col" class=[name(i)] { (column.heading) } } }
            }
            tbody {
                "\n"
                @for row in &table.rows {
                    tr.rule[row.rule].paper[row.is_paper] {
                        @for (column, cell) in row.cells.iter().enumerate() {
                            @if column < table.labels {
                                th scope="row" class="name" { (cell) }
                            } @else {
                                td class=[(cell == DASH).then_some("none")] { (cell) }
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
        let html = odd().to_html().into_string();
        check_nesting(&html);
        assert!(html.contains("<th scope=\"colgroup\" colspan=\"2\">Size &amp; more</th>"));
        assert!(
            html.contains("<th scope=\"row\" class=\"name\">x&amp;y|&lt;z&gt;&quot;_%$#\\^~*`[1] next</th>")
        );
        assert!(html.contains("<td>1,234,567</td>") && html.contains("<td class=\"none\">\u{2013}</td>"));
        assert!(html.contains("<tr class=\"rule paper\">"));
        assert_eq!(html.matches("<tr").count(), 4);
    }
}
