//! A drawing by `kuva` as a PDF of one page, for papers.
//!
//! Only what `kuva` draws charts with is here: shapes, lines, and text in Helvetica, which every PDF reader has. Letters
//! beyond Windows code page 1252 become question marks.

use std::fmt::Write as _;

use kuva::render::color::Color;
use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};

/// Advance widths of Helvetica from the space to the tilde, in thousandths of the size of the text (Adobe, Core 14 AFM).
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556,
    556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278,
    500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469,
    556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500,
    278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];
/// Width of all other letters, that of a digit.
const OTHER_WIDTH: u16 = 556;
/// Bold letters are about so many times wider.
const BOLD: f64 = 1.06;
/// Distance of the control points of a quarter of a circle from its ends, in radii.
const QUARTER: f64 = 0.5523;

/// `scene` as a PDF file, one point for each pixel. The same scene gives the same bytes.
pub(super) fn pdf(scene: &Scene) -> Vec<u8> {
    let mut page = Page { ink: rgb(scene.text_color.as_deref()), ..Page::default() };
    let (width, height) = (scene.width, scene.height);
    // Pixels count from the top, points from the bottom.
    page.line(format_args!("1 0 0 -1 0 {} cm", number(height)));
    if let Some(paper) = scene.background_color.as_deref().filter(|paper| *paper != "none") {
        page.fill(rgb(Some(paper)));
        page.line(format_args!("0 0 {} {} re f", number(width), number(height)));
    }
    scene.elements.iter().for_each(|element| page.element(element));
    let states: String = page
        .opacities
        .iter()
        .enumerate()
        .map(|(i, opacity)| format!("/G{i} << /ca {0} /CA {0} >> ", number(*opacity)))
        .collect();
    let font = |name: &str| {
        format!("<< /Type /Font /Subtype /Type1 /BaseFont /{name} /Encoding /WinAnsiEncoding >>")
    };
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {} {}] /Contents 4 0 R /Resources << /Font << /F0 5 0 R /F1 6 0 \
             R >> /ExtGState << {states}>> >> >>",
            number(width),
            number(height)
        ),
        format!("<< /Length {} >>\nstream\n{}endstream", page.content.len(), page.content),
        font("Helvetica"),
        font("Helvetica-Bold"),
    ];
    let mut file = "%PDF-1.4\n".to_owned();
    let mut table = "0000000000 65535 f \n".to_owned();
    for (i, object) in objects.iter().enumerate() {
        let _ = writeln!(table, "{:010} 00000 n ", file.len());
        let _ = write!(file, "{} 0 obj\n{object}\nendobj\n", i + 1);
    }
    let (start, count) = (file.len(), objects.len() + 1);
    let _ = write!(
        file,
        "xref\n0 {count}\n{table}trailer\n<< /Size {count} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n"
    );
    file.into_bytes()
}

/// The content of a page, in ASCII.
#[derive(Default)]
struct Page {
    content: String,
    /// Opacities that were used; each is a graphics state of its number.
    opacities: Vec<f64>,
    /// Colour of text that has none of its own.
    ink: [f64; 3],
}

impl Page {
    fn line(&mut self, line: std::fmt::Arguments<'_>) {
        let _ = writeln!(self.content, "{line}");
    }

    fn fill(&mut self, [r, g, b]: [f64; 3]) {
        self.line(format_args!("{} {} {} rg", number(r), number(g), number(b)));
    }

