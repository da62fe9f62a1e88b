//! The text at the start of a PLY. The parser is strict about sizes and tolerant about dialects.

use serde::Serialize;

use super::names::shown;
use crate::formats::kind::FileKind;
use crate::scene::extra::ScalarType;
use crate::support::error::{Error, Result};
use crate::support::limits::Limits;

/// Largest number of elements of a header. Real files have one to three.
const MAX_ELEMENTS: u64 = 1024;

/// Names of floats of 16 bits, which some programs write although no PLY has them.
const HALF: [&str; 4] = ["half", "float16", "f2", "halffloat"];

/// The encoding of the values after the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Decimal text, one row for each line.
    Ascii,
    /// Packed rows, least significant byte first.
    BinaryLittleEndian,
    /// Packed rows, most significant byte first.
    BinaryBigEndian,
}

/// A property's shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One value.
    Scalar(ScalarType),
    /// A count, then that many items.
    List {
        /// Type of the count.
        count: ScalarType,
        /// Type of an item.
        item: ScalarType,
    },
}

impl Kind {
    /// Returns the type of a single value.
    #[must_use]
    pub fn scalar(self) -> Option<ScalarType> {
        match self {
            Self::Scalar(ty) => Some(ty),
            Self::List { .. } => None,
        }
    }
}

/// A named column of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    /// The name.
    pub name: String,
    /// The shape.
    pub kind: Kind,
}

/// An element: rows of properties.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    /// The name.
    pub name: String,
    /// Number of rows.
    pub count: u64,
    /// The columns in file order.
    pub properties: Vec<Property>,
}

impl Element {
    /// Returns the bytes of one binary row; `None` if rows differ in length because of a list.
    #[must_use]
    pub fn row_bytes(&self) -> Option<usize> {
        self.properties.iter().map(|p| p.kind.scalar().map(ScalarType::bytes)).sum()
    }
}

/// The header of any PLY.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Header {
    /// The encoding of the values.
    pub format: Format,
    /// Comment texts in order, without the keyword and outer spaces.
    pub comments: Vec<String>,
    /// The elements in file order.
    pub elements: Vec<Element>,
    /// Number of bytes of the header. The data start after it.
    pub bytes: usize,
}

impl Header {
    /// Parses the header at the start of `bytes`, the bytes of the file called `file`. It is for readers of further formats.
    ///
    /// # Errors
    /// [`Error::Format`] for bytes that are no PLY header, [`Error::Limit`] for a header that is over the limits.
    pub fn parse(file: &str, bytes: &[u8], limits: &Limits) -> Result<Self> {
        FileKind::Ply.expect(file, bytes)?;
        let mut lines = Lines::new(file, bytes, *limits);
        let (mut format, mut comments, mut elements) = (None, Vec::new(), Vec::<Element>::new());
        loop {
            let Some(line) = lines.next()? else {
                return Err(Error::malformed(
                    file,
                    "the header has no 'end_header' line: the file is cut off",
                ));
            };
            let line = String::from_utf8_lossy(line);
            let number = lines.number;
            let bad = |why: &str| {
                Error::malformed(file, format!("header line {number}, '{}': {why}", shown(line.trim())))
            };
            let mut words = line.split_whitespace();
            match words.next() {
                None | Some("obj_info") => {}
                Some("ply") if number == 1 => {}
                Some("end_header") => break,
                Some(keyword @ "comment") => {
                    comments.push(line.trim()[keyword.len()..].trim().to_owned());
                }
                Some("format") => {
                    if format.replace(parse_format(words).map_err(bad)?).is_some() {
                        return Err(bad("a second format line"));
                    }
                }
                Some("element") => {
                    let what = format!("elements in the header of {file}");
                    Limits::check(&what, elements.len() as u64 + 1, MAX_ELEMENTS)?;
                    elements.push(parse_element(words).map_err(bad)?);
                }
                Some("property") => {
                    let Some(element) = elements.last_mut() else {
                        return Err(bad("a property before any element"));
                    };
                    let found = element.properties.len() as u64 + 1;
                    limits.check_properties(file, found)?;
                    element.properties.push(parse_property(words).map_err(bad)?);
                }
                Some(_) => return Err(bad("not a PLY keyword")),
            }
        }
        let Some(format) = format else {
            return Err(Error::malformed(file, "the header has no 'format' line"));
        };
        Ok(Self { format, comments, elements, bytes: lines.at })
    }
}

/// The content of a line, or its fault.
type Parsed<T> = Result<T, &'static str>;

