//! Writes a drawing as a PDF of one page, for papers.
//!
//! Text is in Helvetica, which every PDF reader has. Letters that Windows code page 1252 lacks become question marks.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::drawing::{Anchor, Figure, SIZE, Shape, number};

/// Advance widths of Helvetica from the space to the tilde, in thousandths of the text size (Adobe, Core 14 AFM).
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556,
    556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278,
    500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469,
    556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500,
    278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];
/// Width of all other letters. It is the width of a digit.
const OTHER_WIDTH: u16 = 556;

impl Figure {
    /// Returns the figure as a PDF of one page.
    pub(crate) fn pdf(&self) -> Vec<u8> {
        pdf(&self.shapes)
    }
}

/// Returns `shapes` as a PDF file. A pixel becomes a point. The same shapes give the same bytes.
fn pdf(shapes: &[Shape]) -> Vec<u8> {
    let [width, height] = SIZE.map(number);
    // Pixels count from the top, and points from the bottom.
    let mut content = format!("1 0 0 -1 0 {height} cm 1 j\n");
    let mut opacities = BTreeSet::new();
    for shape in shapes {
        let opacity = if let Shape::Area { opacity, .. } = shape { *opacity } else { 100 };
        opacities.insert(opacity);
        let _ = writeln!(content, "/G{opacity} gs\n{}", operators(shape));
    }
    let states: String = opacities
        .iter()
        .map(|percent| format!("/G{percent} << /ca {} >> ", number(f64::from(*percent) / 100.0)))
        .collect();
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width} {height}] /Contents 4 0 R /Resources << /Font << /F0 5 0 R >> /ExtGState << {states}>> >> >>"
        ),
        format!("<< /Length {} >>\nstream\n{content}endstream", content.len()),
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>".to_owned(),
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

/// Returns the operators that draw `shape`, in ASCII.
fn operators(shape: &Shape) -> String {
    let path = |points: &[[f64; 2]]| {
        let word = |i| if i == 0 { "m" } else { "l" };
        let lines = points.iter().enumerate();
        lines.map(|(i, [x, y])| format!("{} {} {}\n", number(*x), number(*y), word(i))).collect::<String>()
    };
    match shape {
        Shape::Line { points, colour, width, dash } => {
            format!("{} RG {} w [{dash}] 0 d\n{}S", rgb(colour), number(*width), path(points))
        }
        Shape::Area { points, colour, .. } => format!("{} rg\n{}h f", rgb(colour), path(points)),
        Shape::Text { at: [x, y], text, size, anchor, upright, colour } => {
            let share = match anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => 0.5,
                Anchor::End => 1.0,
            };
            let back = share * width(text, *size);
            let place = if *upright {
                [0.0, -1.0, -1.0, 0.0, *x, y + back]
            } else {
                [1.0, 0.0, 0.0, -1.0, x - back, *y]
            };
            let place = place.map(number).join(" ");
            format!("{} rg BT /F0 {} Tf {place} Tm ({}) Tj ET", rgb(colour), number(*size), literal(text))
        }
    }
}

/// Returns the width of `text`, in points.
fn width(text: &str, size: f64) -> f64 {
    let each = |byte: u8| byte.checked_sub(b' ').and_then(|i| WIDTHS.get(usize::from(i))).copied();
    let all: u32 = text.chars().map(|c| u32::from(each(code(c)).unwrap_or(OTHER_WIDTH))).sum();
    f64::from(all) / 1000.0 * size
}

/// Returns the byte of a letter in Windows code page 1252.
fn code(letter: char) -> u8 {
    match letter {
        '\u{a0}' => b' ',
        ' '..='~' | '\u{a1}'..='\u{ff}' => u8::try_from(letter).unwrap_or(b'?'),
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

/// Returns `text` as the contents of the parentheses of a PDF string.
fn literal(text: &str) -> String {
    let byte = |byte| match byte {
        b'(' | b')' | b'\\' => format!("\\{}", char::from(byte)),
        b' '..=b'~' => char::from(byte).to_string(),
        _ => format!("\\{byte:03o}"),
    };
    text.chars().map(code).map(byte).collect()
}

/// Returns the red, green and blue of a colour such as `#0072b2`, each from 0 to 1, as text.
fn rgb(colour: &str) -> String {
    let part = |k: usize| colour.get(k..k + 2).and_then(|digits| u8::from_str_radix(digits, 16).ok());
    [1, 3, 5].map(|k| number(f64::from(part(k).unwrap_or(0)) / 255.0)).join(" ")
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
        assert_eq!(rgb("#ff0033"), "1 0 0.2");
        assert!((width("0.1", 10.0) - 13.9).abs() < 1e-9);
    }

    #[test]
    fn every_reader_finds_all_objects() {
        let shapes = vec![
            Shape::Line { points: vec![[1.0, 2.0], [3.0, 4.5]], colour: "#ff0000", width: 2.0, dash: "6 5" },
            Shape::Area { points: vec![[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], colour: "#0000ff", opacity: 50 },
            Shape::Text {
                at: [100.0, 50.0],
                text: "00".to_owned(),
                size: 10.0,
                anchor: Anchor::Middle,
                upright: true,
                colour: "#000000",
            },
        ];
        let file = pdf(&shapes);
        let text = String::from_utf8(file).unwrap();
        assert!(text.contains("1 0 0 RG 2 w [6 5] 0 d\n1 2 m\n3 4.5 l\nS\n"), "{text}");
        assert!(text.contains("0 0 1 rg\n1 2 m\n3 4 l\n5 6 l\nh f\n"), "{text}");
        // Half of 11.12 points back, that is down.
        assert!(text.contains("BT /F0 10 Tf 0 -1 -1 0 100 55.56 Tm (00) Tj ET"), "{text}");
        assert!(text.contains("/G50 << /ca 0.5 >> /G100 << /ca 1 >>"), "{text}");
        let (_, rest) = text.split_once("startxref\n").unwrap();
        let start: usize = rest.lines().next().unwrap().parse().unwrap();
        let entries: Vec<&str> =
            text[start..].lines().skip(3).take_while(|line| line.ends_with(" n ")).collect();
        assert_eq!(entries.len(), 5);
        for (i, entry) in entries.iter().enumerate() {
            let at: usize = entry[..10].parse().unwrap();
            assert!(text[at..].starts_with(&format!("{} 0 obj\n", i + 1)), "{entry}");
        }
        let (_, stream) = text.split_once("stream\n").unwrap();
        let (stream, _) = stream.split_once("endstream").unwrap();
        assert!(text.contains(&format!("/Length {} ", stream.len())));
    }
}
