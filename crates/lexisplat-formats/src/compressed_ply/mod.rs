//! `PlayCanvas`' compressed PLY. A Gaussian has 16 bytes, relative to the bounds of its chunk of 256 Gaussians, and a
//! byte for each SH coefficient (splat-transform, `write-compressed-ply.ts` and `decompress-ply.ts`).

mod code;
mod order;
mod write;

use std::ops::Range;

use lexisplat::ply::{self, Format, Header, Property, PropertyKind, ReadOptions, ScalarType};
use lexisplat::sh::{C0, COLOUR_OFFSET};
use lexisplat::{Error, FormatError, Limits, Result, ShDegree};
use serde_json::json;

use self::code::Bounds;
use crate::opacity::logits;
use crate::rows::{Described, Rows, RowsMut};

pub(crate) use self::write::write;

/// Number of Gaussians of a chunk.
const CHUNK: usize = 256;
/// Properties of a chunk, all of them floats. Files without the bounds of colours have the first 12.
const CHUNK_PROPERTIES: [&str; 18] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
    "min_r",
    "min_g",
    "min_b",
    "max_r",
    "max_g",
    "max_b",
];
/// Number of the properties that every file has.
const NEEDED: usize = 12;
/// Properties of a Gaussian, all of type `u32`.
const VERTEX_PROPERTIES: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
/// Number of bytes of a Gaussian's properties.
const ROW: usize = 16;
/// Size of the range of an SH coefficient, which is centred at 0.
const SH_RANGE: f32 = 8.0;
/// Number of values of the byte of an SH coefficient.
const SH_LEVELS: f32 = 256.0;

/// Returns whether the PLY in `bytes` has packed elements.
pub(crate) fn is_likely(bytes: &[u8]) -> bool {
    let is_packed = |header: Header| {
        header
            .elements
            .iter()
            .any(|e| e.name == "chunk" || e.properties.iter().any(|p| p.name == "packed_position"))
    };
    Header::parse("", bytes, &Limits::default()).is_ok_and(is_packed)
}

/// Largest bound with which every decoded value is finite. Base colours are divided by [`C0`].
const MOST_BOUND: f32 = f32::MAX / 8.0;

/// The rows of an element.
#[derive(Debug, Clone, Copy)]
struct Element<'h, 'a> {
    properties: &'h [Property],
    count: usize,
    bytes: &'a [u8],
}

/// Reads the compressed PLY in `bytes`, which messages call `name`.
///
/// # Errors
/// [`Error::Format`] for elements that are missing, of another type, or cut off.
pub(crate) fn read<'a>(name: &str, bytes: &'a [u8], options: &ReadOptions) -> Result<Described<'a>> {
    let header = Header::parse(name, bytes, &options.limits)?;
    let malformed = |text: String| Error::malformed(name, text);
    if header.format != Format::BinaryLittleEndian {
        return Err(malformed("a compressed PLY is binary and little-endian".to_owned()));
    }
    let [mut chunk, mut vertex, mut sh] = [None; 3];
    let mut at = header.bytes;
    for element in &header.elements {
        let size = element.row_bytes().and_then(|row| row.checked_mul(usize::try_from(element.count).ok()?));
        let rows = size.and_then(|size| bytes.get(at..)?.get(..size));
        let rows = rows.ok_or_else(|| {
            let what = format!("element '{}'", element.name.escape_debug());
            let expected = size.map_or(u64::MAX, |size| (at as u64).saturating_add(size as u64));
            Error::format(name, FormatError::Truncated { what, expected, found: bytes.len() as u64 })
        })?;
        at += rows.len();
        let count = usize::try_from(element.count).unwrap_or(usize::MAX);
        let found = Some(Element { properties: &element.properties, count, bytes: rows });
        match element.name.as_str() {
            "chunk" if chunk.is_none() => chunk = found,
            "vertex" if vertex.is_none() => vertex = found,
            "sh" if sh.is_none() => sh = found,
            other => return Err(malformed(format!("element '{}' is not expected", other.escape_debug()))),
        }
    }
    let missing = |what: &str| malformed(format!("element '{what}' of a compressed PLY is missing"));
    let vertex = vertex.ok_or_else(|| missing("vertex"))?;
    expect(name, "vertex", vertex, VERTEX_PROPERTIES.map(str::to_owned), ScalarType::U32)?;
    let chunk = chunk.ok_or_else(|| missing("chunk"))?;
    let has_colours = chunk.properties.len() > NEEDED;
    let names = &CHUNK_PROPERTIES[..if has_colours { CHUNK_PROPERTIES.len() } else { NEEDED }];
    expect(name, "chunk", chunk, names.iter().map(|&n| n.to_owned()), ScalarType::F32)?;
    if chunk.count != vertex.count.div_ceil(CHUNK) {
        let (chunks, count) = (chunk.count, vertex.count);
        return Err(malformed(format!("{chunks} chunks for {count} Gaussians, of {CHUNK} each")));
    }
    let rest = sh.map_or(0, |sh| sh.properties.len());
    let degree = ShDegree::from_rest(rest).ok_or_else(|| {
        malformed(format!("{rest} properties of element 'sh', and 9, 24, 45 or 72 make an SH degree"))
    })?;
    if let Some(sh) = sh {
        expect(name, "sh", sh, (0..rest).map(|k| format!("f_rest_{k}")), ScalarType::U8)?;
        if sh.count != vertex.count {
            return Err(malformed(format!("{} rows of SH for {} Gaussians", sh.count, vertex.count)));
        }
    }
    let floats = chunk.bytes.as_chunks().0.iter().map(|v| f32::from_le_bytes(*v)).collect::<Vec<_>>();
    let bounds: Vec<ChunkBounds> = floats.chunks_exact(names.len()).map(ChunkBounds::of).collect();
    Ok(Described {
        len: vertex.count,
        degree,
        meta: ply::meta_of(header.comments.clone()),
        warnings: Vec::new(),
        facts: vec![("chunks", json!(chunk.count)), ("colour_bounds", json!(has_colours))],
        rows: Box::new(CompressedRows {
            is_finite: floats.iter().all(|v| v.abs() <= MOST_BOUND),
            bounds,
            vertices: vertex.bytes.as_chunks().0,
            sh: sh.map_or(&[], |sh| sh.bytes),
            rest,
        }),
    })
}

