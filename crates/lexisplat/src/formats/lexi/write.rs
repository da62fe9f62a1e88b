//! Writing a [`Model`].

use std::collections::BTreeMap;
use std::io::Write;

use safetensors::Dtype;

use super::schema::{EXTRA_PREFIX, FORMAT, VERSION, key, tensor};
use super::tensors::{Draft, Source, Tensor, preamble};
use crate::scene::sh::ShDegree;
use crate::scene::splats::{Extra, ExtraValues, SceneMeta};
use crate::sparse::codes::{Indices, Values};
use crate::sparse::model::{Layout, Model, Record};
use crate::support::error::{Error, Result};
use crate::support::output::Output;

/// Writes `model` to `output`, whole or not at all. Returns the file's size in bytes.
///
/// # Errors
/// [`Error::Io`] for the file; [`Error::Parameter`] if the values' type is not the layout's;
/// [`Error::Limit`] if the paper's 32-bit pointers cannot count the nonzeros.
pub fn write<'a>(output: impl Into<Output<'a>>, model: &Model) -> Result<u64> {
    draft(model)?.save(output.into())
}

/// Writes `model` to `writer`. Returns the number of bytes.
///
/// # Errors
/// As [`write()`]; [`Error::Writer`] if the writer fails.
pub fn write_to(writer: &mut impl Write, model: &Model) -> Result<u64> {
    draft(model)?.stream(writer)
}

/// Bytes of each tensor as written, in file order, and of the header under `header`. They sum to the
/// file's size.
///
/// # Errors
/// As [`write()`], without the I/O.
pub fn attribute_bytes(model: &Model) -> Result<Vec<(String, u64)>> {
    let (metadata, tensors) = contents(model)?;
    Ok(Draft::sizes(metadata, tensors))
}

/// Bytes of the whole file as written.
///
/// # Errors
/// As [`write()`], without the I/O.
pub fn file_bytes(model: &Model) -> Result<u64> {
    Ok(attribute_bytes(model)?.iter().map(|a| a.1).sum())
}

/// Bytes that stand for SH-rest: dictionary, codes and escapes.
///
/// # Errors
/// As [`write()`], without the I/O.
pub fn sh_bytes(model: &Model) -> Result<u64> {
    Ok(tensors(model)?.iter().filter(|t| is_sh(&t.name)).map(|t| t.bytes() as u64).sum())
}

/// Whether a tensor stands for SH-rest.
pub(crate) fn is_sh(name: &str) -> bool {
    name == tensor::DICTIONARY || name.starts_with("codes.") || name.starts_with("escapes.")
}

fn draft(model: &Model) -> Result<Draft<'_>> {
    let (metadata, tensors) = contents(model)?;
    Ok(Draft::new(metadata, tensors))
}

fn contents(model: &Model) -> Result<(BTreeMap<String, String>, Vec<Tensor<'_>>)> {
    if model.record.layout == Layout::Packed {
        let expected =
            "f32, f16 or paper: a packed file is written from a `Packed`, not from what it decodes to";
        return Err(Error::parameter("layout", model.record.layout, expected));
    }
    let mut metadata = preamble(FORMAT, VERSION);
    put_record(&mut metadata, model.degree(), &model.record, &model.meta);
    Ok((metadata, tensors(model)?))
}

/// The metadata all layouts share.
pub(super) fn put_record(
    metadata: &mut BTreeMap<String, String>,
    degree: ShDegree,
    record: &Record,
    meta: &SceneMeta,
) {
    let mut put = |key: &str, value: String| metadata.insert(key.to_owned(), value);
    put(key::DEGREE, degree.to_string());
    put(key::LAYOUT, record.layout.to_string());
    put(key::PURSUIT, record.pursuit.to_string());
    put(key::SEED, record.seed.to_string());
    put(key::MAX_RESIDUAL, record.max_residual.to_string());
    put(key::RMS_RESIDUAL, record.rms_residual.to_string());
    put(key::OVER_TOLERANCE, record.over_tolerance.to_string());
    put(key::ANTIALIASED, meta.antialiased.to_string());
    put(key::COMMENTS, serde_json::to_string(&meta.comments).unwrap_or_default());
    if let Some(tolerance) = record.tolerance {
        put(key::TOLERANCE, tolerance.to_string());
    }
    if let Some(cap) = record.max_nonzeros {
        put(key::MAX_NONZEROS, cap.to_string());
    }
}

