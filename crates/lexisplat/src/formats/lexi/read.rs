//! Reading a [`Model`], trusting nothing.

use std::ops::Range;
use std::path::Path;

use safetensors::Dtype;

use super::exact::Exact;
use super::schema::{EXTRA_PREFIX, FORMAT, PACKED_VERSION, key, tensor};
use super::tensors::Checked;
use crate::packed::Packed;
use crate::scene::sh::ShDegree;
use crate::scene::splats::{Extra, ExtraValues, SceneMeta};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Layout, Model, Record};
use crate::support::error::Result;
use crate::support::input::Input;
use crate::support::limits::{Limits, MAX_ATOMS};

/// Reads a .lexi file.
///
/// # Errors
/// [`crate::Error::Io`] if it cannot be opened, [`crate::Error::Format`] if any byte of it is not as it should be,
/// [`crate::Error::Limit`] if it asks for more than `limits` allow.
pub fn read(path: &Path, limits: &Limits) -> Result<Model> {
    let bytes = Input::open_within(path, limits)?;
    read_bytes(&path.display().to_string(), &bytes, limits)
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
    /// As [`unpack`].
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
/// [`crate::Error::Format`] if its streams are not what an encoder writes, [`crate::Error::Limit`] if it becomes more than
/// [`Packed::limits`] allow.
pub fn unpack(file: &str, packed: &Packed) -> Result<Model> {
    packed.unpack_from(file).map_err(|e| e.of_file(file))
}

/// Reads a .lexi file; packed scenes stay packed.
///
/// # Errors
/// As [`read`].
pub fn open(path: &Path, limits: &Limits) -> Result<Contents> {
    let bytes = Input::open_within(path, limits)?;
    open_bytes(&path.display().to_string(), &bytes, limits)
}

/// Reads a .lexi file that is in memory; packed scenes stay packed. `file` is its name in errors.
///
/// # Errors
/// As [`read`].
pub fn open_bytes(file: &str, bytes: &[u8], limits: &Limits) -> Result<Contents> {
    let (checked, layout) = checked(file, bytes, limits)?;
    if layout == Layout::Packed {
        return Ok(Contents::Packed(super::packed::from_checked(&checked, bytes.len() as u64, limits)?));
    }
    let exact = Exact::open(checked, bytes.len() as u64, limits)?;
    let (n, meta) = (exact.len(), exact.meta.clone());
    let (geometry, codes) = exact.part(0..n)?;
    Ok(Contents::Model(Model { geometry, meta, dictionary: exact.dictionary, codes, record: exact.record }))
}

/// A file whose checksums hold, and its layout, which goes with its version.
pub(super) fn checked<'a>(file: &'a str, bytes: &'a [u8], limits: &Limits) -> Result<(Checked<'a>, Layout)> {
    let checked = Checked::open(file, bytes, &[FORMAT], limits)?;
    let layout = layout(&checked)?;
    Ok((checked, layout))
}

/// The layout of a scene, which goes with its version.
pub(super) fn layout(checked: &Checked<'_>) -> Result<Layout> {
    let layout = record(checked)?.layout;
    let version: u64 = checked.number(key::VERSION)?;
    if (layout == Layout::Packed) != (version == PACKED_VERSION) {
        let text = format!("metadata 'version' is {version}, which has no layout '{layout}'");
        return Err(checked.malformed(text));
    }
    Ok(layout)
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
pub(super) fn dictionary(checked: &Checked<'_>, degree: ShDegree, limits: &Limits) -> Result<Dictionary> {
    let dim = degree.rest();
    let atoms = match checked.view(tensor::DICTIONARY)?.shape() {
        [atoms, width] if *width == dim && (1..=MAX_ATOMS).contains(atoms) => *atoms,
        shape => {
            let text = format!("tensor 'dictionary' has shape {shape:?}, not [1 to {MAX_ATOMS}, {dim}]");
            return Err(checked.malformed(text));
        }
    };
    limits.check_atoms(checked.file, atoms as u64)?;
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

/// Properties 3DGS does not define: those of Gaussians `range` of `n`.
pub(super) fn extras(checked: &Checked<'_>, n: usize, range: &Range<usize>) -> Result<Vec<Extra>> {
    let mut out = Vec::new();
    for full in checked.names() {
        let Some(name) = full.strip_prefix(EXTRA_PREFIX) else { continue };
        let dtype = checked.view(full)?.dtype();
        let shape = [n];
        let values = match dtype {
            Dtype::I8 => ExtraValues::I8(checked.part(full, dtype, &shape, range)?),
            Dtype::U8 => ExtraValues::U8(checked.part(full, dtype, &shape, range)?),
            Dtype::I16 => ExtraValues::I16(checked.part(full, dtype, &shape, range)?),
            Dtype::U16 => ExtraValues::U16(checked.part(full, dtype, &shape, range)?),
            Dtype::I32 => ExtraValues::I32(checked.part(full, dtype, &shape, range)?),
            Dtype::U32 => ExtraValues::U32(checked.part(full, dtype, &shape, range)?),
            Dtype::F32 => ExtraValues::F32(checked.part(full, dtype, &shape, range)?),
            Dtype::F64 => ExtraValues::F64(checked.part(full, dtype, &shape, range)?),
            other => return Err(checked.malformed(format!("tensor '{full}' has type {other:?}"))),
        };
        out.push(Extra { name: name.to_owned(), values });
    }
    Ok(out)
}
