//! Tables as LaTeX.

use std::fmt::Write;

use super::{Cell, Row, Style, Table, escaped};

/// Width of the text in points: the `article` class at 10 pt in one column.
const TEXT_WIDTH: f64 = 345.0;
/// Mean width of a character in points: Computer Modern at 9 pt, which is `\small` there. A digit takes 4.6 pt, a
/// bold digit 5.3 pt.
const CHARACTER: f64 = 5.2;
/// Points between neighbouring columns: `\tabcolsep` is set to half of that.
const COLUMN_GAP: f64 = 6.0;
/// Smallest scale at which text stays readable. A table that needs a smaller one is split.
const LEAST_SCALE: f64 = 0.7;

/// Characters that LaTeX has words for. What this crate writes beyond ASCII needs no other engine so.
const WORDS: [(char, &str); 13] = [
    ('\\', "\\textbackslash{}"),
    ('~', "\\textasciitilde{}"),
    ('^', "\\textasciicircum{}"),
    ('<', "\\textless{}"),
    ('>', "\\textgreater{}"),
    ('|', "\\textbar{}"),
    ('"', "\\char34{}"),
    ('\u{2013}', "--"),
    ('\u{2212}', "$-$"),
    ('\u{d7}', "$\\times$"),
    ('\u{201c}', "``"),
    ('\u{201d}', "''"),
    ('\u{a0}', "~"),
];

/// `text` with every character that has a meaning in LaTeX replaced.
fn escape(text: &str) -> String {
    escaped(text, "&%$#_{}", &WORDS)
}

/// A cell in LaTeX.
fn shown(cell: &Cell, style: Style) -> String {
    let text = cell.shown();
    let text = match (cell, text.strip_prefix('-')) {
        (Cell::Number { .. }, Some(digits)) => format!("$-${digits}"),
        _ => escape(&text),
    };
    match style {
        Style::Plain => text,
        Style::Paper => format!("\\textit{{{text}}}"),
        Style::Total => format!("\\textbf{{{text}}}"),
    }
}

fn points(characters: usize) -> f64 {
    characters as f64 * CHARACTER
}

/// The characters that a column takes: those of its longest cell, or of the longest word of its heading.
fn characters(table: &Table, column: usize) -> usize {
    let cells = table.rows.iter().map(|row| row.cell(column).shown().chars().count());
    let words = table.columns[column].heading.split(' ').map(|word| word.chars().count());
    cells.chain(words).max().unwrap_or(0)
}

/// The natural width of neighbouring columns under one heading, in points.
fn width(table: &Table, columns: &[usize]) -> f64 {
    let runs = columns.chunk_by(|&a, &b| table.columns[a].group == table.columns[b].group);
    runs.map(|run| {
        let cells: f64 = run.iter().map(|&column| points(characters(table, column)) + COLUMN_GAP).sum();
        cells.max(points(table.columns[run[0]].group.chars().count()) + COLUMN_GAP)
    })
    .sum()
}

/// The columns of each part of a table that is too wide for one. Every part begins with the columns that name
/// the rows. Columns of one group stay together where they can.
fn parts(table: &Table) -> Vec<Vec<usize>> {
    let room = TEXT_WIDTH / LEAST_SCALE;
    let labels: Vec<usize> = (0..table.labels.min(table.columns.len())).collect();
    let fits = |part: &[usize], more: &[usize]| width(table, &[part, more].concat()) <= room;
    let others: Vec<usize> = (labels.len()..table.columns.len()).collect();
    let together = |a: &usize, b: &usize| {
        let group = &table.columns[*a].group;
        !group.is_empty() && *group == table.columns[*b].group
    };
    let mut parts = vec![labels.clone()];
    let mut add = |columns: &[usize]| match parts.last_mut() {
        Some(part) if part.len() == labels.len() || fits(part, columns) => part.extend(columns),
        _ => parts.push([&labels, columns].concat()),
    };
    for group in others.chunk_by(together) {
        if fits(&labels, group) {
            add(group);
        } else {
            group.chunks(1).for_each(&mut add);
        }
    }
    parts
}

/// A heading that breaks between words where it is longer than the column.
fn heading(table: &Table, column: usize) -> String {
    let most = characters(table, column);
    let mut lines: Vec<String> = Vec::new();
    for word in table.columns[column].heading.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= most => {
                let _ = write!(line, " {word}");
            }
            _ => lines.push(word.to_owned()),
        }
    }
    let lines: Vec<String> = lines.iter().map(|line| format!("\\textbf{{{}}}", escape(line))).collect();
    match lines.as_slice() {
        [line] => line.clone(),
        lines => {
            let side = if column < table.labels { 'l' } else { 'r' };
            format!("\\shortstack[{side}]{{{}}}", lines.join("\\\\"))
        }
    }
}