    /// Sets colours, the width and dashes of lines, and opacity. The operator that then paints; `None` if nothing does.
    fn paint(
        &mut self,
        fill: Option<&Color>,
        stroke: Option<(&Color, f64, Option<&str>)>,
        opacity: Option<f64>,
    ) -> Option<&'static str> {
        let opacity = opacity.unwrap_or(1.0);
        let known = self.opacities.iter().position(|other| other.to_bits() == opacity.to_bits());
        let state = known.unwrap_or_else(|| {
            self.opacities.push(opacity);
            self.opacities.len() - 1
        });
        self.line(format_args!("/G{state} gs"));
        let fill = fill.and_then(colour);
        let stroke = stroke.filter(|(_, width, _)| *width > 0.0);
        let stroke = stroke.and_then(|(of, width, dash)| Some((colour(of)?, width, dash)));
        if let Some(fill) = fill {
            self.fill(fill);
        }
        if let Some(([r, g, b], width, dash)) = stroke {
            let dash: Vec<String> = dash
                .unwrap_or_default()
                .split([' ', ','])
                .filter_map(|part| part.parse().ok().map(number))
                .collect();
            self.line(format_args!(
                "{} {} {} RG {} w [{}] 0 d",
                number(r),
                number(g),
                number(b),
                number(width),
                dash.join(" ")
            ));
        }
        match (fill, stroke) {
            (Some(_), Some(_)) => Some("B"),
            (Some(_), None) => Some("f"),
            (None, Some(_)) => Some("S"),
            (None, None) => None,
        }
    }

    fn element(&mut self, element: &Primitive) {
        match element {
            Primitive::Circle { cx, cy, r, fill, fill_opacity, stroke, stroke_width } => {
                let stroke = stroke.as_ref().map(|of| (of, stroke_width.unwrap_or(1.0), None));
                self.circles(&[*cx], &[*cy], *r, fill, stroke, *fill_opacity);
            }
            Primitive::CircleBatch { cx, cy, r, fill, fill_opacity, stroke, stroke_width } => {
                let stroke = stroke.as_ref().map(|of| (of, stroke_width.unwrap_or(1.0), None));
                self.circles(cx, cy, *r, fill, stroke, *fill_opacity);
            }
            Primitive::Text { x, y, content, size, anchor, rotate, bold, color } => {
                self.text([*x, *y], content, (*size, *bold), *anchor, rotate.unwrap_or(0.0), color.as_ref());
            }
            Primitive::RichText { x, y, spans, size, anchor, color } => {
                let text: String = spans.iter().map(|span| span.text.as_str()).collect();
                self.text([*x, *y], &text, (*size, false), *anchor, 0.0, color.as_ref());
            }
            Primitive::Line { x1, y1, x2, y2, stroke, stroke_width, stroke_dasharray } => {
                let stroke = (stroke, *stroke_width, stroke_dasharray.as_deref());
                self.lines(&[(*x1, *y1), (*x2, *y2)], stroke);
            }
            Primitive::PolyLine { points, stroke, stroke_width, stroke_dasharray } => {
                self.lines(points, (stroke, *stroke_width, stroke_dasharray.as_deref()));
            }
            Primitive::Path(path) => self.path(path),
            Primitive::Rect { x, y, width, height, fill, stroke, stroke_width, opacity } => {
                let stroke = stroke.as_ref().map(|of| (of, stroke_width.unwrap_or(1.0), None));
                let paint = self.paint(Some(fill), stroke, *opacity);
                self.rectangle([*x, *y, *width, *height], paint);
            }
            Primitive::RectBatch { x, y, w, h, fills } => {
                for (i, fill) in fills.iter().enumerate() {
                    let paint = self.paint(Some(fill), None, None);
                    if let (Some(x), Some(y), Some(w), Some(h)) = (x.get(i), y.get(i), w.get(i), h.get(i)) {
                        self.rectangle([*x, *y, *w, *h], paint);
                    }
                }
            }
            Primitive::GroupStart { .. } => self.line(format_args!("q")),
            Primitive::ClipStart { x, y, width, height, .. } => {
                self.line(format_args!("q"));
                self.rectangle([*x, *y, *width, *height], Some("W n"));
            }
            Primitive::GroupEnd | Primitive::ClipEnd => self.line(format_args!("Q")),
        }
    }

    fn rectangle(&mut self, at: [f64; 4], paint: Option<&str>) {
        let [x, y, width, height] = at.map(number);
        if let Some(paint) = paint {
            self.line(format_args!("{x} {y} {width} {height} re {paint}"));
        }
    }

    fn circles(
        &mut self,
        x: &[f64],
        y: &[f64],
        r: f64,
        fill: &Color,
        stroke: Option<(&Color, f64, Option<&str>)>,
        opacity: Option<f64>,
    ) {
        let Some(paint) = self.paint(Some(fill), stroke, opacity) else { return };
        let k = QUARTER * r;
        for (x, y) in x.iter().zip(y) {
            let at = |dx: f64, dy: f64| format!("{} {}", number(x + dx), number(y + dy));
            let quarter = |a: [f64; 2], b: [f64; 2], end: [f64; 2]| {
                format!("{} {} {} c", at(a[0], a[1]), at(b[0], b[1]), at(end[0], end[1]))
            };
            self.line(format_args!(
                "{} m {} {} {} {} {paint}",
                at(r, 0.0),
                quarter([r, k], [k, r], [0.0, r]),
                quarter([-k, r], [-r, k], [-r, 0.0]),
                quarter([-r, -k], [-k, -r], [0.0, -r]),
                quarter([k, -r], [r, -k], [r, 0.0])
            ));
        }
    }

    fn lines(&mut self, points: &[(f64, f64)], stroke: (&Color, f64, Option<&str>)) {
        let Some(paint) = self.paint(None, Some(stroke), None) else { return };
        for (i, (x, y)) in points.iter().enumerate() {
            let operator = if i == 0 { "m" } else { "l" };
            self.line(format_args!("{} {} {operator}", number(*x), number(*y)));
        }
        self.line(format_args!("{paint}"));
    }

    /// A path of straight lines, which is all that charts have.
    fn path(&mut self, path: &PathData) {
        let stroke = (&path.stroke, path.stroke_width, path.stroke_dasharray.as_deref());
        let Some(paint) = self.paint(path.fill.as_ref(), Some(stroke), path.opacity) else { return };
        let spaced = path.d.replace('M', " M ").replace('L', " L ").replace('Z', " Z ").replace(',', " ");
        let mut operator = "m";
        let mut x = None;
        for word in spaced.split_whitespace() {
            match (word, word.parse::<f64>(), x) {
                ("M", ..) => operator = "m",
                ("L", ..) => operator = "l",
                ("Z", ..) => self.line(format_args!("h")),
                (_, Ok(value), None) => x = Some(value),
                (_, Ok(y), Some(left)) => {
                    self.line(format_args!("{} {} {operator}", number(left), number(y)));
                    (x, operator) = (None, "l");
                }
                _ => {}
            }
        }
        self.line(format_args!("{paint}"));
    }

    /// Text whose base line goes through `at`, turned clockwise by so many degrees.
    fn text(
        &mut self,
        at: [f64; 2],
        text: &str,
        (size, bold): (u32, bool),
        anchor: TextAnchor,
        degrees: f64,
        colour_of: Option<&Color>,
    ) {
        let ink = colour_of.and_then(colour).unwrap_or(self.ink);
        let _ = self.paint(None, None, None);
        self.fill(ink);
        let size = f64::from(size);
        let share = match anchor {
            TextAnchor::Start => 0.0,
            TextAnchor::Middle => 0.5,
            TextAnchor::End => 1.0,
        };
        let back = share * width(text, size, bold);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let place = [cos, sin, sin, -cos, at[0] - back * cos, at[1] - back * sin].map(number).join(" ");
        let font = u8::from(bold);
        self.line(format_args!("BT /F{font} {} Tf {place} Tm ({}) Tj ET", number(size), literal(text)));
    }
}

