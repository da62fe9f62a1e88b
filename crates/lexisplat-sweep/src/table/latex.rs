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
/// Width of a column in points: the `article` class at 10 pt in two columns.
const COLUMN_WIDTH: f64 = 229.0;
/// Most rows of a table that is on one page. A row takes 11 pt at 9 pt, and a page has 550 pt, with captions of some lines.
const MOST_ROWS: usize = 36;
/// Sizes of text of long tables, and the width of characters beside `\\small`. Small letters of Computer Modern are wider
/// than in proportion.
const SIZES: [(&str, f64); 3] = [("\\small", 1.0), ("\\footnotesize", 0.95), ("\\scriptsize", LONG_SCALE)];
/// [`SIZES`] of the smallest text.
const LONG_SCALE: f64 = 0.9;
/// Smallest scale at which text stays readable. A table that needs a smaller one is split.
const LEAST_SCALE: f64 = 7.0 / 9.0;

/// Characters that LaTeX has words for. What this crate writes beyond ASCII needs no other engine so.
const WORDS: [(char, &str); 15] = [
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
fn parts(table: &Table, scale: f64) -> Vec<Vec<usize>> {
    let room = TEXT_WIDTH / scale;
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

/// The head of a table with some of the columns: groups and headings, with rules above and below.
fn head(table: &Table, columns: &[usize]) -> String {
    let mut out = "    \\toprule\n".to_owned();
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
    out
}

/// The sides of columns: what names a row is on the left.
fn sides(table: &Table, columns: &[usize]) -> String {
    columns.iter().map(|&column| if column < table.labels { 'l' } else { 'r' }).collect()
}

/// The line of a row with some of the columns.
fn line(row: &Row, columns: &[usize]) -> String {
    let cells: Vec<String> = columns.iter().map(|&column| shown(row.cell(column), row.style)).collect();
    format!("    {} \\\\\n", cells.join(" & "))
}

/// The `tabular` with some of the columns.
fn tabular(table: &Table, columns: &[usize]) -> String {
    let mut out = format!("  \\begin{{tabular}}{{{}}}\n{}", sides(table, columns), head(table, columns));
    for (i, row) in table.rows.iter().enumerate() {
        if row.rule && i > 0 {
            out.push_str("    \\midrule\n");
        }
        out.push_str(&line(row, columns));
    }
    out.push_str("    \\bottomrule\n  \\end{tabular}");
    out
}

/// A float of one page. It is never wider than its place: that of a column if it fits there, otherwise that of the text.
fn float(table: &Table) -> String {
    let parts = parts(table, LEAST_SCALE);
    let is_narrow = parts.iter().all(|columns| width(table, columns) <= COLUMN_WIDTH);
    let environment = if is_narrow { "table" } else { "table*" };
    let tabulars = parts.iter().map(|columns| {
        // Estimates may be wrong, so the width is that of the table unless there is less room.
        let fitted = "\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi";
        format!("  \\resizebox{{{fitted}}}{{!}}{{%\n{}%\n  }}", tabular(table, columns))
    });
    format!(
        "\\begin{{{environment}}}[t]\n  \\centering\n  \\small\n  \\setlength{{\\emergencystretch}}{{3em}}\n  \\caption{{{}}}\n  \\label{{tab:{}}}\n  \
         \\setlength{{\\tabcolsep}}{{{}pt}}\n{}\n\\end{{{environment}}}\n",
        caption(table),
        table.name,
        COLUMN_GAP / 2.0,
        tabulars.collect::<Vec<_>>().join("\n  \\par\\medskip\n")
    )
}

fn caption(table: &Table) -> String {
    escape(format!("{}. {}", table.title, table.caption).trim())
}

/// How many of the first labels of a long table are the same in every row of each block. They stand above the block.
fn shared_labels(table: &Table) -> usize {
    let most = table.labels.saturating_sub(1);
    let mut blocks = table.rows.chunk_by(|_, next| !next.rule);
    let is_shared =
        |block: &[Row], column: usize| block.iter().all(|row| row.cell(column) == block[0].cell(column));
    let shared = |block: &[Row]| (0..most).take_while(|&column| is_shared(block, column)).count();
    let first = blocks.next().map_or(0, shared);
    blocks.fold(first, |least, block| least.min(shared(block)))
}

/// Long tables of parts of the columns, over as many pages as they need. In a document of two columns they are set in one, for
/// `longtable` cannot do otherwise.
fn long(table: &Table) -> String {
    let shared = shared_labels(table);
    let rest = Table {
        columns: table.columns[shared..].to_vec(),
        labels: table.labels - shared,
        rows: table
            .rows
            .iter()
            .map(|row| Row { cells: row.cells.iter().skip(shared).cloned().collect(), ..row.clone() })
            .collect(),
        ..table.clone()
    };
    let mut out = "\\makeatletter\n\\let\\lexisplatback\\relax\n\\if@twocolumn\\onecolumn\\let\\lexisplatback\\twocolumn\\fi\n\
                   \\makeatother\n\\begingroup\n\\setlength{\\LTcapwidth}{\\linewidth}\n\\setlength{\\emergencystretch}{3em}\n"
        .to_owned();
    let _ = writeln!(out, "\\setlength{{\\tabcolsep}}{{{}pt}}", COLUMN_GAP / 2.0);
    for (part, columns) in parts(&rest, LONG_SCALE).iter().enumerate() {
        let natural = width(&rest, columns);
        let fits = |scale: &&(&str, f64)| natural * scale.1 <= TEXT_WIDTH;
        let (size, _) = SIZES.iter().find(fits).copied().unwrap_or(SIZES[SIZES.len() - 1]);
        let _ = writeln!(out, "{size}\n\\begin{{longtable}}{{{}}}", sides(&rest, columns));
        let (caption, head) = (caption(&rest), head(&rest, columns));
        let label = if part == 0 { format!("\\label{{tab:{}}}", rest.name) } else { String::new() };
        let count = columns.len();
        let _ = write!(
            out,
            "  \\caption{{{caption}}}{label} \\\\\n{head}  \\endfirsthead\n{head}  \\endhead\n    \\midrule\n    \
             \\multicolumn{{{count}}}{{r}}{{\\textit{{continued}}}} \\\\\n  \\endfoot\n    \\bottomrule\n  \\endlastfoot\n"
        );
        for (i, (row, whole)) in rest.rows.iter().zip(&table.rows).enumerate() {
            let starts = i == 0 || row.rule;
            if starts && i > 0 {
                out.push_str("    \\midrule\n");
            }
            if starts && shared > 0 {
                let names: Vec<String> =
                    (0..shared).map(|column| escape(&whole.cell(column).shown())).collect();
                // Not wider than the table, whatever names are.
                let _ = writeln!(
                    out,
                    "    \\multicolumn{{{count}}}{{l}}{{\\makebox[0pt][l]{{\\textit{{{}}}}}}} \\\\*",
                    names.join(", ")
                );
            }
            out.push_str(&line(row, columns));
        }
        out.push_str("\\end{longtable}\n");
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
        for table in crate::tables::all(&results) {
            let latex = table.to_latex();
            let widths = widths(&latex);
            assert_eq!(latex.contains("\\begin{longtable}"), table.rows.len() > MOST_ROWS, "{}", table.name);
            let environment =
                if widths.iter().all(|width| *width <= COLUMN_WIDTH) { "table" } else { "table*" };
            assert!(
                widths.is_empty() || latex.starts_with(&format!("\\begin{{{environment}}}[t]")),
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
        assert!(bytes.to_latex().matches("\\begin{longtable}").count() >= 2, "18 columns do not fit at once");
        // Each part has all rows, and each column is in one part.
        let columns: Vec<usize> =
            parts(&bytes, LONG_SCALE).iter().flat_map(|part| part[bytes.labels..].to_vec()).collect();
        assert_eq!(columns, (bytes.labels..bytes.columns.len()).collect::<Vec<_>>());
        let latex = bytes.to_latex();
        assert_eq!(latex.matches("tol 0.05").count() % latex.matches("\\begin{longtable}").count(), 0);
    }

    #[test]
    fn blocks_of_a_long_table_are_named_above_them() {
        let mut results = crate::testing::results();
        results.scenes = vec![results.scenes.swap_remove(0); 3];
        let views = crate::tables::views(&results);
        assert!(views.rows.len() > MOST_ROWS && shared_labels(&views) == 4);
        let latex = views.to_latex();
        assert!(latex.contains("\\makebox[0pt][l]{\\textit{bonsai, 3DGS, tol 0.1, photos}}"), "{latex}");
        // The view, and its scores.
        assert_eq!(latex.matches("\\begin{longtable}{lrrr}").count(), 1);
        assert_eq!(latex.matches('{').count(), latex.matches('}').count());
    }

    /// Compiles a document with these options and every table; what LaTeX found too wide for its place.
    fn too_wide(results: &crate::Results, options: &str) -> Option<Vec<String>> {
        use std::fmt::Write as _;
        let folder = tempfile::tempdir().unwrap();
        let mut text = format!(
            "\\documentclass[{options}]{{article}}\n\\usepackage{{booktabs,graphicx,longtable}}\n\\begin{{document}}\nText.\n"
        );
        for table in crate::tables::all(results) {
            let name = format!("{}.tex", table.name);
            std::fs::write(folder.path().join(&name), table.to_latex()).unwrap();
            let _ = writeln!(text, "\\input{{{name}}}\\clearpage");
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