/// The `tabular` with some of the columns.
fn tabular(table: &Table, columns: &[usize]) -> String {
    let sides: String = columns.iter().map(|&column| if column < table.labels { 'l' } else { 'r' }).collect();
    let mut out = format!("  \\begin{{tabular}}{{{sides}}}\n    \\toprule\n");
    let runs = || columns.chunk_by(|&a, &b| table.columns[a].group == table.columns[b].group);
    let group = |run: &[usize]| table.columns[run[0]].group.as_str();
    if runs().any(|run| !group(run).is_empty()) {
        let heads =
            runs().map(|run| format!("\\multicolumn{{{}}}{{c}}{{{}}}", run.len(), escape(group(run))));
        let _ = write!(out, "    {} \\\\\n   ", heads.collect::<Vec<_>>().join(" & "));
        let mut first = 1;
        for run in runs() {
            if !group(run).is_empty() {
                let _ = write!(out, " \\cmidrule(lr){{{first}-{}}}", first + run.len() - 1);
            }
            first += run.len();
        }
        out.push('\n');
    }
    let headings: Vec<String> = columns.iter().map(|&column| heading(table, column)).collect();
    let _ = writeln!(out, "    {} \\\\\n    \\midrule", headings.join(" & "));
    for (i, row) in table.rows.iter().enumerate() {
        if row.rule && i > 0 {
            out.push_str("    \\midrule\n");
        }
        let cell = |column: &usize| shown(Row::cell(row, *column), row.style);
        let _ = writeln!(out, "    {} \\\\", columns.iter().map(cell).collect::<Vec<_>>().join(" & "));
    }
    out.push_str("    \\bottomrule\n  \\end{tabular}");
    out
}

pub(super) fn write(table: &Table) -> String {
    let tabulars = parts(table).into_iter().map(|columns| {
        let tabular = tabular(table, &columns);
        if width(table, &columns) <= TEXT_WIDTH {
            return tabular;
        }
        format!("  \\resizebox{{\\textwidth}}{{!}}{{%\n{tabular}%\n  }}")
    });
    format!(
        "\\begin{{table}}[t]\n  \\centering\n  \\small\n  \\caption{{{}}}\n  \\label{{tab:{}}}\n  \
         \\setlength{{\\tabcolsep}}{{{}pt}}\n{}\n\\end{{table}}\n",
        escape(format!("{}. {}", table.title, table.caption).trim()),
        table.name,
        COLUMN_GAP / 2.0,
        tabulars.collect::<Vec<_>>().join("\n  \\par\\medskip\n")
    )
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

    /// Columns of each `tabular` of `latex`, and the width of its longest cells in points.
    fn widths(latex: &str) -> Vec<f64> {
        let plain = |cell: &str| {
            let markup = [("\\\\", "\n"), ("\\char34{}", "q"), ("\\textbar{}", "|"), ("\\textless{}", "<")];
            let more = [("\\textgreater{}", ">"), ("\\textbf{", ""), ("\\textit{", "")];
            let last =
                [("\\shortstack[l]{", ""), ("\\shortstack[r]{", ""), ("}", ""), ("\\", ""), ("$-$", "-")];
            let pairs = markup.iter().chain(&more).chain(&last);
            let cell = pairs.fold(cell.to_owned(), |cell, (from, to)| cell.replace(from, to));
            cell.split('\n').map(|line| line.trim().chars().count()).max().unwrap_or(0)
        };
        let tabulars = latex.split("\\begin{tabular}").skip(1);
        tabulars
            .map(|tabular| {
                let (tabular, _) = tabular.split_once("\\end{tabular}").unwrap();
                let lines =
                    tabular.lines().filter(|line| line.ends_with("\\\\") && !line.contains("multicolumn"));
                let mut longest: Vec<usize> = Vec::new();
                for line in lines {
                    let cells: Vec<usize> =
                        line.trim_end_matches("\\\\").replace("\\&", "+").split('&').map(plain).collect();
                    longest.resize(cells.len(), 0);
                    longest.iter_mut().zip(cells).for_each(|(most, cell)| *most = cell.max(*most));
                }
                longest.iter().map(|&most| points(most) + COLUMN_GAP).sum()
            })
            .collect()
    }

    #[test]
    fn wide_tables_fit_the_text() {
        let mut results = crate::testing::results();
        let mut scene = results.scenes[0].clone();
        for k in 0..20 {
            scene.name = format!("a scene with a long name {k}");
            scene.ply_bytes = 123_456_789_012;
            results.scenes.push(scene.clone());
        }
        for table in crate::tables::all(&results) {
            let latex = table.to_latex();
            let widths = widths(&latex);
            let scaled = latex.matches("\\resizebox{\\textwidth}{!}{%").count();
            assert_eq!(
                widths.iter().filter(|width| **width > TEXT_WIDTH).count(),
                scaled,
                "{}: {widths:?}",
                table.name
            );
            // What cannot be split is as wide as its labels and one column.
            for width in &widths {
                assert!(
                    *width <= TEXT_WIDTH / LEAST_SCALE
                        || ["skipped", "views", "models"].contains(&table.name),
                    "{}: {width}",
                    table.name
                );
            }
        }
        let bytes = crate::tables::bytes(&results);
        assert!(widths(&bytes.to_latex()).len() >= 2, "18 columns do not fit at once");
        // Each part has all rows, and each column is in one part.
        let columns: Vec<usize> =
            parts(&bytes).iter().flat_map(|part| part[bytes.labels..].to_vec()).collect();
        assert_eq!(columns, (bytes.labels..bytes.columns.len()).collect::<Vec<_>>());
        assert_eq!(bytes.to_latex().matches("tol 0.05").count() % parts(&bytes).len(), 0);
    }
}