/// Width of `text` in points.
fn width(text: &str, size: f64, bold: bool) -> f64 {
    let each = |byte: u8| byte.checked_sub(b' ').and_then(|i| WIDTHS.get(usize::from(i))).copied();
    let all: u32 = text.chars().map(|c| u32::from(each(code(c)).unwrap_or(OTHER_WIDTH))).sum();
    f64::from(all) / 1000.0 * size * if bold { BOLD } else { 1.0 }
}

/// The byte of a letter in Windows code page 1252.
fn code(letter: char) -> u8 {
    match letter {
        ' '..='~' | '\u{a1}'..='\u{ff}' => u8::try_from(letter).unwrap_or(b'?'),
        '\u{a0}' => b' ',
        '\u{2026}' => 0x85,
        '\u{2018}' => 0x91,
        '\u{2019}' => 0x92,
        '\u{201c}' => 0x93,
        '\u{201d}' => 0x94,
        '\u{2013}' | '\u{2212}' => 0x96,
        '\u{2014}' => 0x97,
        _ => b'?',
    }
}

/// `text` within the parentheses of a PDF.
fn literal(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for byte in text.chars().map(code) {
        let _ = match byte {
            b'(' | b')' | b'\\' => write!(out, "\\{}", char::from(byte)),
            b' '..=b'~' => write!(out, "{}", char::from(byte)),
            _ => write!(out, "\\{byte:03o}"),
        };
    }
    out
}