fn tensors(model: &Model) -> Result<Vec<Tensor<'_>>> {
    model.geometry.validate()?;
    let (g, codes, n) = (&model.geometry, &model.codes, model.len());
    if codes.len() != n {
        return Err(Error::parameter("codes", codes.len(), format!("{n} columns, one a Gaussian")));
    }
    let mut out = vec![
        Tensor::plain(tensor::POSITION, Dtype::F32, &[n, 3], &g.positions),
        Tensor::plain(tensor::DC, Dtype::F32, &[n, 3], &g.dc),
        Tensor::plain(tensor::OPACITY, Dtype::F32, &[n], &g.opacities),
        Tensor::plain(tensor::SCALE, Dtype::F32, &[n, 3], &g.scales),
        Tensor::plain(tensor::ROTATION, Dtype::F32, &[n, 4], &g.rotations),
    ];
    if !g.normals.is_empty() {
        out.push(Tensor::plain(tensor::NORMAL, Dtype::F32, &[n, 3], &g.normals));
    }
    out.extend(extra_tensors(&g.extras, n));
    let dim = model.dictionary.dim();
    if dim == 0 {
        return Ok(out);
    }
    let shape = [model.dictionary.len(), dim];
    out.push(Tensor::plain(tensor::DICTIONARY, Dtype::F32, &shape, model.dictionary.as_slice()));
    push_codes(&mut out, model)?;
    let escapes = codes.escapes();
    if !escapes.gaussians.is_empty() {
        let count = escapes.gaussians.len();
        out.push(Tensor::plain(tensor::ESCAPED, Dtype::U32, &[count], &escapes.gaussians));
        out.push(Tensor::plain(tensor::ESCAPE_ROWS, Dtype::F32, &[count, dim], &escapes.rows));
    }
    Ok(out)
}

/// Properties 3DGS does not define, as they are.
pub(super) fn extra_tensors(extras: &[Extra], n: usize) -> Vec<Tensor<'_>> {
    let mut out = Vec::new();
    for extra in extras {
        let name = format!("{EXTRA_PREFIX}{}", extra.name);
        out.push(match &extra.values {
            ExtraValues::I8(v) => Tensor::plain(&name, Dtype::I8, &[n], v),
            ExtraValues::U8(v) => Tensor::plain(&name, Dtype::U8, &[n], v),
            ExtraValues::I16(v) => Tensor::plain(&name, Dtype::I16, &[n], v),
            ExtraValues::U16(v) => Tensor::plain(&name, Dtype::U16, &[n], v),
            ExtraValues::I32(v) => Tensor::plain(&name, Dtype::I32, &[n], v),
            ExtraValues::U32(v) => Tensor::plain(&name, Dtype::U32, &[n], v),
            ExtraValues::F32(v) => Tensor::plain(&name, Dtype::F32, &[n], v),
            ExtraValues::F64(v) => Tensor::plain(&name, Dtype::F64, &[n], v),
        });
    }
    out
}

fn push_codes<'a>(out: &mut Vec<Tensor<'a>>, model: &'a Model) -> Result<()> {
    let (codes, layout) = (&model.codes, model.record.layout);
    let nonzeros = codes.nonzeros();
    let counts = codes.counts();
    out.push(match (codes.values(), layout) {
        (Values::F16(v), Layout::F16) => Tensor::plain(tensor::VALUES, Dtype::F16, &[nonzeros], as_bits(v)),
        (Values::F32(v), Layout::F32 | Layout::Paper) => {
            Tensor::plain(tensor::VALUES, Dtype::F32, &[nonzeros], v)
        }
        (values, _) => {
            let expected = format!("values of another type than these of {} bytes", values.width());
            return Err(Error::parameter("layout", layout, expected));
        }
    });
    if layout != Layout::Paper {
        out.push(match codes.indices() {
            Indices::U8(v) => Tensor::plain(tensor::INDICES, Dtype::U8, &[nonzeros], v),
            Indices::U16(v) => Tensor::plain(tensor::INDICES, Dtype::U16, &[nonzeros], v),
        });
        out.push(Tensor::plain(tensor::COUNTS, Dtype::U8, &[counts.len()], counts));
        return Ok(());
    }
    super::spilled::check_pointers(nonzeros as u64)?;
    let pointers = Source::i32(|| {
        let ends = counts.iter().scan(0_i32, |end, &count| {
            *end += i32::from(count);
            Some(*end)
        });
        Box::new(std::iter::once(0).chain(ends))
    });
    let indices = Source::i32(|| match codes.indices() {
        Indices::U8(v) => Box::new(v.iter().map(|&i| i32::from(i))),
        Indices::U16(v) => Box::new(v.iter().map(|&i| i32::from(i))),
    });
    let tensor = |name: &str, len, source| Tensor {
        name: name.to_owned(),
        dtype: Dtype::I32,
        shape: vec![len],
        source,
    };
    out.push(tensor(tensor::POINTERS, counts.len() + 1, pointers));
    out.push(tensor(tensor::INDICES, nonzeros, indices));
    Ok(())
}

/// The bits of half floats, which `bytemuck` knows as integers.
pub(super) fn as_bits(values: &[half::f16]) -> &[u16] {
    use half::slice::HalfFloatSliceExt;
    values.reinterpret_cast()
}
