//! Writes tables as LaTeX.

use std::fmt::Write;

use super::{Row, Table};
use crate::numbers::DASH;

/// Width of the text, in points: the `article` class at 10 pt in one column.
const TEXT_WIDTH: f64 = 345.0;
/// Mean width of a character, in points: Computer Modern at 9 pt, which is `\small` in that class. A digit takes 4.6 pt,
/// a bold digit 5.3 pt.
const CHARACTER: f64 = 5.2;
/// Space between neighbouring columns, in points. `\tabcolsep` is set to half of it.
const COLUMN_GAP: f64 = 6.0;
/// Largest number of rows of a table on one page. A row takes 11 pt at 9 pt, and a page has 550 pt, including captions of
/// some lines.
const MOST_ROWS: usize = 36;
/// Text size of long tables, and the width of its characters relative to `\\small`. Small letters of Computer Modern are
/// wider than in proportion.
const LONG_SIZE: &str = "\\scriptsize";
const LONG_SCALE: f64 = 0.9;
/// Smallest scale at which text stays readable. A table that needs a smaller scale is split.
const LEAST_SCALE: f64 = 7.0 / 9.0;

/// Characters with LaTeX commands. Because of these commands, characters beyond ASCII that this crate writes need no
/// other engine.
const WORDS: [(char, &str); 22] = [
    ('&', "\\&"),
    ('%', "\\%"),
    ('$', "\\$"),
    ('#', "\\#"),
    ('_', "\\_"),
    ('{', "\\{"),
    ('}', "\\}"),
    ('\u{2019}', "'"),
    ('\u{b1}', "$\\pm$"),
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

/// Returns `text` with every character that has a meaning in LaTeX replaced.
fn escape(text: &str) -> String {
    let shown =
        |c: char| WORDS.iter().find(|word| word.0 == c).map_or(c.to_string(), |word| word.1.to_owned());
    text.chars().map(shown).collect()
}

fn points(characters: usize) -> f64 {
    characters as f64 * CHARACTER
}

/// Returns the number of characters in the width of a column: that of its longest cell, or of the longest word of its
/// heading.
fn characters(table: &Table, column: usize) -> usize {
    let cells = table.rows.iter().map(|row| row.cells[column].chars().count());
    let words = table.columns[column].heading.split(' ').map(|word| word.chars().count());
    cells.chain(words).max().unwrap_or(0)
}

/// Returns the natural width of columns with their headings, in points.
fn width(table: &Table, columns: &[usize]) -> f64 {
    let run_width = |(group, run): (&str, &[usize])| {
        let cells: f64 = run.iter().map(|&column| points(characters(table, column)) + COLUMN_GAP).sum();
        cells.max(points(group.chars().count()) + COLUMN_GAP)
    };
    table.runs(columns).map(run_width).sum()
}

/// Returns the columns of each part of a table that is too wide for one part. Every part begins with `labels`, which name
/// the rows. Columns of one group stay together if they fit.
fn parts(table: &Table, labels: &[usize], scale: f64) -> Vec<Vec<usize>> {
    let fits = |columns: &[usize]| width(table, columns) <= TEXT_WIDTH / scale;
    let others: Vec<usize> = (table.labels..table.columns.len()).collect();
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for (_, group) in table.runs(&others) {
        let together = if fits(&[labels, group].concat()) { group.len() } else { 1 };
        for columns in group.chunks(together) {
            match parts.last_mut() {
                Some(part) if fits(&[part, columns].concat()) => part.extend(columns),
                _ => parts.push([labels, columns].concat()),
            }
        }
    }
    parts
}

/// Returns `l` for a column that names rows, and `r` for a column of numbers.
fn side(table: &Table, column: usize) -> char {
    if column < table.labels { 'l' } else { 'r' }
}

/// Returns a heading with each word on a line of its own.
fn heading(table: &Table, column: usize) -> String {
    let words = table.columns[column].heading.split(' ');
    let words: Vec<String> = words.map(|word| format!("\\textbf{{{}}}", escape(word))).collect();
    format!("\\shortstack[{}]{{{}}}", side(table, column), words.join("\\\\"))
}

/// Returns the head of a table with some of the columns: groups and headings, with rules above and below.
fn head(table: &Table, columns: &[usize]) -> String {
    let mut out = "    \\toprule\n".to_owned();
    if columns.iter().any(|&column| !table.columns[column].group.is_empty()) {
        let (mut heads, mut rules, mut first) = (Vec::new(), String::new(), 1);
        for (group, run) in table.runs(columns) {
            heads.push(format!("\\multicolumn{{{}}}{{c}}{{{}}}", run.len(), escape(group)));
            if !group.is_empty() {
                let _ = write!(rules, " \\cmidrule(lr){{{first}-{}}}", first + run.len() - 1);
            }
            first += run.len();
        }
        let _ = write!(out, "    {} \\\\\n   {rules}\n", heads.join(" & "));
    }
    let headings: Vec<String> = columns.iter().map(|&column| heading(table, column)).collect();
    let _ = writeln!(out, "    {} \\\\\n    \\midrule", headings.join(" & "));
    out
}

/// Returns the lines of the rows that have a value in some of the columns. Blocks are separated. `above` returns the text
/// above each block.
fn lines(table: &Table, columns: &[usize], above: impl Fn(&Row) -> String) -> String {
    let has_any =
        |row: &&Row| columns.iter().any(|&column| column >= table.labels && row.cells[column] != DASH);
    let mut out = String::new();
    for block in table.rows.chunk_by(|_, next| !next.rule) {
        let mut rows = block.iter().filter(has_any).peekable();
        if let Some(first) = rows.peek() {
            out.push_str(if out.is_empty() { "" } else { "    \\midrule\n" });
            out.push_str(&above(first));
        }
        while let Some(row) = rows.next() {
            // The paper's row stays on the same page, below ours.
            let stays = if rows.peek().is_some_and(|next| next.is_paper) { "*" } else { "" };
            let cells: Vec<String> = columns.iter().map(|&column| cell(table, row, column)).collect();
            let _ = writeln!(out, "    {} \\\\{stays}", cells.join(" & "));
        }
    }
    out
}

/// Returns a cell in LaTeX. Negative numbers have a minus sign, not a hyphen.
fn cell(table: &Table, row: &Row, column: usize) -> String {
    let text = match row.cells[column].strip_prefix('-') {
        Some(digits) if column >= table.labels => format!("$-${}", escape(digits)),
        _ => escape(&row.cells[column]),
    };
    if row.is_paper { format!("\\textit{{{text}}}") } else { text }
}

/// Returns the caption of a part of a table. The first part also has the label of the table.
fn caption(table: &Table, part: usize) -> String {
    let label = if part == 0 { format!("\\label{{tab:{}}}", table.name) } else { String::new() };
    format!("\\caption{{{}}}{label}", escape(&format!("{}. {}", table.title, table.caption)))
}

/// Returns floats of parts of the columns. Each is at most as wide as the text, also in a document of two columns.
fn float(table: &Table) -> String {
    let labels: Vec<usize> = (0..table.labels).collect();
    let mut out = String::new();
    for (part, columns) in parts(table, &labels, LEAST_SCALE).iter().enumerate() {
        let sides: String = columns.iter().map(|&column| side(table, column)).collect();
        // Estimated widths may be wrong, so the table has its own width unless there is less room.
        let _ = write!(
            out,
            "\\begin{{table*}}[t]\n  \\centering\n  \\small\n  \\setlength{{\\emergencystretch}}{{3em}}\n  {}\n  \
             \\setlength{{\\tabcolsep}}{{{}pt}}\n  \\resizebox{{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}}{{!}}{{%\n  \
             \\begin{{tabular}}{{{sides}}}\n{}{}    \\bottomrule\n  \\end{{tabular}}%\n  }}\n\\end{{table*}}\n",
            caption(table, part),
            COLUMN_GAP / 2.0,
            head(table, columns),
            lines(table, columns, |_| String::new())
        );
    }
    out
}

/// Returns long tables of parts of the columns, over as many pages as they need. In a document of two columns they are
/// set in one column, because `longtable` requires this. All labels but the last are above their block.
fn long(table: &Table) -> String {
    let above = table.labels.saturating_sub(1);
    let mut out = format!(
        "\\makeatletter\n\\let\\lexisplatback\\relax\n\\if@twocolumn\\onecolumn\\let\\lexisplatback\\twocolumn\\fi\n\
         \\makeatother\n\\begingroup\n\\setlength{{\\LTcapwidth}}{{\\linewidth}}\n\\setlength{{\\emergencystretch}}{{3em}}\n\
         \\setlength{{\\tabcolsep}}{{{}pt}}\n",
        COLUMN_GAP / 2.0
    );
    for (part, columns) in parts(table, &[above], LONG_SCALE).iter().enumerate() {
        let (count, head) = (columns.len(), head(table, columns));
        let sides: String = columns.iter().map(|&column| side(table, column)).collect();
        let name = |row: &Row| match row.cells[..above].join(", ") {
            name if name.is_empty() => name,
            // The line is not wider than the table, for any names.
            name => format!(
                "    \\multicolumn{{{count}}}{{l}}{{\\makebox[0pt][l]{{\\textit{{{}}}}}}} \\\\*\n",
                escape(&name)
            ),
        };
        let _ = write!(
            out,
            "{LONG_SIZE}\n\\begin{{longtable}}{{{sides}}}\n  {} \\\\\n{head}  \\endfirsthead\n{head}  \
             \\endhead\n    \\midrule\n    \\multicolumn{{{count}}}{{r}}{{\\textit{{continued}}}} \\\\\n  \\endfoot\n    \
             \\bottomrule\n  \\endlastfoot\n{}\\end{{longtable}}\n",
            caption(table, part),
            lines(table, columns, name)
        );
    }
    out.push_str("\\endgroup\n\\lexisplatback\n");
    out
}

pub(super) fn write(table: &Table) -> String {
    if table.rows.len() > MOST_ROWS { long(table) } else { float(table) }
}

#[cfg(test)]
mod tests {
    use lexisplat_testing::{Need, missing};

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
        assert!(latex.contains(
            "    \\midrule\n    \\textit{p,q} & \\textit{$-$0.12} & \\textit{--} \\\\\n    \\bottomrule"
        ));
        // Every line of cells has as many as the header.
        for line in latex.lines().filter(|line| line.ends_with("\\\\") && !line.contains("multicolumn")) {
            assert_eq!(line.replace("\\&", "").matches('&').count(), 2, "{line}");
        }
        assert_eq!(latex.matches('{').count(), latex.matches('}').count());
    }

    /// Characters beyond ASCII that this crate itself writes must not need another engine.
    #[test]
    fn typography_is_spelled_in_ascii() {
        assert_eq!(
            escape("1\u{2013}2 \u{2212}3 4\u{d7}5 \u{201c}a\u{201d} b\u{a0}c"),
            "1--2 $-$3 4$\\times$5 ``a'' b~c"
        );
        for table in both(&crate::testing::results()) {
            assert!(table.to_latex().is_ascii(), "{}", table.name);
            assert!(long(&table).is_ascii(), "{}", table.name);
        }
    }

    #[test]
    fn negative_numbers_have_a_minus_sign() {
        let mut table = odd();
        table.rows[0].cells = ["-3", "-0.14", "-3.0"].map(str::to_owned).into();
        assert!(table.to_latex().contains("    -3 & $-$0.14 & $-$3.0 \\\\\n"), "names keep their hyphen");
    }

    /// Both tables of results.
    fn both(results: &crate::Results) -> [Table; 2] {
        [crate::tables::means(results), crate::tables::scenes(results)]
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

    /// Results of many scenes with long names, each changed by `change`.
    fn with_long_names(change: impl Fn(&mut crate::SceneResult)) -> crate::Results {
        let mut results = crate::testing::results();
        let mut scene = results.scenes[0].clone();
        for k in 0..20 {
            scene.name = format!("a scene with a long name {k}");
            change(&mut scene);
            results.scenes.push(scene.clone());
        }
        results
    }

    #[test]
    fn wide_tables_fit_the_text() {
        let results = with_long_names(|scene| scene.ply_bytes = 123_456_789_012);
        let [means, scenes] = both(&results);
        assert!(means.rows.len() <= MOST_ROWS && scenes.rows.len() > MOST_ROWS);
        let widths = widths(&means.to_latex());
        assert_eq!(widths.len(), 2, "16 columns do not fit at once");
        assert!(widths.iter().all(|width| *width <= TEXT_WIDTH / LEAST_SCALE), "{widths:?}");
        assert!(means.to_latex().starts_with("\\begin{table*}[t]"));
        let latex = scenes.to_latex();
        assert!(latex.matches("\\begin{longtable}").count() >= 2, "16 columns do not fit at once");
        // Each part has all rows, and each column is in one part.
        let parts = parts(&scenes, &[2], LONG_SCALE);
        let columns: Vec<usize> = parts.iter().flat_map(|part| part[1..].to_vec()).collect();
        assert_eq!(columns, (scenes.labels..scenes.columns.len()).collect::<Vec<_>>());
        assert_eq!(latex.matches("tol 0.05").count() % latex.matches("\\begin{longtable}").count(), 0);
    }

    #[test]
    fn blocks_of_a_long_table_are_named_above_them() {
        let latex = long(&crate::tables::scenes(&crate::testing::results()));
        assert!(latex.contains("\\makebox[0pt][l]{\\textit{bonsai, 3DGS}}"), "{latex}");
        assert_eq!(latex.matches('{').count(), latex.matches('}').count());
    }

    /// Compiles a document with these options and every table; what LaTeX found too wide for its place.
    fn too_wide(results: &crate::Results, options: &str) -> Option<Vec<String>> {
        let folder = tempfile::tempdir().unwrap();
        let mut text = format!(
            "\\documentclass[{options}]{{article}}\n\\usepackage{{booktabs,graphicx,longtable}}\n\\begin{{document}}\nText.\n"
        );
        for table in both(results) {
            for (form, latex) in [("float", float(&table)), ("long", long(&table))] {
                let name = format!("{}-{form}.tex", table.name);
                std::fs::write(folder.path().join(&name), latex).unwrap();
                let _ = writeln!(text, "\\input{{{name}}}\\clearpage");
            }
        }
        text.push_str("\\end{document}\n");
        std::fs::write(folder.path().join("paper.tex"), text).unwrap();
        let mut command = std::process::Command::new("pdflatex");
        command.args(["-interaction=nonstopmode", "-halt-on-error", "-draftmode", "paper.tex"]);
        let output = command.current_dir(folder.path()).output().ok()?;
        let log = String::from_utf8_lossy(&output.stdout).into_owned();
        if log.contains("`booktabs.sty' not found") {
            return None;
        }
        assert!(output.status.success(), "{options}: {log}");
        Some(log.lines().filter(|line| line.starts_with("Overfull \\hbox")).map(str::to_owned).collect())
    }

    #[test]
    fn papers_of_one_and_two_columns_have_no_overfull_box() {
        let results = with_long_names(|_| ());
        for options in ["onecolumn", "twocolumn"] {
            match too_wide(&results, options) {
                Some(found) => assert!(found.is_empty(), "{options}: {found:#?}"),
                None => missing(Need::Latex, "pdflatex or booktabs are not installed"),
            }
        }
    }
}