/// Red, green and blue from 0 to 1; `None` for no colour.
fn colour(of: &Color) -> Option<[f64; 3]> {
    match of {
        Color::Rgb(r, g, b) => Some([*r, *g, *b].map(|v| f64::from(v) / 255.0)),
        Color::None => None,
        // Charts have no colours that `kuva` does not resolve.
        Color::Css(_) => Some([0.0; 3]),
    }
}

fn rgb(name: Option<&str>) -> [f64; 3] {
    name.map(Color::from).and_then(|of| colour(&of)).unwrap_or_default()
}

/// A number with at most three digits after the point.
fn number(value: f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" || text.is_empty() { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_letters_are_those_of_a_pdf() {
        assert_eq!(
            ["0", "1.5", "-2", "0.333"],
            [0.0, 1.5, -2.0, 1.0 / 3.0].map(number).each_ref().map(String::as_str)
        );
        assert_eq!(number(-0.0001), "0");
        assert_eq!(literal("a(b)\\\u{d7}\u{2013}\u{6f22}"), "a\\(b\\)\\\\\\327\\226?");
        assert!((width("0.1", 10.0, false) - 13.9).abs() < 1e-9);
    }

    #[test]
    fn every_reader_finds_all_objects() {
        let mut scene = Scene::new(200.0, 100.0);
        let dashed = Some("6 5".to_owned());
        scene.add(Primitive::Line {
            x1: 1.0,
            y1: 2.0,
            x2: 3.0,
            y2: 4.5,
            stroke: "#ff0000".into(),
            stroke_width: 2.0,
            stroke_dasharray: dashed,
        });
        scene.add(Primitive::Path(Box::new(PathData {
            d: "M1.0,2.0 L3.0 4.0 L 5 6Z".to_owned(),
            fill: Some("#0000ff".into()),
            stroke: Color::None,
            stroke_width: 0.0,
            opacity: Some(0.5),
            stroke_dasharray: None,
        })));
        scene.add(Primitive::Text {
            x: 100.0,
            y: 50.0,
            content: "00".to_owned(),
            size: 10,
            anchor: TextAnchor::Middle,
            rotate: Some(-90.0),
            bold: false,
            color: None,
        });
        let file = pdf(&scene);
        let text = String::from_utf8(file).unwrap();
        assert!(text.contains("1 0 0 RG 2 w [6 5] 0 d\n1 2 m\n3 4.5 l\nS\n"), "{text}");
        assert!(text.contains("0 0 1 rg\n1 2 m\n3 4 l\n5 6 l\nh\nf\n"), "{text}");
        // Half of 11.12 points back, that is down.
        assert!(text.contains("BT /F0 10 Tf 0 -1 -1 0 100 55.56 Tm (00) Tj ET"), "{text}");
        assert!(text.contains("/G0 << /ca 1 /CA 1 >> /G1 << /ca 0.5 /CA 0.5 >>"), "{text}");
        let (_, rest) = text.split_once("startxref\n").unwrap();
        let start: usize = rest.lines().next().unwrap().parse().unwrap();
        let entries: Vec<&str> =
            text[start..].lines().skip(3).take_while(|line| line.ends_with(" n ")).collect();
        assert_eq!(entries.len(), 6);
        for (i, entry) in entries.iter().enumerate() {
            let at: usize = entry[..10].parse().unwrap();
            assert!(text[at..].starts_with(&format!("{} 0 obj\n", i + 1)), "{entry}");
        }
        let (_, stream) = text.split_once("stream\n").unwrap();
        let (stream, _) = stream.split_once("endstream").unwrap();
        assert!(text.contains(&format!("/Length {} ", stream.len())));
    }
}
