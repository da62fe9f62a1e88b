//! A self-contained HTML page about a sweep.
//!
//! The page contains its styles, script, figures and pictures, and its security policy forbids every request. Without
//! scripts it still shows everything. It follows the reader's light or dark theme.

mod cards;
mod parts;
mod sections;

use maud::html;

pub(crate) use parts::{card, decibels, document, image, scores, section};

use super::grid::Grid;
use super::picture::Part;
use super::{Figure, PictureFiles, Results};

const STYLE: &str = include_str!("sweep.css");
const SCRIPT: &str = include_str!("sweep.js");

/// Returns the page as UTF-8 text. The same input gives the same page. `date` is printed as it is.
pub(crate) fn sweep_html(
    results: &Results,
    figures: &[Figure],
    pictures: &[(&PictureFiles, Vec<Part>)],
    date: Option<&str>,
) -> String {
    let body = html! {
        (sections::header(&Grid::new(results), date))
        main {
            @if !results.scenes.is_empty() {
                (sections::pictures(results, pictures))
                (sections::figures(figures))
                (sections::means(results))
            }
            (sections::skipped(results))
            @if !results.scenes.is_empty() { (sections::details(results, figures)) }
        }
        (sections::footer(results))
    };
    document("Sweep", STYLE, &body, SCRIPT)
}

#[cfg(test)]
mod tests {
    use super::super::figures::figures;
    use super::super::testing::{ODD, results};
    use super::*;
    use crate::report::testing::check_nesting;

    /// `text` as the page has it.
    fn escape(text: &str) -> String {
        html! { (text) }.into_string()
    }

    fn files(setting: &str, view: &str) -> PictureFiles {
        PictureFiles {
            scene: 3,
            setting: setting.to_owned(),
            view: view.to_owned(),
            original: "".into(),
            compressed: "".into(),
            difference: "".into(),
            photo: None,
        }
    }

    /// Pictures of these classes, their bytes a text.
    fn parts(all: &[(&'static str, &str)]) -> Vec<Part> {
        all.iter().map(|(class, text)| Part { class, what: class, png: (*text).into() }).collect()
    }

    /// Checks the rules of every page.
    fn check(page: &str) {
        check_nesting(page);
        assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
        for outside in ["http://", "https://", "@import", "<link", "src=\"/", "href=\"/", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
        for number in ["NaN", ">inf", " inf", "-inf"] {
            assert!(!page.contains(number), "{number}");
        }
    }

    #[test]
    fn page_holds_everything() {
        let results = results();
        let figures = figures(&results);
        let names = [files("tol 0.1", "front"), files("tol 0.1", "ba<ck"), files("balanced", "front")];
        let three = [("before", "one"), ("after", "two"), ("difference", "three")];
        let four = [&three[..], &[("photo", "photo")]].concat();
        let pictures = [(&names[0], parts(&four)), (&names[1], parts(&three)), (&names[2], parts(&three))];
        let page = sweep_html(&results, &figures, &pictures, Some("1 <May> 2026"));
        check(&page);
        // "one", "two" and "three" in base64, three times each; the photo once.
        for (bytes, count) in [("b25l", 3), ("dHdv", 3), ("dGhyZWU=", 3), ("cGhvdG8=", 1)] {
            assert_eq!(page.matches(&format!("base64,{bytes}\"")).count(), count, "{bytes}");
        }
        for figure in &figures {
            assert_eq!(page.matches(&format!("id=\"figure-{}\"", figure.name)).count(), 1, "{}", figure.name);
        }
        assert_eq!(page.matches("<svg ").count(), figures.len());
        for table in ["means", "scenes", "models", "skipped"] {
            assert_eq!(page.matches(&format!("id=\"table-{table}\"")).count(), 1, "{table}");
        }
        for text in [ODD, "1 <May> 2026", "ba<ck", "no such file: a|b & \"c\"", &results.command] {
            assert!(page.contains(&escape(text)), "{text}");
        }
        assert!(!page.contains(ODD) && !page.contains("<May>"));
        for (title, _) in sections::notes() {
            assert!(page.contains(&escape(title)), "{title}");
        }
        // 42 dB of bonsai by two methods' means: (42 + 44 + 40) / 3; garden is identical.
        assert!(page.contains("<dd>42.00<small> dB</small></dd>"));
        assert!(page == sweep_html(&results, &figures, &pictures, Some("1 <May> 2026")));
    }

    #[test]
    fn empty_results_have_a_page() {
        let page = sweep_html(&Results::default(), &[], &[], None);
        check(&page);
        assert!(page.contains("Nothing was evaluated"));
        let mut skipped = Results::default();
        skipped.skipped = results().skipped;
        let page = sweep_html(&skipped, &[], &[], None);
        check(&page);
        assert!(page.contains("play&lt;room&gt;"));
    }

    /// The style sheet swaps the figures' colours by their values.
    #[test]
    fn the_style_knows_the_figures_colours() {
        for colour in super::super::figures::colours() {
            assert!(STYLE.contains(&format!("\"{colour}\"")), "{colour}");
        }
    }
}
