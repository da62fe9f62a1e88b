//! A self-contained HTML page about a scene and two compressed files of it: first the packed file, then the file in an
//! exact layout.
//!
//! The page contains its styles, its script and its pictures, and its security policy forbids every request. Without
//! scripts it shows everything except the dictionary. It follows the reader's light or dark theme.

mod atoms;
mod exact;
mod packed;

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use lexisplat::Model;
use lexisplat_compress::{Error, Result};
use lexisplat_eval::Comparison;
use lexisplat_render::Image;
use maud::html;

use crate::numbers;
use crate::page::document;

const SCRIPT: &str = include_str!("page.js");
/// JPEG quality of the pictures in the page, 1 to 100. At this quality six views of the demo, 960 x 640 pixels and three
/// pictures each, take about 2 MB.
const JPEG_QUALITY: u8 = 85;

/// The contents of the page.
#[derive(Debug, Clone, Copy)]
pub struct Report<'a> {
    /// Name of the scene.
    pub title: &'a str,
    /// Command line that makes the same files and the same page again.
    pub command: &'a str,
    /// Bytes of the PLY.
    pub ply_bytes: u64,
    /// The packed file.
    pub packed: CompressedFile<'a>,
    /// The file in an exact layout.
    pub exact: CompressedFile<'a>,
    /// The scene of the exact file.
    pub model: &'a Model,
    /// Seconds spent on learning the dictionary of the exact file.
    pub learn_seconds: f64,
    /// Seconds spent on coding the exact file.
    pub code_seconds: f64,
    /// Pictures of the packed file. They may be fewer than the views compared.
    pub pictures: &'a [Picture],
}

/// One compressed file of the scene.
#[derive(Debug, Clone, Copy)]
pub struct CompressedFile<'a> {
    /// Name of the file.
    pub name: &'a str,
    /// Bytes of the file.
    pub bytes: u64,
    /// Bytes of each part of the file by name, header included. Streams of a packed file share bytes, so the numbers may
    /// be fractions.
    pub attributes: &'a [(String, f64)],
    /// Scores of the file's scene against the original.
    pub comparison: &'a Comparison,
}

/// One view of the original and of the packed scene, as JPEG files of the same size (see [`jpeg`]).
#[derive(Debug, Clone)]
pub struct Picture {
    /// Name of the view, as in [`CompressedFile::comparison`].
    pub name: String,
    /// Picture of the original scene.
    pub original: Vec<u8>,
    /// Picture of the packed scene.
    pub compressed: Vec<u8>,
    /// Difference of both pictures, times [`AMPLIFICATION`](lexisplat_eval::montage::AMPLIFICATION).
    pub difference: Vec<u8>,
}

/// Returns `image` as the bytes of a JPEG file of the page's quality.
///
/// # Errors
/// [`Error::Parameter`] if the image is empty or too large for the format.
pub fn jpeg(image: &Image) -> Result<Vec<u8>> {
    let (mut bytes, pixels) = (Vec::new(), image.to_8bit());
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
        .encode(pixels.as_flattened(), image.width, image.height, ExtendedColorType::Rgb8)
        .map_err(|error| {
            Error::parameter("picture", format!("{} x {}", image.width, image.height), error.to_string())
        })?;
    Ok(bytes)
}

/// Returns the page as UTF-8 text. The same input gives the same page.
#[must_use]
pub fn page(report: &Report<'_>) -> String {
    let exact = exact::Facts::new(report);
    let body = html! {
        (packed::header(report))
        main {
            (packed::pictures(report))
            (packed::steps())
            (packed::sizes(report))
            (exact.summary())
            @if report.model.degree().rest() > 0 {
                (exact.steps())
                (exact.bound())
                (exact.nonzeros())
                (exact.dictionary())
            }
            (packed::views(report))
        }
        (exact.footer())
    };
    document(report.title, "", &body, SCRIPT)
}

/// Returns bytes of `before` over bytes of `after`, such as `24.50×`.
fn smaller(before: u64, after: u64) -> String {
    numbers::ratio(before as f64, after as f64)
}

#[cfg(test)]
pub(crate) mod testing {
    /// Checks that every opened element is closed in order. This parser is sufficient for the elements of the page.
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
        let attributes = [("position", 48.0), ("codes.values", 6.0), ("header", 900.0)];
        let attributes = attributes.map(|(name, bytes)| (name.to_owned(), bytes));
        let [original, compressed, difference] = ["one", "two", "three"].map(Vec::from);
        let picture = Picture { name: name.to_owned(), original, compressed, difference };
        let exact = CompressedFile { name: "exact.lexi", bytes: 954, attributes: &attributes, comparison };
        super::page(&Report {
            title: "a <b>scene</b> & more",
            command: "lexisplat demo --tol '0.1'",
            ply_bytes: 4000,
            packed: CompressedFile {
                name: "packed.lexi",
                bytes: 160,
                attributes: &attributes[..1],
                comparison,
            },
            exact,
            model,
            learn_seconds: 0.5,
            code_seconds: f64::NAN,
            pictures: &[picture],
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
        assert!(page.contains("data:image/jpeg;base64,b25l"), "the picture's bytes");
        assert!(!page.contains("NaN") && !page.contains("inf"), "numbers only");
    }

    #[test]
    fn the_packed_file_leads() {
        let scores = Comparison::of(vec![view("front", Some(45.25))]);
        let page = page(&model(ShDegree::THREE), &scores, "front");
        let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}"));
        assert!(at("25.00\u{d7}") < at("4.19\u{d7}"), "the packed file's ratio comes first");
        assert!(page[..at("<main>")].contains("160 B"), "the title is about the packed file");
        assert!(at("packed.lexi") < at("exact.lexi") && at("data:image") < at("exact.lexi"));
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
    fn a_bound_that_was_not_asked_for_is_not_called_kept() {
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