fn parse_format<'a>(mut words: impl Iterator<Item = &'a str>) -> Parsed<Format> {
    let format = match words.next() {
        Some("ascii") => Format::Ascii,
        Some("binary_little_endian") => Format::BinaryLittleEndian,
        Some("binary_big_endian") => Format::BinaryBigEndian,
        _ => return Err("expected ascii, binary_little_endian or binary_big_endian"),
    };
    match words.next() {
        Some("1.0") => Ok(format),
        _ => Err("expected PLY version 1.0"),
    }
}

fn parse_element<'a>(mut words: impl Iterator<Item = &'a str>) -> Parsed<Element> {
    match (words.next(), words.next().map(str::parse), words.next()) {
        (Some(name), Some(Ok(count)), None) => {
            Ok(Element { name: name.to_owned(), count, properties: Vec::new() })
        }
        _ => Err("expected a name and a count from 0"),
    }
}

fn parse_property<'a>(mut words: impl Iterator<Item = &'a str>) -> Parsed<Property> {
    let ty = |word: Option<&str>| {
        let why = match word {
            Some(word) if HALF.contains(&word) => {
                "floats of 16 bits are no type of a PLY; write them as float"
            }
            _ => "unknown type",
        };
        word.and_then(ScalarType::parse).ok_or(why)
    };
    let kind = match words.next() {
        Some("list") => {
            let (count, item) = (ty(words.next())?, ty(words.next())?);
            if matches!(count, ScalarType::F32 | ScalarType::F64) {
                return Err("a list's count must be an integer type");
            }
            Kind::List { count, item }
        }
        word => Kind::Scalar(ty(word)?),
    };
    match (words.next(), words.next()) {
        // A PLY cannot hold such a name, so no writer could write it back.
        (Some(name), None) if name.chars().any(char::is_control) => Err("control characters in the name"),
        (Some(name), None) => Ok(Property { name: name.to_owned(), kind }),
        _ => Err("expected one name after the type"),
    }
}

/// The lines of a header, which end in `\n` or `\r\n`. If the first line ends in `\r` alone, all lines do.
struct Lines<'a> {
    file: &'a str,
    bytes: &'a [u8],
    limits: Limits,
    /// Start of the next line.
    at: usize,
    /// Number of lines that were returned.
    number: usize,
    end: u8,
}

impl<'a> Lines<'a> {
    fn new(file: &'a str, bytes: &'a [u8], limits: Limits) -> Self {
        let mac = bytes
            .windows(2)
            .find(|w| matches!(w[0], b'\n' | b'\r'))
            .is_some_and(|w| w[0] == b'\r' && w[1] != b'\n');
        Self { file, bytes, limits, at: 0, number: 0, end: if mac { b'\r' } else { b'\n' } }
    }

    /// Returns the next line without its end, or `None` at the end of the bytes.
    fn next(&mut self) -> Result<Option<&'a [u8]>> {
        let rest = &self.bytes[self.at..];
        let budget =
            usize::try_from(self.limits.header_bytes.saturating_sub(self.at as u64)).unwrap_or(usize::MAX);
        let window = &rest[..rest.len().min(budget)];
        let line = match window.iter().position(|&b| b == self.end) {
            Some(length) => {
                self.at += length + 1;
                &window[..length]
            }
            None if window.len() < rest.len() => {
                self.limits.check_header(self.file, self.limits.header_bytes.saturating_add(1))?;
                return Ok(None);
            }
            None if rest.is_empty() => return Ok(None),
            None => {
                self.at = self.bytes.len();
                rest
            }
        };
        self.number += 1;
        Ok(Some(line))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Header> {
        Header::parse("t.ply", text.as_bytes(), &Limits::default())
    }

    fn message(text: &str) -> String {
        parse(text).expect_err("must be refused").to_string()
    }

    const PLAIN: &str = "ply\nformat binary_little_endian 1.0\ncomment Made by hand\nobj_info x 1\n\
         element vertex 3\nproperty float x\nproperty uint8 red\nelement face 2\n\
         property list uchar int vertex_indices\nend_header\n";

    #[test]
    fn floats_of_16_bits_are_named() {
        for ty in HALF {
            let said = message(&format!(
                "ply\nformat ascii 1.0\nelement vertex 1\nproperty {ty} f_rest_0\nend_header\n"
            ));
            assert!(said.contains(&format!("'property {ty} f_rest_0': floats of 16 bits")), "{said}");
        }
    }

