//! The results as Markdown, to be kept beside the figures.

use std::fmt::Write;

use super::table::{Table, escape_markdown as escape};
use super::{Figure, NOTES, Results, level_off, tables};

/// A report in Markdown: the main tables, and each of `figures` by the path it is kept at relative to the
/// report.
#[must_use]
pub fn sweep_markdown(results: &Results, figures: &[(String, &Figure)], date: Option<&str>) -> String {
    let mut out = String::from("# Results of a sweep\n\n");
    if results.scenes.is_empty() {
        out.push_str("Nothing was evaluated.\n\n");
    }
    if !results.command.is_empty() {
        // A fence longer than any in the command cannot be closed by it.
        let fence =
            "`".repeat(results.command.split(|c| c != '`').map(str::len).max().unwrap_or(0).max(2) + 1);
        let _ = write!(out, "{fence}sh\n{}\n{fence}\n\n", results.command);
    }
    let mut facts = Vec::new();
    if !results.version.is_empty() {
        facts.push(format!("lexisplat {}", results.version));
    }
    facts.extend(date.map(str::to_owned));
    if !results.pursuit.is_empty() {
        facts.push(format!("{} pursuit", results.pursuit));
    }
    if !results.layout.is_empty() {
        facts.push(format!("values as {}", results.layout));
    }
    let rounded = if results.eight_bit { "rounded to 8 bits" } else { "not rounded" };
    facts.push(format!("pictures {rounded} before scoring"));
    let _ = write!(out, "{}.\n\n", escape(&facts.join(", ")));
    section(&mut out, &tables::summary(results));
    if !figures.is_empty() {
        out.push_str("## Figures\n\n");
        for (path, figure) in figures {
            // Angle brackets let a path hold anything but themselves and line ends.
            let path: String = path
                .chars()
                .map(|c| if matches!(c, '<' | '>') || c.is_control() { '_' } else { c })
                .collect();
            let _ = write!(out, "![{}](<{path}>)\n\n{}\n\n", escape(&figure.title), escape(&figure.caption));
        }
    }
    let paragraphs = level_off(results);
    if !paragraphs.is_empty() {
        out.push_str("## Does quality level off?\n\n");
        for paragraph in paragraphs {
            let _ = write!(out, "{}\n\n", escape(&paragraph));
        }
    }
    for table in [
        tables::main(results, None),
        tables::truth(results),
        tables::drops(results),
        tables::psnr(results),
        tables::nonzeros(results),
    ] {
        section(&mut out, &table);
    }
    if !results.scenes.is_empty() {
        out.push_str("## How things are counted\n\n");
        for note in NOTES {
            let _ = writeln!(out, "- **{}.** {}", escape(note.title), escape(note.text));
        }
        out.push('\n');
    }
    section(&mut out, &tables::models(results));
    section(&mut out, &tables::skipped(results));
    out.truncate(out.trim_end().len());
    out.push('\n');
    out
}

fn section(out: &mut String, table: &Table) {
    if table.is_empty() {
        return;
    }
    let _ = write!(out, "## {}\n\n", escape(&table.title));
    if !table.caption.is_empty() {
        let _ = write!(out, "{}\n\n", escape(&table.caption));
    }
    let _ = writeln!(out, "{}", table.to_markdown());
}

#[cfg(test)]
mod tests {
    use super::super::testing::results;
    use super::*;

    #[test]
    fn the_report_holds_tables_and_figures() {
        let figure = Figure {
            name: "f".to_owned(),
            title: "A [title]".to_owned(),
            caption: "A caption.".to_owned(),
            svg: String::new(),
            png: Vec::new(),
        };
        let mut results = results();
        results.command = "lexisplat ``` sweep".to_owned();
        let text = sweep_markdown(&results, &[("figures/f (1).svg".to_owned(), &figure)], Some("2026-05-01"));
        assert!(text.starts_with(
            "# Results of a sweep\n\n````sh\nlexisplat ``` sweep\n````\n\nlexisplat 0.1.0, 2026-05-01, "
        ));
        assert!(text.contains("![A \\[title\\]](<figures/f (1).svg>)\n\nA caption.\n\n"));
        for heading in ["Means over scenes", "Against photos", "How things are counted", "Models", "Skipped"]
        {
            assert!(text.contains(&format!("\n## {heading}\n\n")), "{heading}");
        }
        assert!(text.contains("| play&lt;room&gt; | PixelGS | Deep Blending |"));
        assert!(!text.contains("NaN") && text.ends_with("|\n"));
    }

    #[test]
    fn nothing_has_a_report() {
        assert_eq!(
            sweep_markdown(&Results::default(), &[], None),
            "# Results of a sweep\n\nNothing was evaluated.\n\npictures not rounded before scoring.\n"
        );
    }
}
