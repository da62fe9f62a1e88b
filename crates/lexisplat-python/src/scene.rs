//! A compressed scene: a .lexi file whose bytes are held in memory.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::PathBuf;
use std::sync::Arc;

use lexisplat::lexi::LexiReader;
use lexisplat::{Indices, Limits, SplatSource as _, Values, stream};
use lexisplat_compress::{RecordReport, attribute_bytes};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde_json::json;

use crate::arrays::{ShOrder, to_python, vector};
use crate::bytes::{Bytes, Given, limits};
use crate::chunks::Chunks;
use crate::errors::raise;
use crate::files::{json, output};
use crate::held::Held;
use crate::work::{check_process, without_gil};

/// A compressed scene.
#[pyclass(frozen, module = "lexisplat._native")]
#[derive(Debug)]
pub(crate) struct Scene {
    pub(crate) held: Arc<Held>,
    /// Report of the compression as JSON, if the scene was compressed here.
    report: Option<String>,
}

impl Scene {
    pub(crate) fn new(name: String, bytes: Bytes, limits: Limits, report: Option<String>) -> Self {
        Self { held: Arc::new(Held::new(name, bytes, limits)), report }
    }

    fn reader(&self, py: Python<'_>) -> PyResult<&LexiReader<'static>> {
        self.held.reader().map_err(|error| raise(py, &error))
    }
}

/// Opens a .lexi file, or its bytes. The header is checked, and nothing is decoded. `report` is the report of the
/// compression, if this package made the file.
#[pyfunction]
#[pyo3(signature = (source, *, name, report, limit))]
pub(crate) fn open_scene(
    py: Python<'_>,
    source: Given,
    name: Option<String>,
    report: Option<String>,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<Scene> {
    let limits = limits(py, limit)?;
    let name = name.unwrap_or_else(|| source.name());
    without_gil(py, None, move |_| {
        let scene = Scene::new(name, source.bytes(&limits)?, limits, report);
        scene.held.reader()?;
        Ok(scene)
    })
}

#[pymethods]
impl Scene {
    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.reader(py)?.len())
    }

    /// Returns the name of the file in messages.
    #[getter]
    fn name(&self) -> &str {
        &self.held.name
    }

