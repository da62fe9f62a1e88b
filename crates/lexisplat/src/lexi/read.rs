//! Reading a [`Model`], trusting nothing.

use std::path::Path;

use half::f16;
use safetensors::Dtype;

use super::schema::{EXTRA_PREFIX, FORMAT, IGNORED_PREFIX, LENGTH_BYTES, PACKED_VERSION, key, tensor};
use super::tensors::Checked;
use crate::codes::{Escapes, Indices, SparseCodes, Values};
use crate::dictionary::Dictionary;
use crate::error::{Error, FormatError, Result};
use crate::input::Input;
use crate::limits::{Limits, MAX_ATOMS};
use crate::model::{Layout, Model, Record};
use crate::packed::Packed;
use crate::sh::ShDegree;
use crate::splats::{Extra, ExtraValues, Geometry, SceneMeta};

/// Reads a .lexi file.
///
/// # Errors
/// [`Error::Io`] if it cannot be opened, [`Error::Format`] if any byte of it is not as it should be,
/// [`Error::Limit`] if it asks for more than `limits` allow.
pub fn read(path: &Path, limits: &Limits) -> Result<Model> {
    let bytes = Input::open(path)?;
    read_bytes(&path.display().to_string(), &bytes, limits)
}

/// Whether `bytes` begin like a .lexi or other safetensors file.
#[must_use]
pub fn is_lexi(bytes: &[u8]) -> bool {
    bytes.get(LENGTH_BYTES..LENGTH_BYTES + 2) == Some(b"{\"")
}

/// Reads a .lexi file that is in memory. `file` is its name in errors.
///
/// # Errors
/// As [`read`].
pub fn read_bytes(file: &str, bytes: &[u8], limits: &Limits) -> Result<Model> {
    open_bytes(file, bytes, limits)?.into_model(file)
}

/// What a .lexi file holds, before packed scenes are decoded.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Contents {
    /// A scene with its geometry as it was: layouts `f32`, `f16` and `paper`.
    Model(Model),
    /// A packed scene.
    Packed(Packed),
}

impl Contents {
    /// The scene, unpacked if need be. `file` is its name in errors.
    ///
    /// # Errors
    /// [`Error::Format`] if a packed scene's streams are not what an encoder writes.
    pub fn into_model(self, file: &str) -> Result<Model> {
        match self {
            Self::Model(model) => Ok(model),
            Self::Packed(packed) => unpack(file, &packed),
        }
    }
}

/// Decodes a packed scene. `file` is its name in errors.
///
/// # Errors
/// [`Error::Format`] if its streams are not what an encoder writes.
pub fn unpack(file: &str, packed: &Packed) -> Result<Model> {
    packed.unpack().map_err(|e| Error::malformed(file, e.to_string()))
}

/// Reads a .lexi file; packed scenes stay packed.
///
/// # Errors
/// As [`read`].
pub fn open(path: &Path, limits: &Limits) -> Result<Contents> {
    let bytes = Input::open(path)?;
    open_bytes(&path.display().to_string(), &bytes, limits)
}

/// Reads a .lexi file that is in memory; packed scenes stay packed. `file` is its name in errors.
///
/// # Errors
/// As [`read`].
pub fn open_bytes(file: &str, bytes: &[u8], limits: &Limits) -> Result<Contents> {
    let checked = Checked::open(file, bytes, &[FORMAT], limits)?;
    let record = record(&checked)?;
    let packed = record.layout == Layout::Packed;
    let version: u64 = checked.number(key::VERSION)?;
    if packed != (version == PACKED_VERSION) {
        let text = format!("metadata 'version' is {version}, which has no layout '{}'", record.layout);
        return Err(checked.malformed(text));
    }
    if packed {
        return Ok(Contents::Packed(super::packed::from_checked(&checked, bytes.len() as u64, limits)?));
    }
    let n = match checked.view(tensor::POSITION)?.shape() {
        [n, 3] => *n,
        shape => return Err(checked.malformed(format!("tensor 'position' has shape {shape:?}, not [N, 3]"))),
    };
    Limits::check(&format!("Gaussians in {file}"), n as u64, limits.gaussians)?;
    let mut known = vec![
        tensor::POSITION,
        tensor::DC,
        tensor::OPACITY,
        tensor::SCALE,
        tensor::ROTATION,
        tensor::HEADER_CHECKSUM,
    ];
    let mut geometry = Geometry {
        positions: checked.values(tensor::POSITION, Dtype::F32, &[n, 3])?,
        normals: Vec::new(),
        dc: checked.values(tensor::DC, Dtype::F32, &[n, 3])?,
        opacities: checked.values(tensor::OPACITY, Dtype::F32, &[n])?,
        scales: checked.values(tensor::SCALE, Dtype::F32, &[n, 3])?,
        rotations: checked.values(tensor::ROTATION, Dtype::F32, &[n, 4])?,
        extras: Vec::new(),
    };
    if checked.has(tensor::NORMAL) {
        known.push(tensor::NORMAL);
        geometry.normals = checked.values(tensor::NORMAL, Dtype::F32, &[n, 3])?;
    }
    all_finite(file, &geometry)?;
    geometry.extras = extras(&checked, n)?;
    let degree = degree(&checked)?;
    let (dictionary, codes) = if degree == ShDegree::ZERO {
        let dictionary = Dictionary::empty();
        let none = match record.layout {
            Layout::F16 => Values::F16(Vec::new()),
            _ => Values::F32(Vec::new()),
        };
        let codes =
            SparseCodes::new(&dictionary, vec![0; n], Indices::for_atoms(0), none, Escapes::default())?;
        (dictionary, codes)
    } else {
        known.extend([tensor::DICTIONARY, tensor::INDICES, tensor::VALUES]);
        known.push(if record.layout == Layout::Paper { tensor::POINTERS } else { tensor::COUNTS });
        let dictionary = dictionary(&checked, degree)?;
        let codes = codes(&checked, &dictionary, record.layout, n, &mut known)?;
        (dictionary, codes)
    };
    let ignored = |name: &str| name.starts_with(EXTRA_PREFIX) || name.starts_with(IGNORED_PREFIX);
    if let Some(name) = checked.names().iter().find(|name| !known.contains(name) && !ignored(name)) {
        let text = format!("tensor '{name}' is not known for layout '{}' and degree {degree}", record.layout);
        return Err(checked.malformed(text));
    }
    Ok(Contents::Model(Model { geometry, meta: meta(&checked)?, dictionary, codes, record }))
}

