//! The results as a Markdown report beside the figures.

use std::fmt::Write;

use super::saturation::saturation;
use super::table::{Table, escape_markdown as escape};
use super::{Figure, NOTES, Results, tables};

/// A report in Markdown: the main tables, and each of `figures`, which are in the folder `figures` beside it.
pub(crate) fn sweep_markdown(results: &Results, figures: &[Figure], date: Option<&str>) -> String {
    let mut out = String::from("# Results of a sweep\n\n");
    if results.scenes.is_empty() {
        out.push_str("Nothing was evaluated.\n\n");
    }
    if !results.command.is_empty() {
        // A fence longer than any in the command cannot be closed by it.
        let longest = results.command.split(|c| c != '`').map(str::len).max().unwrap_or(0);
        let fence = "`".repeat(longest.max(2) + 1);
        let _ = write!(out, "{fence}sh\n{}\n{fence}\n\n", results.command);
    }
    let mut facts = results.facts();
    if let Some(date) = date {
        facts.insert(usize::from(!results.version.is_empty()), date.to_owned());
    }
    let rounded = if results.eight_bit { "rounded to 8 bits" } else { "not rounded" };
    facts.push(format!("pictures {rounded} before scoring"));
    let _ = write!(out, "{}.\n\n", escape(&facts.join(", ")));
    section(&mut out, &tables::summary(results));
    let drawn = figures.iter().map(|figure| {
        let (title, caption) = (escape(&figure.title), escape(&figure.caption));
        format!("![{title}](<figures/{}.svg>)\n\n{caption}\n\n", figure.name)
    });
    headed(&mut out, "Figures", &drawn.collect::<String>());
    let paragraphs = saturation(results);
    let paragraphs: String = paragraphs.iter().map(|text| format!("{}\n\n", escape(text))).collect();
    headed(&mut out, "Does quality level off?", &paragraphs);
    for table in [
        tables::main(results, None),
        tables::vs_photos(results),
        tables::drops(results),
        tables::psnr(results),
        tables::nonzeros(results),
    ] {
        section(&mut out, &table);
    }
    if !results.scenes.is_empty() {
        let notes = NOTES.iter().map(|note| format!("- **{}.** {}\n", escape(note.title), escape(note.text)));
        headed(&mut out, "How things are counted", &notes.chain(["\n".to_owned()]).collect::<String>());
    }
    section(&mut out, &tables::models(results));
    section(&mut out, &tables::skipped(results));
    out.truncate(out.trim_end().len());
    out.push('\n');
    out
}

/// `content` under a heading, if there is any.
fn headed(out: &mut String, heading: &str, content: &str) {
    if !content.is_empty() {
        let _ = write!(out, "## {}\n\n{content}", escape(heading));
    }
}

fn section(out: &mut String, table: &Table) {
    if table.is_empty() {
        return;
    }
    let caption =
        if table.caption.is_empty() { String::new() } else { format!("{}\n\n", escape(&table.caption)) };
    headed(out, &table.title, &format!("{caption}{}\n", table.to_markdown()));
}

#[cfg(test)]
mod tests {
    use super::super::testing::results;
    use super::*;

    #[test]
    fn the_report_holds_tables_and_figures() {
        let figure = Figure {
            name: "f (1)".to_owned(),
            title: "A [title]".to_owned(),
            caption: "A caption.".to_owned(),
            svg: String::new(),
            png: Vec::new(),
            pdf: Vec::new(),
        };
        let mut results = results();
        results.command = "lexisplat ``` sweep".to_owned();
        let text = sweep_markdown(&results, &[figure], Some("2026-05-01"));
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
