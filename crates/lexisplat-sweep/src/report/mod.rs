//! One self-contained HTML page about a compressed scene: what happened, pictures, figures.
//!
//! The page carries its styles, script and pictures in itself and forbids itself any request. Without
//! scripts it still shows everything but the dictionary; it follows the reader's light or dark theme.

mod atoms;
pub(crate) mod base64;
mod charts;
mod sections;
pub(crate) mod text;

use std::fmt::Write;

use lexisplat::Model;

use lexisplat_eval::Comparison;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Everything the page tells.
#[derive(Debug, Clone, Copy)]
pub struct Report<'a> {
    /// The scene's name.
    pub title: &'a str,
    /// The command line that makes the same again.
    pub command: &'a str,
    /// The compressed scene.
    pub model: &'a Model,
    /// Bytes of the PLY.
    pub ply_bytes: u64,
    /// Bytes of the .lexi file.
    pub file_bytes: u64,
    /// Bytes of each part of the .lexi file by name, header included: `lexi::attribute_bytes`.
    pub attributes: &'a [(String, u64)],
    /// Seconds spent on learning the dictionary.
    pub learn_seconds: f64,
    /// Seconds spent on coding.
    pub code_seconds: f64,
    /// Scores of the compressed scene against the original.
    pub comparison: &'a Comparison,
    /// Pictures to show; may be fewer than the views compared.
    pub pictures: &'a [Picture<'a>],
    /// What [`Picture::difference`] multiplies differences by.
    pub amplification: f32,
}

/// One view of both scenes, as PNG files of one size.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// The view's name, as in [`Report::comparison`].
    pub name: &'a str,
    /// The original scene.
    pub original: &'a [u8],
    /// The compressed scene.
    pub compressed: &'a [u8],
    /// Their amplified difference.
    pub difference: &'a [u8],
}

/// The page as UTF-8 text; the same input gives the same page.
#[must_use]
pub fn html(report: &Report<'_>) -> String {
    let mut page = String::with_capacity(1 << 16);
    let title = text::escape(report.title);
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
         style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\
         <title>{title} \u{b7} lexisplat</title>\n<style>\n{STYLE}</style></head>\n<body>\n"
    );
    let facts = sections::Facts::new(report);
    sections::header(&mut page, &facts);
    page.push_str("<main>\n");
    sections::pictures(&mut page, &facts);
    sections::steps(&mut page, &facts);
    sections::promise(&mut page, &facts);
    sections::sizes(&mut page, &facts);
    sections::nonzeros(&mut page, &facts);
    sections::dictionary(&mut page, &facts);
    sections::views(&mut page, &facts);
    page.push_str("</main>\n");
    sections::footer(&mut page, &facts);
    let _ = writeln!(page, "<script>\n{SCRIPT}</script>\n</body></html>");
    page
}