pub(super) fn degree(checked: &Checked<'_>) -> Result<ShDegree> {
    ShDegree::new(checked.number(key::DEGREE)?)
        .map_err(|e| checked.malformed(format!("metadata 'degree': {e}")))
}

pub(super) fn meta(checked: &Checked<'_>) -> Result<SceneMeta> {
    let comments = serde_json::from_str(checked.text(key::COMMENTS)?)
        .map_err(|e| checked.malformed(format!("metadata 'comments': {e}")))?;
    Ok(SceneMeta { comments, antialiased: checked.number(key::ANTIALIASED)? })
}

/// The dictionary tensor of a scene or a dictionary file.
pub(super) fn dictionary(checked: &Checked<'_>, degree: ShDegree) -> Result<Dictionary> {
    let dim = degree.rest();
    let atoms = match checked.view(tensor::DICTIONARY)?.shape() {
        [atoms, width] if *width == dim && (1..=MAX_ATOMS).contains(atoms) => *atoms,
        shape => {
            let text = format!("tensor 'dictionary' has shape {shape:?}, not [1 to {MAX_ATOMS}, {dim}]");
            return Err(checked.malformed(text));
        }
    };
    let values = checked.values(tensor::DICTIONARY, Dtype::F32, &[atoms, dim])?;
    Dictionary::new(degree, values).map_err(|e| checked.malformed(format!("tensor 'dictionary': {e}")))
}

pub(super) fn record(checked: &Checked<'_>) -> Result<Record> {
    let layout = checked.text(key::LAYOUT)?;
    let pursuit = checked.text(key::PURSUIT)?;
    let record = Record {
        tolerance: checked.optional(key::TOLERANCE)?,
        max_nonzeros: checked.optional(key::MAX_NONZEROS)?,
        pursuit: pursuit.parse().map_err(|e| checked.malformed(format!("metadata: {e}")))?,
        seed: checked.number(key::SEED)?,
        layout: layout.parse().map_err(|e| checked.malformed(format!("metadata: {e}")))?,
        max_residual: checked.number(key::MAX_RESIDUAL)?,
        rms_residual: checked.number(key::RMS_RESIDUAL)?,
        over_tolerance: checked.number(key::OVER_TOLERANCE)?,
    };
    let sizes = [
        (key::TOLERANCE, record.tolerance.unwrap_or(1.0)),
        (key::MAX_RESIDUAL, record.max_residual),
        (key::RMS_RESIDUAL, record.rms_residual),
    ];
    for (key, value) in sizes {
        if !value.is_finite() || value < 0.0 {
            return Err(checked.malformed(format!("metadata '{key}' is {value}, not a finite size")));
        }
    }
    Ok(record)
}

