//! Tables as LaTeX.

use std::fmt::Write;

use super::{Cell, DASH, Style, Table, one_line};

/// `text` with everything LaTeX gives a meaning replaced.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in one_line(text).chars() {
        match c {
            '\\' => out.push_str("\\textbackslash{}"),
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '<' => out.push_str("\\textless{}"),
            '>' => out.push_str("\\textgreater{}"),
            '|' => out.push_str("\\textbar{}"),
            '"' => out.push_str("\\char34{}"),
            '\u{2013}' => out.push_str("--"),
            '\u{2212}' => out.push_str("$-$"),
            '\u{d7}' => out.push_str("$\\times$"),
            '\u{201c}' => out.push_str("``"),
            '\u{201d}' => out.push_str("''"),
            '\u{a0}' => out.push('~'),
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(c);
            }
            c => out.push(c),
        }
    }
    out
}

fn shown(cell: &Cell, style: Style) -> String {
    let text = cell.shown();
    let text = match cell {
        Cell::Missing => DASH.replace(DASH, "--"),
        Cell::Number { .. } | Cell::Change { .. } => match text.strip_prefix('-') {
            Some(digits) => format!("$-${digits}"),
            None => text,
        },
        Cell::Text(_) | Cell::Count(_) => escape(&text),
    };
    match style {
        Style::Plain => text,
        Style::Paper => format!("\\textit{{{text}}}"),
        Style::Total => format!("\\textbf{{{text}}}"),
    }
}

pub(super) fn write(table: &Table) -> String {
    let columns = table.header.len();
    let labels = table.labels.min(columns);
    let mut out = format!(
        "\\begin{{table}}[t]\n  \\centering\n  \\small\n  \\caption{{{}}}\n  \\label{{tab:{}}}\n  \
         \\setlength{{\\tabcolsep}}{{3pt}}\n  \\begin{{tabular}}{{{}{}}}\n    \\toprule\n",
        escape(format!("{}. {}", table.title, table.caption).trim()),
        table.name,
        "l".repeat(labels),
        "r".repeat(columns - labels)
    );
    if !table.groups.is_empty() {
        let heads: Vec<String> = table
            .groups
            .iter()
            .map(|(name, wide)| format!("\\multicolumn{{{wide}}}{{c}}{{{}}}", escape(name)))
            .collect();
        let _ = write!(out, "    {} \\\\\n   ", heads.join(" & "));
        let mut first = 1;
        for (name, wide) in &table.groups {
            if !name.is_empty() {
                let _ = write!(out, " \\cmidrule(lr){{{first}-{}}}", first + wide - 1);
            }
            first += wide;
        }
        out.push('\n');
    }
    let header: Vec<String> =
        table.header.iter().map(|heading| format!("\\textbf{{{}}}", escape(heading))).collect();
    let _ = writeln!(out, "    {} \\\\\n    \\midrule", header.join(" & "));
    for (i, row) in table.rows.iter().enumerate() {
        if row.rule && i > 0 {
            out.push_str("    \\midrule\n");
        }
        let cells: Vec<String> =
            (0..columns).map(|column| shown(Table::cell(row, column), row.style)).collect();
        let _ = writeln!(out, "    {} \\\\", cells.join(" & "));
    }
    out.push_str("    \\bottomrule\n  \\end{tabular}\n\\end{table}\n");
    out
}

#[cfg(test)]
mod tests {
    use super::super::testing::odd;
    use super::*;

    #[test]
    fn special_letters_are_escaped() {
        assert_eq!(
            escape("a\\b~c^d<e>f|g\"h&i%j$k#l_m{n}"),
            "a\\textbackslash{}b\\textasciitilde{}c\\textasciicircum{}d\\textless{}e\\textgreater{}f\\textbar{}g\
             \\char34{}h\\&i\\%j\\$k\\#l\\_m\\{n\\}"
        );
    }

    #[test]
    fn a_table_has_its_rules_groups_and_rows() {
        let latex = odd().to_latex();
        assert!(latex.contains("\\caption{Odd \\& \\textless{}ends\\textgreater{}. 100\\% of a\\_b, "));
        assert!(latex.contains("\\begin{tabular}{lrr}"));
        assert!(latex.contains(
            "\\multicolumn{1}{c}{} & \\multicolumn{2}{c}{Size \\& more} \\\\\n    \\cmidrule(lr){2-3}\n"
        ));
        assert!(latex.contains("    \\midrule\n    \\textit{p,q} & \\textit{+0.12} & \\textit{--} \\\\\n"));
        assert!(latex.contains("\\textbf{short} & \\textbf{--} & \\textbf{--} \\\\\n    \\bottomrule"));
        // Every line of cells has as many as the header.
        for line in latex.lines().filter(|line| line.ends_with("\\\\") && !line.contains("multicolumn")) {
            assert_eq!(line.replace("\\&", "").matches('&').count(), 2, "{line}");
        }
        assert_eq!(latex.matches('{').count(), latex.matches('}').count());
    }

    /// What this crate itself writes beyond ASCII must not need another engine.
    #[test]
    fn typography_is_spelled_in_ascii() {
        assert_eq!(
            escape("1\u{2013}2 \u{2212}3 4\u{d7}5 \u{201c}a\u{201d} b\u{a0}c"),
            "1--2 $-$3 4$\\times$5 ``a'' b~c"
        );
        for table in crate::tables::all(&crate::testing::results()) {
            assert!(table.to_latex().is_ascii(), "{}", table.name);
        }
    }

    #[test]
    fn negative_numbers_have_a_minus_sign() {
        let text = |cell: Cell| shown(&cell, Style::Plain);
        assert_eq!(text(Cell::change(Some(-0.14), 2)), "$-$0.14");
        assert_eq!(text(Cell::number(Some(-3.0), 1)), "$-$3.0");
        assert_eq!(text(Cell::text("-3")), "-3");
    }
}
