//! Readers that take a file a part at a time, beside those that read it whole: they accept the same files and
//! give the same Gaussians, bit by bit.

use lexisplat::lexi::LexiReader;
use lexisplat::ply::{PlyRead, PlySource, ReadOptions};
use lexisplat::{CodedRest, Error, ExtraValues, Geometry, Model, Silent, SplatSource, Splats, ply, stream};

use crate::allocator::bounded;

/// Gaussians up to which a scene is written as a PLY too: more says nothing new and takes long.
const SMALL: usize = 4096;

/// Reads the PLY `data` in parts, whose sizes follow from `data`, and compares with `whole`, what reading it at
/// once gave.
///
/// # Panics
/// If they differ, or if reading in parts held more than `per_byte` bytes for each of `data`, and `base`.
pub fn ply(
    data: &[u8],
    options: &ReadOptions,
    whole: Result<&PlyRead, &Error>,
    [per_byte, base]: [usize; 2],
) {
    bounded(data, per_byte, base, || {
        let opened = PlySource::open("fuzz.ply", data, options, &Silent);
        let (chunks, read) = match (&opened, whole) {
            (Ok(chunks), Ok(read)) => (chunks, read),
            (Err(parts), Err(whole)) => return assert_eq!(parts.to_string(), whole.to_string()),
            (Ok(_), Err(error)) => panic!("refused when read whole only: {error}"),
            (Err(error), Ok(_)) => panic!("refused when read in parts only: {error}"),
        };
        let splats = &read.splats;
        assert_eq!(chunks.warnings(), read.warnings);
        assert_eq!(chunks.summary(), &read.summary);
        assert_eq!(chunks.meta(), &splats.meta);
        assert_eq!((chunks.len(), chunks.degree()), (splats.len(), splats.degree));
        assert_eq!(chunks.has_normals() && !chunks.is_empty(), !splats.geometry.normals.is_empty());
        source(data, chunks, splats);
    });
}

/// Reads `source`, the file `data`, in parts, whose sizes follow from `data`, and compares with `whole`.
///
/// # Panics
/// If they differ.
pub fn source(data: &[u8], source: &dyn SplatSource, whole: &Splats) {
    assert_eq!(source.len(), whole.len());
    let mut part = source.empty();
    assert_eq!((&part.meta, part.degree), (&whole.meta, whole.degree));
    let (mut start, mut sizes) = (0, sizes(data, whole.len()));
    while start < whole.len() {
        let end = whole.len().min(start + sizes.next().unwrap_or(1));
        source.read(start..end, &mut part).expect("all was looked at");
        assert_eq!(part.len(), end - start);
        part.validate().expect("arrays fit");
        (start..end).enumerate().for_each(|(k, j)| same_splat(&part, k, whole, j));
        start = end;
    }
}

/// Sizes of parts: some of 0 to 4 Gaussians, then some of a quarter or more.
fn sizes(data: &[u8], gaussians: usize) -> impl Iterator<Item = usize> {
    // A stride that is prime, so that files of any length give sizes of all kinds.
    let byte = move |k: usize| usize::from(data.get(k * 251 % data.len().max(1)).copied().unwrap_or(0));
    (1..).map(move |k| match byte(k) {
        small @ 0..=0xdf if k < 16 => small % 5,
        large => 1 + gaussians / (1 + large % 4),
    })
}

/// Reads the .lexi file `data` in parts of `at_once` Gaussians, where the layout has parts of any size, and
/// compares with `whole`, what reading it at once gave.
///
/// # Panics
/// If they differ, or if reading in parts held more than `per_byte` bytes for each of `data`, and `base`.
pub fn lexi(data: &[u8], at_once: usize, whole: Result<&Model, &Error>, [per_byte, base]: [usize; 2]) {
    let limits = crate::limits();
    let read = bounded(data, per_byte, base, || {
        let chunks = LexiReader::open("fuzz.lexi", data, &limits)?;
        let mut seen = 0;
        chunks.each_of(at_once, &mut |start, part| {
            assert_eq!(start, seen);
            seen += part.len();
            let Ok(whole) = whole else { return Ok(()) };
            assert!(part.len() == part.codes().len() && part.geometry().validate().is_ok(), "arrays differ");
            assert_eq!((part.record(), part.meta()), (whole.record(), whole.meta()));
            assert_eq!(part.dictionary(), whole.dictionary());
            let range = start..start + part.len();
            let indices = match chunks.order_kept() {
                true => chunks.order(range)?.into_iter().map(|index| index as usize).collect(),
                false => range.collect::<Vec<usize>>(),
            };
            indices.into_iter().enumerate().for_each(|(k, j)| same_coded(&part, k, whole, j));
            Ok(())
        })?;
        Ok::<_, Error>((chunks, seen))
    });
    let (chunks, seen, whole) = match (read, whole) {
        (Ok((chunks, seen)), Ok(whole)) => (chunks, seen, whole),
        (Err(_), Err(_)) => return,
        (Ok(_), Err(error)) => panic!("refused when read whole only: {error}"),
        (Err(error), Ok(_)) => panic!("refused when read in parts only: {error}"),
    };
    assert_eq!((seen, chunks.len()), (whole.len(), whole.len()));
    assert_eq!(chunks.degree(), whole.dictionary().degree());
    if whole.len() > SMALL {
        return;
    }
    let (mut at_once, mut in_parts) = (Vec::new(), Vec::new());
    let written = ply::write(&mut at_once, &whole.clone().into_splats()).map_err(|e| e.to_string());
    let undone = stream::decompress(&chunks, &mut in_parts, &Silent).map_err(|e| e.to_string());
    assert_eq!(written, undone);
    assert!(at_once == in_parts, "decompressed in parts differs");
}

