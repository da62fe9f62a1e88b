//! Scenes as NumPy arrays. Results are moved into arrays without a copy. Arguments are copied once.

use lexisplat::sh::{CHANNELS, MAX_REST};
use lexisplat::{
    Extra, ExtraValues, Geometry, Offset, SURE_OPACITY, SceneMeta, ShDegree, Splats, flatten_scales,
};
use numpy::ndarray::ArrayView3;
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::errors::parameter;
use crate::invalid::finite;
use crate::work::check_process;

/// Number of Gaussians whose SH one task reorders.
const PER_TASK: usize = 4096;

/// The order of SH-rest in a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ShOrder {
    /// A view with strides on the array with the channels apart.
    Strided,
    /// An array that was reordered in place to (Gaussians, coefficients, channels).
    Contiguous,
}

/// Returns `splats` as a dictionary of arrays. The keys are the names of Python's `Splats`.
pub(crate) fn to_python(py: Python<'_>, splats: Splats, order: ShOrder) -> PyResult<Bound<'_, PyDict>> {
    let Splats { geometry, degree, mut sh_rest, meta } = splats;
    let (n, each) = (geometry.len(), degree.rest_per_channel());
    let out = PyDict::new(py);
    out.set_item("means", matrix(py, geometry.positions)?)?;
    out.set_item("scales", matrix(py, geometry.scales)?)?;
    out.set_item("quats", matrix(py, geometry.rotations)?)?;
    out.set_item("opacities", PyArray1::from_vec(py, geometry.opacities))?;
    out.set_item("sh0", matrix(py, geometry.dc)?.reshape([n, 1, CHANNELS])?)?;
    if order == ShOrder::Contiguous {
        py.detach(|| turn(&mut sh_rest, each));
        out.set_item("shN", PyArray1::from_vec(py, sh_rest).reshape([n, each, CHANNELS])?)?;
    } else {
        let rest = PyArray1::from_vec(py, sh_rest).reshape([n, CHANNELS, each])?;
        out.set_item("shN", rest.permute(Some([0_usize, 2, 1]))?)?;
    }
    let normals = match geometry.normals.is_empty() {
        true => None,
        false => Some(matrix(py, geometry.normals)?),
    };
    out.set_item("normals", normals)?;
    let extras = PyDict::new(py);
    for extra in geometry.extras {
        extras.set_item(extra.name, extra_to_python(py, extra.values)?)?;
    }
    out.set_item("extras", extras)?;
    out.set_item("comments", meta.comments)?;
    out.set_item("antialiased", meta.antialiased)?;
    out.set_item("offset", meta.offset.map(|offset| PyArray1::from_slice(py, &offset.get())))?;
    Ok(out)
}

/// Reorders rows of (channels, `each` coefficients) to rows of (coefficients, channels).
fn turn(rows: &mut [f32], each: usize) {
    let length = CHANNELS * each;
    if length == 0 {
        return;
    }
    rows.par_chunks_mut(PER_TASK * length).for_each(|rows| {
        let mut before = [0.0; MAX_REST];
        for row in rows.chunks_exact_mut(length) {
            let before = &mut before[..length];
            before.copy_from_slice(row);
            let (red, rest) = before.split_at(each);
            let (green, blue) = rest.split_at(each);
            for (to, ((r, g), b)) in row.chunks_exact_mut(CHANNELS).zip(red.iter().zip(green).zip(blue)) {
                to.copy_from_slice(&[*r, *g, *b]);
            }
        }
    });
}

fn matrix<const N: usize>(py: Python<'_>, rows: Vec<[f32; N]>) -> PyResult<Bound<'_, PyArray2<f32>>> {
    let n = rows.len();
    PyArray1::from_vec(py, rows.into_flattened()).reshape([n, N])
}

macro_rules! extras {
    ($($variant:ident($type:ty))*) => {
        fn extra_to_python(py: Python<'_>, values: ExtraValues) -> PyResult<Bound<'_, PyAny>> {
            Ok(match values {
                $(ExtraValues::$variant(values) => PyArray1::from_vec(py, values).into_any(),)*
                _ => return Err(parameter(py, "extras", "another type", "numbers of 8 to 64 bits")),
            })
        }

        fn extra_from_python(name: &str, values: &Bound<'_, PyAny>) -> PyResult<ExtraValues> {
            $(if let Ok(values) = values.extract::<PyReadonlyArray1<'_, $type>>() {
                return Ok(values.as_array().to_vec().into());
            })*
            let expected = "an array of one dimension of int8 to int32, uint8 to uint32, float32 or float64";
            Err(parameter(values.py(), "extras", name, expected))
        }
    };
}
extras! { I8(i8) U8(u8) I16(i16) U16(u16) I32(i32) U32(u32) F32(f32) F64(f64) }

/// Returns the scene in the attributes of Python's `Splats`, whose values must be finite. Gaussians with other values
/// cause an error, or are left out if `drop_invalid` is set. In that case a message with their number is added to `told`.
pub(crate) fn finite_from_python(
    splats: &Bound<'_, PyAny>,
    drop_invalid: bool,
    told: &mut Vec<String>,
) -> PyResult<Splats> {
    let (splats, dropped) = finite(splats.py(), from_python(splats)?, drop_invalid)?;
    told.extend(dropped);
    Ok(splats)
}

/// Returns the scene in the attributes of Python's `Splats`, with any values.
pub(crate) fn from_python(splats: &Bound<'_, PyAny>) -> PyResult<Splats> {
    let py = splats.py();
    check_process()?;
    let positions = rows::<3>(splats, "means")?;
    let (n, sh0) = (positions.len(), array::<PyReadonlyArray3<'_, f32>>(splats, "sh0")?);
    if sh0.shape() != [n, 1, CHANNELS] {
        return Err(shape(py, "sh0", sh0.shape(), &format!("({n}, 1, {CHANNELS})")));
    }
    let (dc, _) = slice(py, "sh0", sh0.as_slice())?.as_chunks();
    let opacities = array::<PyReadonlyArray1<'_, f32>>(splats, "opacities")?;
    let opacities = slice(py, "opacities", opacities.as_slice())?.iter().map(|&v| sure(v)).collect();
    let normals = match splats.getattr("normals")?.is_none() {
        true => Vec::new(),
        false => rows::<3>(splats, "normals")?,
    };
    let mut extras = Vec::new();
    for (name, values) in splats.getattr("extras")?.cast::<PyDict>()? {
        let name: String = name.extract()?;
        let values = extra_from_python(&name, &values)?;
        extras.push(Extra { name, values });
    }
    let (degree, sh_rest) = sh_rest(splats, n)?;
    let mut scales = rows::<3>(splats, "scales")?;
    flatten_scales(&mut scales);
    let splats = Splats {
        geometry: Geometry {
            positions,
            normals,
            dc: dc.to_vec(),
            opacities,
            scales,
            rotations: rows::<4>(splats, "quats")?,
            extras,
        },
        degree,
        sh_rest,
        meta: SceneMeta {
            comments: splats.getattr("comments")?.extract()?,
            antialiased: splats.getattr("antialiased")?.extract()?,
            offset: offset(splats)?,
            view: None,
        },
    };
    splats.validate().map_err(|error| crate::errors::raise(py, &error.into()))?;
    Ok(splats)
}

/// Returns the offset; `None` for `None` and for zeros.
fn offset(splats: &Bound<'_, PyAny>) -> PyResult<Option<Offset>> {
    let numbers: Option<[f64; 3]> = splats.getattr("offset")?.extract()?;
    let found = numbers.map_or(Ok(None), Offset::new);
    found.map_err(|error| crate::errors::raise(splats.py(), &error.into()))
}

/// Returns the finite value that readers of files use for an infinite opacity.
fn sure(opacity: f32) -> f32 {
    if opacity.is_infinite() { SURE_OPACITY.copysign(opacity) } else { opacity }
}

fn array<'a, T: for<'p> FromPyObject<'p, 'a>>(splats: &Bound<'a, PyAny>, name: &'static str) -> PyResult<T> {
    let value = splats.getattr(name)?;
    let kind = value.get_type().name().map_or_else(|_| "an object".to_owned(), |name| name.to_string());
    let wrong =
        |_| parameter(splats.py(), name, kind, "an array of float32 of the shape that Splats documents");
    value.extract().map_err(|error: T::Error| wrong(error))
}

fn slice<'a, E>(py: Python<'_>, name: &'static str, slice: Result<&'a [f32], E>) -> PyResult<&'a [f32]> {
    slice.map_err(|_| parameter(py, name, "strided", "a contiguous array"))
}

fn shape(py: Python<'_>, name: &'static str, found: &[usize], expected: &str) -> PyErr {
    parameter(py, name, format!("{found:?}"), format!("an array of shape {expected}"))
}

/// Returns the rows of an attribute with `N` columns.
fn rows<const N: usize>(splats: &Bound<'_, PyAny>, name: &'static str) -> PyResult<Vec<[f32; N]>> {
    let py = splats.py();
    let values = array::<PyReadonlyArray2<'_, f32>>(splats, name)?;
    if values.shape()[1] != N {
        return Err(shape(py, name, values.shape(), &format!("(N, {N})")));
    }
    Ok(slice(py, name, values.as_slice())?.as_chunks().0.to_vec())
}

/// Returns the SH degree, and SH-rest with the channels apart.
fn sh_rest(splats: &Bound<'_, PyAny>, n: usize) -> PyResult<(ShDegree, Vec<f32>)> {
    let py = splats.py();
    let values = array::<PyReadonlyArray3<'_, f32>>(splats, "shN")?;
    let view = values.as_array();
    let degree = (0..=4).filter_map(|degree| ShDegree::new(degree).ok());
    let degree = degree.into_iter().find(|degree| degree.rest_per_channel() == view.shape()[1]);
    match degree {
        Some(degree) if view.shape()[0] == n && view.shape()[2] == CHANNELS => {
            Ok((degree, channel_major(view)))
        }
        _ => Err(shape(py, "shN", view.shape(), &format!("({n}, K, 3) with K of 0, 3, 8, 15 or 24"))),
    }
}

/// Copies an array of (Gaussians, coefficients, channels) to an array of (Gaussians, channels, coefficients).
fn channel_major(values: ArrayView3<'_, f32>) -> Vec<f32> {
    let turned = values.permuted_axes([0, 2, 1]);
    if let Some(all) = turned.as_slice() {
        return all.to_vec();
    }
    transposed(turned)
}

/// Returns the values of `from` in the order of its axes, for any strides.
fn transposed(from: ArrayView3<'_, f32>) -> Vec<f32> {
    let (n, each) = (from.shape()[0], from.shape()[1] * from.shape()[2]);
    let mut out = vec![0.0; n * each];
    if each > 0 {
        out.par_chunks_mut(PER_TASK * each).enumerate().for_each(|(task, out)| {
            for (i, row) in out.chunks_exact_mut(each).enumerate() {
                let from = from.index_axis(numpy::ndarray::Axis(0), task * PER_TASK + i);
                row.iter_mut().zip(from.iter()).for_each(|(to, from)| *to = *from);
            }
        });
    }
    out
}

/// Returns a contiguous copy of `values`, an array of three dimensions with any strides.
#[pyfunction]
pub(crate) fn contiguous<'py>(
    py: Python<'py>,
    values: PyReadonlyArray3<'py, f32>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    check_process()?;
    let view = values.as_array();
    let shape = [view.shape()[0], view.shape()[1], view.shape()[2]];
    // The GIL is held, so that no other thread of Python changes the array meanwhile.
    let copy = transposed(view);
    PyArray1::from_vec(py, copy).reshape(shape)
}

/// Returns a copy of `values` as an array of one dimension.
pub(crate) fn vector<'py, T: Element + Copy>(py: Python<'py>, values: &[T]) -> Bound<'py, PyArray1<T>> {
    PyArray1::from_slice(py, values)
}
