//! Reads a PLY into a [`Splats`].

use std::ops::Range;
use std::path::Path;

use super::columns::{Packed, any_not_finite, read_column};
use super::header::{Header, ScalarType};
use super::layout::{Layout, rest_name};
use super::marks::marks;
use super::names::{DC, NORMAL, OPACITY, POSITION, ROTATION, SCALE};
use super::rows::{CHUNK_ROWS, Rows};
use super::summary::PlySummary;
use crate::error::{Error, FormatError, Result};
use crate::input::Input;
use crate::limits::Limits;
use crate::parallel::map_vec;
use crate::splats::{Extra, ExtraValues, Geometry, SceneMeta, Splats, for_extra};

/// What an infinite opacity, before the sigmoid, is taken as, with its sign: in f32 the sigmoid of this is 1 and
/// that of its negative 0, to the last bit. Decoders of 8-bit opacities (SPZ, compressed.ply) write such values
/// for 255 and 0.
const SURE_OPACITY: f32 = 100.0;

/// How to read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Leave out Gaussians with NaN or infinite values instead of refusing the file.
    pub drop_invalid: bool,
    /// What a file may ask for.
    pub limits: Limits,
}

/// A scene and what there is to say about its file.
#[derive(Debug, Clone, PartialEq)]
pub struct PlyRead {
    /// The scene.
    pub splats: Splats,
    /// Oddities that did not prevent reading, one plain sentence each.
    pub warnings: Vec<String>,
    /// What the file was like.
    pub source: PlySummary,
}

/// Reads the PLY at `path`, mapped with the feature `mmap`.
///
/// # Errors
/// [`Error::Io`] if it cannot be read, else as [`read_bytes`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<PlyRead> {
    let input = Input::open(path)?;
    read_bytes(&path.display().to_string(), &input, options)
}

/// Reads the PLY in `bytes`; messages call it `name`.
///
/// Floats keep their bits; other types become the nearest f32 (with a warning). Infinite opacities become 100
/// and -100, which look the same (with a warning). Memory: the arrays of
/// the result, at most a few times `bytes`, and next to nothing else.
///
/// # Errors
/// [`Error::Format`] naming what is wrong: no PLY, a relative of 3DGS that is not supported, a missing
/// or repeated property, a count that does not match, NaN or (but for opacities) infinite values unless
/// [`ReadOptions::drop_invalid`]. [`Error::Limit`] if the file asks for more than its limits allow.
pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<PlyRead> {
    let header = Header::parse(name, bytes, &options.limits)?;
    let layout = Layout::new(name, &header)?;
    let mut source = PlySummary::new(&header, bytes.len() as u64, layout.row_bytes as u64);
    Limits::check("Gaussians", source.vertices, options.limits.gaussians)?;

    let marks = marks(&header.comments);
    let mut warnings = layout.warnings.clone();
    if marks.contradict {
        warnings.push("comments contradict each other about anti-aliasing; taken as anti-aliased".to_owned());
    }
    let rows = Rows::locate(name, &header, layout.row_bytes, &bytes[header.bytes..], &mut warnings)?;
    let count = usize::try_from(source.vertices)
        .map_err(|_| Error::malformed(name, format!("{} vertices do not fit in memory", source.vertices)))?;
    if count == 0 {
        warnings.push("the scene holds no Gaussians".to_owned());
    }

    let mut splats = allocate(name, &layout, count)?;
    splats.meta = SceneMeta { comments: header.comments, antialiased: marks.antialiased };
    let Filled { bad, sure } = fill(&rows, &layout, &mut splats)?;
    if sure > 0 {
        warnings.push(format!(
            "{sure} opacities are infinite, taken as {SURE_OPACITY} (opaque) or -{SURE_OPACITY} (invisible)"
        ));
    }
    if let Some(first) = bad.first() {
        let dropped: usize = bad.iter().map(|b| b.rows.len()).sum();
        let (row, property) = (first.rows.first().copied().unwrap_or(0), first.property.clone());
        if !options.drop_invalid {
            let problem = FormatError::NotFinite { count: dropped as u64, first: row as u64, property };
            return Err(Error::format(name, problem));
        }
        source.dropped = dropped as u64;
        warnings.push(format!(
            "dropped {dropped} of {count} Gaussians with NaN or infinite values, the first is number {row} \
             (property '{property}')"
        ));
        let mut keep = vec![true; count];
        bad.iter().flat_map(|b| &b.rows).for_each(|&row| keep[row] = false);
        splats.retain(&keep);
        if splats.geometry.normals.iter().flatten().all(|v| v.to_bits() == 0) {
            splats.geometry.normals = Vec::new();
        }
    }
    Ok(PlyRead { splats, warnings, source })
}