/// Returns an error if an element does not have exactly these properties, in this order.
fn expect(
    name: &str,
    what: &str,
    element: Element<'_, '_>,
    names: impl IntoIterator<Item = String>,
    ty: ScalarType,
) -> Result<()> {
    let kind = PropertyKind::Scalar(ty);
    let expected: Vec<Property> = names.into_iter().map(|name| Property { name, kind }).collect();
    if element.properties == expected {
        return Ok(());
    }
    let differs = expected.iter().zip(element.properties).find(|(a, b)| a != b).map_or_else(
        || format!("has {} properties, and {} are expected", element.properties.len(), expected.len()),
        |(a, b)| format!("has '{}' where '{}' ({}) is expected", b.name.escape_debug(), a.name, ty.name()),
    );
    Err(Error::malformed(name, format!("element '{what}' {differs}")))
}

/// The bounds of a chunk.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ChunkBounds {
    positions: Bounds,
    scales: Bounds,
    /// Bounds of base colours, within 0 to 1 if the colours are between black and white.
    colours: Bounds,
}

impl ChunkBounds {
    /// Returns the bounds in a row of 12 or 18 values.
    fn of(row: &[f32]) -> Self {
        let three = |at: usize| row.get(at..).and_then(|rest| rest.first_chunk()).copied();
        let bounds = |at: usize| three(at).zip(three(at + 3)).map(|(low, high)| [low, high]);
        let plain = [[0.0; 3], [1.0; 3]];
        Self {
            positions: bounds(0).unwrap_or(plain),
            scales: bounds(6).unwrap_or(plain),
            colours: bounds(NEEDED).unwrap_or(plain),
        }
    }

    /// Returns the bounds as a row of 18 values.
    fn values(&self) -> impl Iterator<Item = f32> {
        [self.positions, self.scales, self.colours].into_iter().flatten().flatten()
    }
}

/// Returns SH coefficient 0 of a base colour.
fn dc(colour: f32) -> f32 {
    (colour - COLOUR_OFFSET) / C0
}

fn colour(dc: f32) -> f32 {
    dc * C0 + COLOUR_OFFSET
}

/// Returns the SH coefficient of a byte.
fn coefficient(byte: u8) -> f32 {
    let share = match byte {
        0 => 0.0,
        255 => 1.0,
        byte => (f32::from(byte) + 0.5) / SH_LEVELS,
    };
    (share - 0.5) * SH_RANGE
}

#[derive(Debug)]
struct CompressedRows<'a> {
    bounds: Vec<ChunkBounds>,
    vertices: &'a [[u8; ROW]],
    sh: &'a [u8],
    /// Number of SH-rest coefficients of a Gaussian, of all channels.
    rest: usize,
    is_finite: bool,
}

