//! Tables as HTML.

use std::fmt::Write;

use super::{Cell, Style, Table};
use crate::report::text::escape;

pub(super) fn write(table: &Table) -> String {
    let mut out = String::from("<table>");
    if !table.caption.is_empty() {
        let _ = write!(out, "<caption>{}</caption>", escape(&table.caption));
    }
    out.push_str("<thead>");
    if !table.groups.is_empty() {
        out.push_str("<tr>");
        for (name, wide) in &table.groups {
            let _ = write!(out, "<th scope=\"colgroup\" colspan=\"{wide}\">{}</th>", escape(name));
        }
        out.push_str("</tr>");
    }
    out.push_str("<tr>");
    for (column, heading) in table.header.iter().enumerate() {
        let class = if column < table.labels { " class=\"name\"" } else { "" };
        let _ = write!(out, "<th scope=\"col\"{class}>{}</th>", escape(heading));
    }
    out.push_str("</tr></thead><tbody>\n");
    for row in &table.rows {
        let mut classes = Vec::new();
        if row.rule {
            classes.push("rule");
        }
        match row.style {
            Style::Plain => (),
            Style::Paper => classes.push("paper"),
            Style::Total => classes.push("total"),
        }
        if classes.is_empty() {
            out.push_str("<tr>");
        } else {
            let _ = write!(out, "<tr class=\"{}\">", classes.join(" "));
        }
        for column in 0..table.header.len() {
            let cell = Table::cell(row, column);
            let text = escape(&cell.shown());
            if column < table.labels {
                let _ = write!(out, "<th scope=\"row\" class=\"name\">{text}</th>");
            } else if matches!(cell, Cell::Missing) {
                let _ = write!(out, "<td class=\"none\">{text}</td>");
            } else {
                let _ = write!(out, "<td>{text}</td>");
            }
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table>");
    out
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