/// Zeroed arrays for `count` Gaussians, normals left out.
///
/// The caller has checked that the file holds `count` rows, and every property takes at least a byte
/// of a row, so this is at most four times the file. Zeroed memory comes untouched from the system;
/// the threads that fill it are the first to write it.
fn allocate(file: &str, layout: &Layout, count: usize) -> Result<Splats> {
    let rest = layout.degree.rest();
    // 14 floats and 3 for normals; extras are 8 bytes at most. Only 32-bit systems can fail this.
    let row = (17 + rest) * size_of::<f32>() + layout.extras.len() * size_of::<f64>();
    if count.checked_mul(row).is_none_or(|bytes| isize::try_from(bytes).is_err()) {
        return Err(Error::malformed(file, format!("{count} vertices do not fit in memory")));
    }
    let extras = layout.extras.iter().map(|(name, field)| {
        let values = match field.ty {
            ScalarType::I8 => ExtraValues::I8(vec![0; count]),
            ScalarType::U8 => ExtraValues::U8(vec![0; count]),
            ScalarType::I16 => ExtraValues::I16(vec![0; count]),
            ScalarType::U16 => ExtraValues::U16(vec![0; count]),
            ScalarType::I32 => ExtraValues::I32(vec![0; count]),
            ScalarType::U32 => ExtraValues::U32(vec![0; count]),
            ScalarType::F32 => ExtraValues::F32(vec![0.0; count]),
            ScalarType::F64 => ExtraValues::F64(vec![0.0; count]),
        };
        Extra { name: name.clone(), values }
    });
    Ok(Splats {
        geometry: Geometry {
            positions: vec![[0.0; 3]; count],
            normals: Vec::new(),
            dc: vec![[0.0; 3]; count],
            opacities: vec![0.0; count],
            scales: vec![[0.0; 3]; count],
            rotations: vec![[0.0; 4]; count],
            extras: extras.collect(),
        },
        degree: layout.degree,
        sh_rest: vec![0.0; rest * count],
        meta: SceneMeta::default(),
    })
}

/// Gaussians of one chunk that hold NaN or infinite values.
#[derive(Debug)]
struct Bad {
    /// Which, ascending; at least one.
    rows: Vec<usize>,
    /// The first one's first such property, in the INRIA order.
    property: String,
}

/// Fills one column of extras for one chunk of rows.
type ExtraFill<'a> = Box<dyn FnMut(Packed<'_>) + Send + 'a>;

/// One chunk of rows and where they go.
struct Piece<'a> {
    rows: Range<usize>,
    positions: &'a mut [f32],
    dc: &'a mut [f32],
    rest: &'a mut [f32],
    opacities: &'a mut [f32],
    scales: &'a mut [f32],
    rotations: &'a mut [f32],
    extras: Vec<ExtraFill<'a>>,
}

/// What filling a piece found.
struct Found {
    bad: Option<Bad>,
    normals: bool,
    /// Opacities that were infinite.
    sure: usize,
}

/// What filling all pieces found.
struct Filled {
    /// The chunks with bad values, in order.
    bad: Vec<Bad>,
    /// Opacities that were infinite.
    sure: usize,
}

/// Fills the arrays from `rows`.
fn fill(rows: &Rows<'_>, layout: &Layout, splats: &mut Splats) -> Result<Filled> {
    let count = splats.len();
    let (mut bad, mut normals, mut sure) = (Vec::new(), false, 0);
    for found in map_vec(pieces(splats, layout), |piece| fill_piece(rows, layout, piece)) {
        let found = found?;
        bad.extend(found.bad);
        normals |= found.normals;
        sure += found.sure;
    }
    if let (true, Some(group)) = (normals, &layout.normal) {
        // Rare enough for a second pass, which spares everyone else the array.
        splats.geometry.normals = vec![[0.0; 3]; count];
        let parts = splats.geometry.normals.chunks_mut(CHUNK_ROWS).enumerate().collect();
        let done = map_vec(parts, |(c, part): (usize, &mut [[f32; 3]])| {
            let (bytes, big) = rows.chunk(c * CHUNK_ROWS..c * CHUNK_ROWS + part.len())?;
            group.read(Packed { bytes: &bytes, row_bytes: layout.row_bytes, big }, part.as_flattened_mut());
            Ok(())
        });
        done.into_iter().collect::<Result<()>>()?;
    }
    Ok(Filled { bad, sure })
}