    #[test]
    fn a_plain_header() {
        let header = parse(PLAIN).unwrap();
        assert_eq!(header.format, Format::BinaryLittleEndian);
        assert_eq!(header.comments, ["Made by hand"]);
        assert_eq!(header.bytes, PLAIN.len());
        assert_eq!(header.elements.len(), 2);
        assert_eq!((header.elements[0].count, header.elements[0].row_bytes()), (3, Some(5)));
        assert_eq!(header.elements[1].row_bytes(), None);
    }

    #[test]
    fn line_ends_and_white_space_do_not_matter() {
        let plain = parse(PLAIN).unwrap();
        for odd in [
            PLAIN.replace('\n', "\r\n"),
            PLAIN.replace('\n', "\r"),
            PLAIN.replace(' ', " \t "),
            PLAIN.replace('\n', " \n"),
            PLAIN.replace("\nproperty", "\n  property"),
        ] {
            let mut header = parse(&format!("{odd}\x00\x01")).unwrap();
            assert_eq!(header.bytes, odd.len(), "{odd:?}");
            header.bytes = plain.bytes;
            header.comments = vec![header.comments[0].split_whitespace().collect::<Vec<_>>().join(" ")];
            assert_eq!(header, plain, "{odd:?}");
        }
    }

    #[test]
    fn pickles_are_never_read() {
        let error = Header::parse("a.pkl", &[0x80, 4, 0x95, 0], &Limits::default()).unwrap_err().to_string();
        assert!(error.contains("a.pkl") && error.contains("pickle") && error.contains("save_ply"), "{error}");
    }

    #[test]
    fn bad_headers_are_named() {
        let cases = [
            ("", "the file is empty"),
            ("plx\n", "not a PLY file"),
            ("NGSP", "SPZ, version 4"),
            ("ply\nformat ascii 1.0\n", "no 'end_header'"),
            ("ply\nend_header\n", "no 'format'"),
            ("ply\nformat ascii 2.0\nend_header\n", "version 1.0"),
            ("ply\nformat zebra 1.0\nend_header\n", "expected ascii"),
            ("ply\nformat ascii 1.0\nformat ascii 1.0\nend_header\n", "second format"),
            ("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "before any element"),
            ("ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "header line 3, 'element vertex -1'"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\nend_header\n", "floats of 16 bits"),
            ("ply\nformat ascii 1.0\nelement v 1\nproperty list float int x\nend_header\n", "integer type"),
            ("ply\nformat ascii 1.0\nelement v 1\nproperty float\nend_header\n", "one name"),
            (
                "ply\nformat ascii 1.0\nelement v 1\nproperty uchar la\x05bel\nend_header\n",
                "'property uchar la\\u{5}bel': control characters",
            ),
            ("ply\nformat ascii 1.0\nzebra\nend_header\n", "not a PLY keyword"),
            ("ply\nformat ascii 1.0\n\x1b[31m\nend_header\n", "'\\u{1b}[31m'"),
        ];
        for (text, part) in cases {
            let said = message(text);
            assert!(said.starts_with("t.ply: ") && said.contains(part), "{text:?}: {said}");
            assert!(!said.contains('\n') && !said.contains('\x1b'), "{said:?}");
        }
        let gzip = Header::parse("a.spz", &[0x1f, 0x8b, 8], &Limits::default()).unwrap_err().to_string();
        assert!(gzip.contains("SPZ") && gzip.contains("lexisplat convert"), "{gzip}");
    }

    #[test]
    fn limits_hold() {
        let limits = Limits { header_bytes: 64, properties: 2, ..Limits::default() };
        let long = format!("ply\ncomment {}\nformat ascii 1.0\nend_header\n", "x".repeat(80));
        let said = Header::parse("t.ply", long.as_bytes(), &limits).unwrap_err();
        assert!(matches!(said, Error::Limit { limit: 64, .. }), "{said}");
        let wide = "ply\nformat ascii 1.0\nelement v 1\nproperty char a\nproperty char b\nproperty char c\n";
        let limits = Limits { header_bytes: 1000, ..limits };
        let said = Header::parse("t.ply", wide.as_bytes(), &limits).unwrap_err();
        assert!(matches!(said, Error::Limit { found: 3, limit: 2, .. }), "{said}");
        let many = format!("ply\nformat ascii 1.0\n{}end_header\n", "element e 0\n".repeat(1025));
        assert!(matches!(parse(&many), Err(Error::Limit { found: 1025, .. })));
    }
}