    /// Returns whether both files have the same bytes.
    fn equals(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.held, &other.held) || self.held.bytes.as_ref() == other.held.bytes.as_ref()
    }

    /// Returns a hash of the bytes.
    fn hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| {
            let mut hasher = DefaultHasher::new();
            self.held.bytes.as_ref().hash(&mut hasher);
            hasher.finish()
        })
    }

    /// Returns the size of the file, in bytes.
    #[getter]
    fn nbytes(&self) -> usize {
        self.held.bytes.as_ref().len()
    }

    #[getter]
    fn degree(&self, py: Python<'_>) -> PyResult<u8> {
        Ok(self.reader(py)?.degree().get())
    }

    #[getter]
    fn layout(&self, py: Python<'_>) -> PyResult<&'static str> {
        Ok(self.reader(py)?.layout().name())
    }

    /// Returns the offset to which positions are relative.
    #[getter]
    fn offset(&self, py: Python<'_>) -> PyResult<Option<[f64; 3]>> {
        Ok(self.reader(py)?.meta().offset.map(lexisplat::Offset::get))
    }

    /// Returns the text of the view from which viewers show the scene first.
    #[getter]
    fn view(&self, py: Python<'_>) -> PyResult<Option<String>> {
        Ok(self.reader(py)?.meta().view.clone())
    }

    /// Returns the report of the compression as JSON; `None` for a file that was opened.
    #[getter]
    fn report_json(&self) -> Option<&str> {
        self.report.as_deref()
    }

    /// Returns the atoms as an array of (atoms, coefficients).
    fn dictionary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let dictionary = self.reader(py)?.dictionary();
        PyArray1::from_slice(py, dictionary.as_slice()).reshape([dictionary.len(), dictionary.dim()])
    }

    /// Returns facts about the file as JSON. The whole file is decoded for them.
    fn info_json(&self, py: Python<'_>) -> PyResult<String> {
        let held = &self.held;
        let facts = without_gil(py, None, |_| {
            let reader = held.reader()?;
            let survey = stream::survey(reader, &std::env::temp_dir())?;
            let head = reader.packed_head();
            let parts = attribute_bytes(reader.tensor_bytes(), &survey.stream_bits);
            Ok(json!({
                "gaussians": reader.len(),
                "sh_degree": reader.degree().get(),
                "layout": reader.layout().name(),
                "version": reader.version(),
                "file_bytes": held.bytes.as_ref().len(),
                "attribute_bytes": parts.into_iter().collect::<std::collections::BTreeMap<_, _>>(),
                "resident_sh_bytes": survey.resident_sh_bytes,
                "dense_sh_bytes": reader.len() * reader.degree().rest() * size_of::<f32>(),
                "atoms": reader.dictionary().len(),
                "nonzeros": survey.nonzeros,
                "nonzero_histogram": survey.nonzero_histogram,
                "escapes": survey.escapes,
                "record": RecordReport::from(reader.record()),
                "target": head.and_then(|head| head.target.as_ref()),
                "reached": head.and_then(|head| head.reached),
                "removed": head.map_or(0, |head| head.removed),
                "device": head.map(|head| head.device.as_deref().unwrap_or("cpu")),
                "order_kept": reader.order_kept(),
                "antialiased": reader.meta().antialiased,
                "offset": reader.meta().offset,
                "view": reader.meta().view,
                "comments": reader.meta().comments,
                "extras": reader.empty().geometry.extras.iter().map(|e| e.name.as_str()).collect::<Vec<_>>(),
            }))
        })?;
        json(py, &facts)
    }

    /// Returns the dense scene as arrays.
    fn decode<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let held = &self.held;
        let splats = without_gil(py, None, |_| Ok(held.reader()?.model()?.into_splats()))?;
        to_python(py, splats, ShOrder::Strided)
    }

    /// Returns the sparse codes: row starts, atoms, values, numbers of Gaussians that are stored exactly, and their rows.
    #[expect(clippy::type_complexity, reason = "five arrays")]
    fn codes<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Bound<'py, PyArray1<i64>>,
        Bound<'py, PyArray1<i32>>,
        Bound<'py, PyArray1<f32>>,
        Bound<'py, PyArray1<u32>>,
        Bound<'py, PyArray2<f32>>,
    )> {
        let held = &self.held;
        let model = without_gil(py, None, |_| held.model())?;
        let codes = model.codes();
        let mut starts = Vec::with_capacity(codes.len() + 1);
        let mut at = 0;
        starts.push(at);
        for &count in codes.counts() {
            at += i64::from(count);
            starts.push(at);
        }
        let atoms: Vec<i32> = match codes.indices() {
            Indices::U8(atoms) => atoms.iter().map(|&atom| atom.into()).collect(),
            Indices::U16(atoms) => atoms.iter().map(|&atom| atom.into()).collect(),
        };
        let values: Vec<f32> = match codes.values() {
            Values::F32(values) => values.clone(),
            Values::F16(values) => values.iter().map(|value| value.to_f32()).collect(),
        };
        let (escapes, dim) = (codes.escapes(), model.dictionary().dim());
        let rows = vector(py, &escapes.rows).reshape([escapes.gaussians.len(), dim])?;
        Ok((
            PyArray1::from_vec(py, starts),
            PyArray1::from_vec(py, atoms),
            PyArray1::from_vec(py, values),
            vector(py, &escapes.gaussians),
            rows,
        ))
    }

    /// Returns an iterator that decodes the file part by part.
    fn chunks(&self) -> PyResult<Chunks> {
        check_process()?;
        Ok(Chunks::start(Arc::clone(&self.held)))
    }

    /// Writes the file, which appears when it is whole.
    #[pyo3(signature = (path, *, overwrite))]
    fn save(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> PyResult<()> {
        let held = &self.held;
        without_gil(py, None, |watch| {
            let sink = lexisplat::Sink::from(output(&path, overwrite));
            sink.write_bytes(held.bytes.as_ref(), watch)?;
            Ok(())
        })
    }

    /// Returns a copy of the file's bytes.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, self.held.bytes.as_ref())
    }
}