impl Rows for CompressedRows<'_> {
    fn fill(&self, range: Range<usize>, out: RowsMut<'_>) {
        let opacities = logits();
        let first = range.start;
        for (i, row) in self.vertices[range.clone()].iter().enumerate() {
            let bounds = &self.bounds[(first + i) / CHUNK];
            let word = |k: usize| u32::from_le_bytes([row[k], row[k + 1], row[k + 2], row[k + 3]]);
            out.positions[i] = code::three(word(0), &bounds.positions);
            out.rotations[i] = code::rotation(word(4));
            out.scales[i] = code::three(word(8), &bounds.scales);
            let [low, high] = &bounds.colours;
            let bytes = word(12).to_be_bytes();
            out.dc[i] = [0, 1, 2].map(|k| dc(code::of_code(bytes[k].into(), low[k], high[k], 8)));
            out.opacities[i] = opacities[usize::from(bytes[3])];
        }
        let table: [f32; 256] = std::array::from_fn(|k| coefficient(k.to_le_bytes()[0]));
        let bytes = &self.sh[range.start * self.rest..range.end * self.rest];
        out.sh_rest.iter_mut().zip(bytes).for_each(|(v, byte)| *v = table[usize::from(*byte)]);
    }

    fn is_finite(&self) -> bool {
        self.is_finite
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::{Silent, Splats};
    use lexisplat_sample::{SampleOptions, scene};
    use lexisplat_testing::{Need, missing, real_data};

    use super::*;
    use crate::kind::Kind;
    use crate::open::open;
    use crate::siblings::Siblings;

    /// A chunk's bounds may be finite, and the colours between them not.
    #[test]
    fn bounds_that_overflow_are_refused() {
        let (bytes, _) = write(&scene(&SampleOptions::new(3, 1)));
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        for (k, name) in [(3, "x"), (9, "scale_0"), (15, "f_dc_0")] {
            let mut bytes = bytes.clone();
            let mut value = |v: f32| bytes[end + 4 * k..][..4].copy_from_slice(&v.to_le_bytes());
            value(f32::INFINITY);
            let error = opened(&bytes).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
            bytes[end + 4 * k..][..4].copy_from_slice(&f32::MAX.to_le_bytes());
            assert_eq!(opened(&bytes).is_err(), name == "f_dc_0");
        }
    }

    fn opened(bytes: &[u8]) -> Result<Splats> {
        let opened = open("a.ply", bytes, Siblings::NONE, &ReadOptions::default(), true, &Silent)?;
        assert_eq!(opened.kind(), Kind::CompressedPly);
        Ok(opened.source().whole()?.into_owned())
    }

    fn written(splats: &Splats) -> Vec<u8> {
        write(splats).0
    }

    #[test]
    fn what_is_written_is_read_near_and_written_again_bit_for_bit() {
        for (count, degree) in [(0, 3), (1, 0), (255, 1), (257, 2), (3000, 3)] {
            let degree = ShDegree::new(degree).unwrap();
            let mut splats = scene(&SampleOptions::new(count.max(1), 2)).with_degree_cut(degree);
            if count == 0 {
                splats.retain(&[false]);
            }
            splats.meta.antialiased = count == 255;
            let bytes = written(&splats);
            let read = opened(&bytes).unwrap();
            assert_eq!((read.len(), read.degree), (count, degree));
            assert_eq!(read.meta.antialiased, splats.meta.antialiased);
            assert!(written(&read) == bytes, "{count}");
        }
    }

    /// Each Gaussian is near to one of the original, whose order may be another.
    #[test]
    fn values_are_near() {
        let splats = scene(&SampleOptions::new(2000, 4));
        let read = opened(&written(&splats)).unwrap();
        let order = order::order(&splats.geometry.positions);
        for (i, &from) in order.iter().enumerate() {
            let (a, b) = (&splats.geometry, &read.geometry);
            for k in 0..3 {
                // Half of a step of 10 bits within the whole sample, which is 24 units wide.
                assert!((a.positions[from][k] - b.positions[i][k]).abs() < 12.0 / 1023.0);
                assert!((a.dc[from][k] - b.dc[i][k]).abs() < 0.02);
                assert!((a.scales[from][k] - b.scales[i][k]).abs() < 0.02);
            }
            let near = splats.rest(from).iter().zip(read.rest(i)).all(|(a, b)| (a - b).abs() <= 1.0 / 32.0);
            assert!(near, "{i}");
        }
    }

    #[test]
    fn every_truncation_and_flipped_bit_is_read_or_refused() {
        let bytes = written(&scene(&SampleOptions::new(300, 2)).with_degree_cut(ShDegree::ONE));
        for end in 0..bytes.len() {
            let refused = read("a", &bytes[..end], &ReadOptions::default()).is_err();
            assert!(refused, "{end}");
        }
        for bit in 0..8 * bytes.len().min(2500) {
            let mut bad = bytes.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            if is_likely(&bad) {
                let _ = open("a", &bad, Siblings::NONE, &ReadOptions::default(), true, &Silent);
            }
        }
    }

    #[test]
    fn bounds_that_are_not_finite_are_refused_by_gaussian() {
        let mut bytes = written(&scene(&SampleOptions::new(300, 2)));
        let at = Header::parse("a", &bytes, &Limits::default()).unwrap().bytes;
        bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
        let error = opened(&bytes).unwrap_err();
        assert!(error.to_string().contains("256 Gaussians hold NaN"), "{error}");
    }

    #[test]
    fn a_real_model_is_written_again_bit_for_bit() {
        let Some(path) = real_data("leica-brush.ply") else {
            missing(Need::Models, "leica-brush.ply");
            return;
        };
        let splats = ply::read(&path, &ReadOptions::default()).unwrap().splats;
        let bytes = written(&splats);
        let read = opened(&bytes).unwrap();
        assert!(written(&read) == bytes);
    }
}