/// The same Gaussians in two models, extras apart.
///
/// # Panics
/// If they differ.
pub fn decoded(a: &Model, b: &Model) {
    let (own, other) = (a.geometry(), b.geometry());
    assert_eq!(a.len(), b.len());
    assert_eq!((a.record(), a.meta()), (b.record(), b.meta()));
    assert!(a.dictionary() == b.dictionary() && a.codes() == b.codes(), "codes differ");
    for (own, other) in [
        (own.positions.as_flattened(), other.positions.as_flattened()),
        (own.dc.as_flattened(), other.dc.as_flattened()),
        (&own.opacities, &other.opacities),
        (own.scales.as_flattened(), other.scales.as_flattened()),
        (own.rotations.as_flattened(), other.rotations.as_flattened()),
    ] {
        same(own, other);
    }
}

fn same_splat(a: &Splats, i: usize, b: &Splats, j: usize) {
    same_geometry(&a.geometry, i, &b.geometry, j);
    same(a.rest(i), b.rest(j));
}

fn same_coded(a: &Model, i: usize, b: &Model, j: usize) {
    same_geometry(a.geometry(), i, b.geometry(), j);
    match (a.codes().row(i), b.codes().row(j)) {
        (CodedRest::Exact(a), CodedRest::Exact(b)) => same(a, b),
        (CodedRest::Code(a), CodedRest::Code(b)) => {
            let bits = |(atom, value): (usize, f32)| (atom, value.to_bits());
            assert!(a.iter().map(bits).eq(b.iter().map(bits)), "codes of Gaussian {j} differ");
        }
        _ => panic!("Gaussian {j} is an escape in one of them"),
    }
}

fn same_geometry(a: &Geometry, i: usize, b: &Geometry, j: usize) {
    same(&a.positions[i], &b.positions[j]);
    assert_eq!(a.normals.is_empty(), b.normals.is_empty());
    if let (Some(a), Some(b)) = (a.normals.get(i), b.normals.get(j)) {
        same(a, b);
    }
    same(&a.dc[i], &b.dc[j]);
    same(&a.opacities[i..=i], &b.opacities[j..=j]);
    same(&a.scales[i], &b.scales[j]);
    same(&a.rotations[i], &b.rotations[j]);
    assert_eq!(a.extras.len(), b.extras.len());
    for (a, b) in a.extras.iter().zip(&b.extras) {
        assert!(a.name == b.name && bits(&a.values, i) == bits(&b.values, j), "extra {:?} differs", a.name);
    }
}

fn same(a: &[f32], b: &[f32]) {
    assert!(a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits())), "{a:?} is not {b:?}");
}

/// Returns the number of the type, and the bits of value `i`.
fn bits(values: &ExtraValues, i: usize) -> (u8, u64) {
    match values {
        ExtraValues::I8(v) => (0, u64::from(v[i].cast_unsigned())),
        ExtraValues::U8(v) => (1, u64::from(v[i])),
        ExtraValues::I16(v) => (2, u64::from(v[i].cast_unsigned())),
        ExtraValues::U16(v) => (3, u64::from(v[i])),
        ExtraValues::I32(v) => (4, u64::from(v[i].cast_unsigned())),
        ExtraValues::U32(v) => (5, u64::from(v[i])),
        ExtraValues::F32(v) => (6, u64::from(v[i].to_bits())),
        ExtraValues::F64(v) => (7, v[i].to_bits()),
        other => panic!("a type not known here: {other:?}"),
    }
}
