//! Metadata and tensors that several layouts share, checked.

use std::ops::Range;

use safetensors::Dtype;

use super::checked::Checked;
use super::extra_column::{Column, ColumnError};
use super::layout::Layout;
use super::schema::{EXTRA_PREFIX, PACKED_VERSION, key, tensor};
use crate::formats::ply::is_extra_name;
use crate::scene::extra::{Extra, ScalarType, with_scalar};
use crate::scene::offset::Offset;
use crate::scene::sh::ShDegree;
use crate::scene::splats::SceneMeta;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Record;
use crate::support::error::{Error, Result};
use crate::support::limits::{Limits, MAX_ATOMS};

fn file_layout(checked: &Checked<'_>) -> Result<Layout> {
    if checked.is_packed() && !checked.has_text(key::LAYOUT) {
        return Ok(Layout::Packed);
    }
    checked.text(key::LAYOUT)?.parse().map_err(|e| checked.malformed(format!("metadata: {e}")))
}

/// Returns the layout of a scene, which must belong to the version of the file.
pub(super) fn layout(checked: &Checked<'_>) -> Result<Layout> {
    record(checked)?;
    let layout = file_layout(checked)?;
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
    let comments = match checked.is_packed() && !checked.has_text(key::COMMENTS) {
        true => Vec::new(),
        false => checked.json(key::COMMENTS, |comments| {
            comments.items()?.iter().map(|comment| comment.text().map(str::to_owned)).collect()
        })?,
    };
    Ok(SceneMeta {
        comments,
        antialiased: checked.number_or_default(key::ANTIALIASED)?,
        offset: offset(checked)?,
        view: checked.text(key::VIEW).ok().map(str::to_owned),
    })
}

/// Returns the offset of a scene. Few scenes have an offset.
fn offset(checked: &Checked<'_>) -> Result<Option<Offset>> {
    if !checked.has_text(key::OFFSET) {
        return Ok(None);
    }
    let numbers = checked.json(key::OFFSET, |numbers| match numbers.items()? {
        [x, y, z] => Some([x.number::<f64>()?, y.number::<f64>()?, z.number::<f64>()?]),
        _ => None,
    })?;
    Offset::new(numbers).map_err(|e| checked.malformed(format!("metadata 'offset': {e}")))
}

/// Returns the dictionary of a scene or of a dictionary file.
pub(super) fn dictionary(checked: &Checked<'_>, degree: ShDegree, limits: &Limits) -> Result<Dictionary> {
    let dim = degree.rest();
    let atoms = match checked.tensor(tensor::DICTIONARY)?.shape {
        [atoms, width] if *width == dim && (1..=MAX_ATOMS).contains(atoms) => *atoms,
        shape => {
            let text = format!("tensor 'dictionary' has shape {shape:?}, not [1 to {MAX_ATOMS}, {dim}]");
            return Err(checked.malformed(text));
        }
    };
    limits.check_atoms(&checked.file, atoms as u64)?;
    let values = checked.values(tensor::DICTIONARY, Dtype::F32, &[atoms, dim])?;
    Dictionary::new(degree, values).map_err(|e| checked.malformed(format!("tensor 'dictionary': {e}")))
}

pub(super) fn record(checked: &Checked<'_>) -> Result<Record> {
    let pursuit =
        || checked.text(key::PURSUIT)?.parse().map_err(|e| checked.malformed(format!("metadata: {e}")));
    let record = Record {
        tolerance: checked.optional(key::TOLERANCE)?,
        max_nonzeros: checked.optional(key::MAX_NONZEROS)?,
        pursuit: (!checked.is_packed()).then(pursuit).transpose()?,
        seed: checked.number_or_default(key::SEED)?,
        max_residual: checked.number_or_default(key::MAX_RESIDUAL)?,
        rms_residual: checked.number_or_default(key::RMS_RESIDUAL)?,
        over_tolerance: checked.number_or_default(key::OVER_TOLERANCE)?,
    };
    let sizes = [
        (key::TOLERANCE, record.tolerance.unwrap_or(1.0)),
        (key::MAX_RESIDUAL, record.max_residual),
        (key::RMS_RESIDUAL, record.rms_residual),
    ];
    for (key, value) in sizes {
        if !value.is_finite() || value < 0.0 {
            let text = checked.text(key)?;
            return Err(checked.malformed(format!("metadata '{key}' is {text}, not a finite size")));
        }
    }
    Ok(record)
}

/// Returns the coded column of `n` values in the tensor `name`.
pub(super) fn column<'c>(checked: &'c Checked<'_>, name: &str, n: usize) -> Result<Column<'c>> {
    let len = checked.list_len(name)?;
    Column::new(checked.data(name, Dtype::U8, &[len])?, n).map_err(|e| wrong(checked, name, e))
}

fn wrong(checked: &Checked<'_>, name: &str, error: ColumnError) -> Error {
    checked.malformed(format!("tensor '{}': {error}", name.escape_debug()))
}

/// Refuses extras with names that a property of a PLY cannot have.
pub(super) fn check_extra_names(checked: &Checked<'_>) -> Result<()> {
    let names = || checked.names().filter_map(|name| name.strip_prefix(EXTRA_PREFIX));
    match names().find(|name| !is_extra_name(name)) {
        Some(name) => {
            let name = format!("{EXTRA_PREFIX}{name}");
            let text = format!("tensor '{}' is not named as a property can be", name.escape_debug());
            Err(checked.malformed(text))
        }
        None => Ok(()),
    }
}

/// Returns the properties that 3DGS does not define, of Gaussians `range` of `n`. There are none if only a first part of
/// the file is there. In packed files, these properties lie in the order of the source, and are returned in it. In exact
/// files, they lie in the order of their sizes, and are returned sorted by name.
pub(super) fn extras(checked: &Checked<'_>, n: usize, range: &Range<usize>) -> Result<Vec<Extra>> {
    check_extra_names(checked)?;
    let mut out = Vec::new();
    let names = if checked.is_packed() { checked.names_by_offset() } else { checked.names().collect() };
    for full in names {
        let Some(name) = full.strip_prefix(EXTRA_PREFIX) else { continue };
        if !checked.is_whole() {
            continue;
        }
        if checked.is_packed() {
            let column = column(checked, full, n)?;
            let values = column.values(range.clone()).map_err(|e| wrong(checked, full, e))?;
            out.push(Extra { name: name.to_owned(), values });
            continue;
        }
        let dtype = checked.tensor(full)?.dtype;
        let ty = ScalarType::of_dtype(dtype)
            .ok_or_else(|| checked.malformed(format!("tensor '{full}' has type {dtype:?}")))?;
        let values = with_scalar!(ty, T => checked.rows::<T>(full, dtype, &[n], range)?.into());
        out.push(Extra { name: name.to_owned(), values });
    }
    Ok(out)
}