#[cfg(test)]
pub(crate) mod testing {
    /// Every opened element is closed in order: enough of a parser for what the page uses.
    pub(crate) fn check_nesting(page: &str) {
        let void = ["meta", "img", "input", "br", "rect", "line"];
        let mut open: Vec<&str> = Vec::new();
        let mut rest = page;
        while let Some(start) = rest.find('<') {
            rest = &rest[start + 1..];
            let end = rest.find('>').expect("every tag ends");
            let (tag, after) = rest.split_at(end);
            let name = tag.trim_start_matches('/').split([' ', '\n']).next().unwrap().trim_end_matches('/');
            if tag.starts_with('/') {
                assert_eq!(open.pop(), Some(name), "closing {tag}");
            } else if !tag.starts_with('!') && !tag.ends_with('/') && !void.contains(&name) {
                open.push(name);
            }
            rest = after;
            if name == "script" || name == "style" {
                rest = &rest[rest.find("</").unwrap_or(0)..];
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::{
        Dictionary, Escapes, Geometry, Indices, Pursuit, Record, SceneMeta, ShDegree, SparseCodes, Values,
    };

    use super::testing::check_nesting;
    use super::*;
    use lexisplat_eval::ViewScore;

    fn model(degree: ShDegree) -> Model {
        let n = 4;
        let dim = degree.rest();
        let (dictionary, codes) = if dim == 0 {
            let empty = (Indices::U8(Vec::new()), Values::F32(Vec::new()));
            (
                Dictionary::empty(),
                SparseCodes::new(&Dictionary::empty(), vec![0; n], empty.0, empty.1, Escapes::default()),
            )
        } else {
            let atoms = (0..3 * dim).map(|i| if i % (dim + 1) == 0 { 1.0 } else { 0.0 }).collect();
            let dictionary = Dictionary::new(degree, atoms).unwrap();
            let indices = Indices::U8(vec![1, 0, 1]);
            let values = Values::F32(vec![0.5, -0.25, 0.125]);
            let escapes = Escapes { gaussians: vec![3], rows: vec![0.5; dim] };
            let codes = SparseCodes::new(&dictionary, vec![1, 2, 0, 0], indices, values, escapes);
            (dictionary, codes)
        };
        let geometry = Geometry {
            positions: vec![[0.0; 3]; n],
            dc: vec![[0.0; 3]; n],
            opacities: vec![0.0; n],
            scales: vec![[0.0; 3]; n],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
            ..Geometry::default()
        };
        let record = Record {
            tolerance: Some(0.1),
            max_nonzeros: None,
            pursuit: Some(Pursuit::Ols),
            seed: 0,
            max_residual: 0.099,
            rms_residual: 0.08,
            over_tolerance: 0,
        };
        Model::new(geometry, SceneMeta::default(), dictionary, codes.unwrap(), record).unwrap()
    }

    fn page(model: &Model, comparison: &Comparison, name: &str) -> String {
        let attributes =
            [("position".to_owned(), 48), ("codes.values".to_owned(), 6), ("header".to_owned(), 900)];
        let picture = Picture { name, original: b"one", compressed: b"two", difference: b"three" };
        html(&Report {
            title: "a <b>scene</b> & more",
            command: "lexisplat demo --tol '0.1'",
            model,
            ply_bytes: 4000,
            file_bytes: 954,
            attributes: &attributes,
            learn_seconds: 0.5,
            code_seconds: f64::NAN,
            comparison,
            pictures: &[picture],
            amplification: 16.0,
        })
    }

    fn view(name: &str, psnr: Option<f64>) -> ViewScore {
        ViewScore::new(name, [8, 6], psnr, 0.99, Default::default())
    }

    #[test]
    fn page_is_whole_and_names_nothing_outside() {
        let scores = Comparison::of(vec![view("front", Some(45.25)), view("b<a>ck", None)]);
        let page = page(&model(ShDegree::THREE), &scores, "front");
        check_nesting(&page);
        assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
        for outside in ["http://", "https://", "url(", "@import", "<link"] {
            assert!(!page.contains(outside), "{outside}");
        }
        assert!(!page.contains("<b>scene") && page.contains("a &lt;b&gt;scene&lt;/b&gt; &amp; more"));
        assert!(page.contains("b&lt;a&gt;ck") && page.contains("identical") && page.contains("45.25"));
        assert!(page.contains("data:image/png;base64,b25l"), "the picture's bytes");
        assert!(!page.contains("NaN") && !page.contains("inf"), "numbers only");
    }

    #[test]
    fn every_degree_and_emptiness_has_a_page() {
        for degree in 0..=4 {
            let model = model(ShDegree::new(degree).unwrap());
            let none = Comparison::of(Vec::new());
            let page = page(&model, &none, "gone");
            check_nesting(&page);
            assert_eq!(page.contains("id=\"atoms\""), degree > 0);
            assert!(!page.contains("NaN"));
        }
    }

    #[test]
    fn a_lifted_promise_is_not_sold_as_kept() {
        let with = |change: fn(&mut Record)| {
            let (geometry, meta, dictionary, codes, mut record) = model(ShDegree::THREE).into_parts();
            change(&mut record);
            Model::new(geometry, meta, dictionary, codes, record).unwrap()
        };
        let scores = Comparison::of(vec![view("front", Some(45.25))]);
        assert!(page(&model(ShDegree::THREE), &scores, "front").contains("Kept"));
        let capped = with(|record| (record.max_nonzeros, record.over_tolerance) = (Some(4), 2));
        assert!(!page(&capped, &scores, "front").contains("Kept"));
        let free = with(|record| (record.max_nonzeros, record.tolerance) = (Some(4), None));
        assert!(!page(&free, &scores, "front").contains("Kept"));
    }
}