fn codes(
    checked: &Checked<'_>,
    dictionary: &Dictionary,
    layout: Layout,
    n: usize,
    known: &mut Vec<&'static str>,
) -> Result<SparseCodes> {
    let nonzeros = match checked.view(tensor::VALUES)?.shape() {
        [nonzeros] => *nonzeros,
        shape => return Err(checked.malformed(format!("tensor 'codes.values' has shape {shape:?}"))),
    };
    let values = if layout == Layout::F16 {
        let bits: Vec<u16> = checked.values(tensor::VALUES, Dtype::F16, &[nonzeros])?;
        Values::F16(bits.into_iter().map(f16::from_bits).collect())
    } else {
        Values::F32(checked.values(tensor::VALUES, Dtype::F32, &[nonzeros])?)
    };
    let small = matches!(Indices::for_atoms(dictionary.len()), Indices::U8(_));
    let indices = match (layout, small) {
        (Layout::Paper, _) => {
            let wide: Vec<i32> = checked.values(tensor::INDICES, Dtype::I32, &[nonzeros])?;
            let bad = |i: i32| checked.malformed(format!("tensor 'codes.indices' holds {i}"));
            if small {
                Indices::U8(
                    wide.into_iter().map(|i| u8::try_from(i).map_err(|_| bad(i))).collect::<Result<_>>()?,
                )
            } else {
                Indices::U16(
                    wide.into_iter().map(|i| u16::try_from(i).map_err(|_| bad(i))).collect::<Result<_>>()?,
                )
            }
        }
        (_, true) => Indices::U8(checked.values(tensor::INDICES, Dtype::U8, &[nonzeros])?),
        (_, false) => Indices::U16(checked.values(tensor::INDICES, Dtype::U16, &[nonzeros])?),
    };
    let counts = if layout == Layout::Paper {
        let pointers: Vec<i32> = checked.values(tensor::POINTERS, Dtype::I32, &[n + 1])?;
        if pointers.first() != Some(&0) {
            return Err(checked.malformed("tensor 'codes.pointers' does not begin with 0"));
        }
        let count = |pair: &[i32]| u8::try_from(i64::from(pair[1]) - i64::from(pair[0])).ok();
        pointers.windows(2).map(count).collect::<Option<Vec<u8>>>().ok_or_else(|| {
            checked.malformed("tensor 'codes.pointers' is not monotonic with steps of at most 255")
        })?
    } else {
        checked.values(tensor::COUNTS, Dtype::U8, &[n])?
    };
    let mut escapes = Escapes::default();
    if checked.has(tensor::ESCAPED) {
        known.extend([tensor::ESCAPED, tensor::ESCAPE_ROWS]);
        let count = match checked.view(tensor::ESCAPED)?.shape() {
            [count] => *count,
            shape => return Err(checked.malformed(format!("tensor 'escapes.gaussians' has shape {shape:?}"))),
        };
        escapes.gaussians = checked.values(tensor::ESCAPED, Dtype::U32, &[count])?;
        escapes.rows = checked.values(tensor::ESCAPE_ROWS, Dtype::F32, &[count, dictionary.dim()])?;
    }
    SparseCodes::new(dictionary, counts, indices, values, escapes)
        .map_err(|e| checked.malformed(e.to_string()))
}

pub(super) fn extras(checked: &Checked<'_>, n: usize) -> Result<Vec<Extra>> {
    let mut out = Vec::new();
    for full in checked.names() {
        let Some(name) = full.strip_prefix(EXTRA_PREFIX) else { continue };
        let dtype = checked.view(full)?.dtype();
        let shape = [n];
        let values = match dtype {
            Dtype::I8 => ExtraValues::I8(checked.values(full, dtype, &shape)?),
            Dtype::U8 => ExtraValues::U8(checked.values(full, dtype, &shape)?),
            Dtype::I16 => ExtraValues::I16(checked.values(full, dtype, &shape)?),
            Dtype::U16 => ExtraValues::U16(checked.values(full, dtype, &shape)?),
            Dtype::I32 => ExtraValues::I32(checked.values(full, dtype, &shape)?),
            Dtype::U32 => ExtraValues::U32(checked.values(full, dtype, &shape)?),
            Dtype::F32 => ExtraValues::F32(checked.values(full, dtype, &shape)?),
            Dtype::F64 => ExtraValues::F64(checked.values(full, dtype, &shape)?),
            other => return Err(checked.malformed(format!("tensor '{full}' has type {other:?}"))),
        };
        out.push(Extra { name: name.to_owned(), values });
    }
    Ok(out)
}

/// Refuses NaN and infinity in what is drawn. Extras may hold anything.
fn all_finite(file: &str, g: &Geometry) -> Result<()> {
    let arrays: [(&str, usize, &[f32]); 6] = [
        (tensor::POSITION, 3, g.positions.as_flattened()),
        (tensor::NORMAL, 3, g.normals.as_flattened()),
        (tensor::DC, 3, g.dc.as_flattened()),
        (tensor::OPACITY, 1, &g.opacities),
        (tensor::SCALE, 3, g.scales.as_flattened()),
        (tensor::ROTATION, 4, g.rotations.as_flattened()),
    ];
    for (name, width, values) in arrays {
        let bad =
            values.chunks_exact(width).enumerate().filter(|(_, row)| row.iter().any(|v| !v.is_finite()));
        let mut bad = bad.map(|(i, _)| i as u64);
        if let Some(first) = bad.next() {
            let problem =
                FormatError::NotFinite { count: 1 + bad.count() as u64, first, property: name.to_owned() };
            return Err(Error::format(file, problem));
        }
    }
    Ok(())
}