/// The arrays of `splats` cut into chunks of rows.
fn pieces<'a>(splats: &'a mut Splats, layout: &'a Layout) -> Vec<Piece<'a>> {
    fn take<'a, T>(left: &mut &'a mut [T], len: usize) -> &'a mut [T] {
        let (head, tail) = std::mem::take(left).split_at_mut(len);
        *left = tail;
        head
    }
    let count = splats.len();
    let dim = splats.degree.rest();
    let geometry = &mut splats.geometry;
    let mut positions = geometry.positions.as_flattened_mut();
    let mut dc = geometry.dc.as_flattened_mut();
    let mut rest = splats.sh_rest.as_mut_slice();
    let mut opacities = geometry.opacities.as_mut_slice();
    let mut scales = geometry.scales.as_flattened_mut();
    let mut rotations = geometry.rotations.as_flattened_mut();
    let mut pieces: Vec<Piece<'a>> = Vec::with_capacity(count.div_ceil(CHUNK_ROWS));
    for start in (0..count).step_by(CHUNK_ROWS) {
        let n = CHUNK_ROWS.min(count - start);
        pieces.push(Piece {
            rows: start..start + n,
            positions: take(&mut positions, 3 * n),
            dc: take(&mut dc, 3 * n),
            rest: take(&mut rest, dim * n),
            opacities: take(&mut opacities, n),
            scales: take(&mut scales, 3 * n),
            rotations: take(&mut rotations, 4 * n),
            extras: Vec::with_capacity(layout.extras.len()),
        });
    }
    for (extra, (_, field)) in geometry.extras.iter_mut().zip(&layout.extras) {
        let offset = field.offset;
        for_extra!(&mut extra.values, values => {
            for (piece, part) in pieces.iter_mut().zip(values.chunks_mut(CHUNK_ROWS)) {
                piece.extras.push(Box::new(move |rows| read_column(rows, offset, part)));
            }
        });
    }
    pieces
}

fn fill_piece(rows: &Rows<'_>, layout: &Layout, mut piece: Piece<'_>) -> Result<Found> {
    let (bytes, big) = rows.chunk(piece.rows.clone())?;
    let packed = Packed { bytes: &bytes, row_bytes: layout.row_bytes, big };
    layout.position.read(packed, piece.positions);
    layout.dc.read(packed, piece.dc);
    layout.rest.read(packed, piece.rest);
    layout.opacity.read(packed, piece.opacities);
    let mut sure = 0;
    for opacity in piece.opacities.iter_mut().filter(|v| v.is_infinite()) {
        *opacity = SURE_OPACITY.copysign(*opacity);
        sure += 1;
    }
    layout.scale.read(packed, piece.scales);
    layout.rotation.read(packed, piece.rotations);
    piece.extras.iter_mut().for_each(|fill| fill(packed));
    let mut normals = Vec::new();
    if let Some(group) = &layout.normal {
        normals.resize(group.width() * piece.rows.len(), 0.0);
        group.read(packed, &mut normals);
    }
    // A negative zero is worth keeping too: what comes out must have the bits that went in.
    let any_normal = normals.iter().fold(0, |any, v| any | v.to_bits()) != 0;
    Ok(Found { bad: bad_rows(&piece, &normals), normals: any_normal, sure })
}

/// The piece's Gaussians with NaN or infinite values, if any.
fn bad_rows(piece: &Piece<'_>, normals: &[f32]) -> Option<Bad> {
    let count = piece.rows.len();
    let groups: [&[f32]; 7] =
        [piece.positions, normals, piece.dc, piece.rest, piece.opacities, piece.scales, piece.rotations];
    if !groups.iter().any(|values| any_not_finite(values)) {
        return None;
    }
    let rest_names: Vec<String> = (0..piece.rest.len() / count).map(rest_name).collect();
    let rest_names: Vec<&str> = rest_names.iter().map(String::as_str).collect();
    let names: [&[&str]; 7] = [&POSITION, &NORMAL, &DC, &rest_names, &OPACITY, &SCALE, &ROTATION];
    let first_bad = |row: usize| {
        groups.iter().zip(names).find_map(|(values, names)| {
            let width = values.len() / count;
            let values = &values[row * width..(row + 1) * width];
            values.iter().zip(names).find(|(v, _)| !v.is_finite()).map(|(_, &name)| name)
        })
    };
    let rows: Vec<usize> = (0..count).filter(|&row| first_bad(row).is_some()).collect();
    let property = rows.first().and_then(|&row| first_bad(row)).unwrap_or_default().to_owned();
    Some(Bad { rows: rows.into_iter().map(|row| piece.rows.start + row).collect(), property })
}
