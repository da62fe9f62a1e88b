//! Reads and writes scenes of any format.

use std::path::PathBuf;

use lexisplat::output::{Existing, Output};
use lexisplat::ply::ReadOptions;
use lexisplat::{Progress, SplatSource, Splats};
use lexisplat_compress::{Compression, Error, Packing};
use lexisplat_eval::{Loaded, SceneFile};
use lexisplat_formats::{Kind, Lost, Opened, Siblings, WriteOptions, open, scene_path, write};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;

use crate::arrays::{ShOrder, finite_from_python, to_python};
use crate::bytes::{Bytes, Given, limits};
use crate::errors::{Result, parameter, raise};
use crate::work::without_gil;

/// Reads the scene in a file or in bytes. Returns its arrays and warnings.
#[pyfunction]
#[pyo3(signature = (source, *, name, contiguous, drop_invalid, drop_extras, limit))]
pub(crate) fn load<'py>(
    py: Python<'py>,
    source: Given,
    name: Option<String>,
    contiguous: bool,
    drop_invalid: bool,
    drop_extras: bool,
    limit: Option<&Bound<'py, PyDict>>,
) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
    let options = read_options(py, drop_invalid, drop_extras, limit)?;
    let name = name.unwrap_or_else(|| source.name());
    let file = without_gil(py, None, move |_| match source {
        Given::Path(path) => Ok(SceneFile::read(&path, &options)?),
        source => {
            let bytes = source.bytes(&options.limits)?;
            Ok(SceneFile::read_files(&name, bytes.as_ref(), Siblings::NONE, &options)?)
        }
    })?;
    let warnings = file.warnings().to_vec();
    let splats = match file.loaded {
        Loaded::Ply(read) => read.splats,
        Loaded::Other(read) => read.splats,
        Loaded::Lexi(model, _) => py.detach(|| model.into_splats()),
    };
    let order = if contiguous { ShOrder::Contiguous } else { ShOrder::Strided };
    Ok((to_python(py, splats, order)?, warnings))
}

/// Returns the options of reading scenes.
pub(crate) fn read_options(
    py: Python<'_>,
    drop_invalid: bool,
    drop_extras: bool,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<ReadOptions> {
    Ok(ReadOptions::default()
        .with_drop_invalid(drop_invalid)
        .with_drop_extras(drop_extras)
        .with_limits(limits(py, limit)?))
}

/// Opens the scene `given`, which messages call `name`, and calls `work` with it. The scene is read as a whole if `whole`
/// returns true for its bytes. Returns an error for a compressed scene.
pub(crate) fn with_source<T>(
    given: Given,
    name: &str,
    options: &ReadOptions,
    whole: impl FnOnce(u64) -> bool,
    progress: &dyn Progress,
    work: &mut dyn FnMut(&dyn SplatSource) -> Result<T>,
) -> Result<T> {
    let path = match &given {
        Given::Path(path) => Some(scene_path(path).into_owned()),
        Given::Memory(_) => None,
    };
    let siblings = path.as_deref().map_or(Siblings::NONE, Siblings::of);
    let given = path.clone().map_or(given, Given::Path).bytes(&options.limits)?;
    let bytes = given.as_ref();
    let opened = open(name, bytes, siblings, options, whole(bytes.len() as u64), progress)?;
    let opened = match &given {
        Bytes::File(input) => opened.releasing_pages_of(input),
        _ => opened,
    };
    match opened {
        Opened::Lexi(_) => Err(Error::format(name, "it is compressed already")),
        opened => work(opened.some(name)?),
    }
}

/// Writes a scene in the format `format`, or else in the format of the extension of `path`. Returns what the file lacks,
/// as JSON, and warnings.
#[pyfunction]
#[pyo3(signature = (path, splats, *, format, spz_version, sh_bits, sog_palette, glb_spz, drop_invalid, overwrite, progress))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn save(
    py: Python<'_>,
    path: PathBuf,
    splats: &Bound<'_, PyAny>,
    format: Option<&str>,
    spz_version: u8,
    sh_bits: [u8; 2],
    sog_palette: u32,
    glb_spz: bool,
    drop_invalid: bool,
    overwrite: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, Vec<String>)> {
    let kind = match format {
        Some(name) => Kind::of_extension(&format!(".{name}")),
        None => Kind::of_extension(&path.display().to_string()),
    };
    let writable = |kind: &Kind| *kind == Kind::Lexi || Kind::WRITTEN.contains(kind);
    let Some(kind) = kind.filter(writable) else {
        let expected =
            "ply, lexi, spz, sog, compressed.ply, splat or glb, named by the extension or by format";
        return Err(parameter(py, "format", format.unwrap_or(&path.display().to_string()), expected));
    };
    let mut told = Vec::new();
    let splats = finite_from_python(splats, drop_invalid, &mut told)?;
    let mut options = WriteOptions::default();
    (options.spz_version, options.sh_bits) = (spz_version, sh_bits);
    (options.sog_palette, options.glb_spz) = (sog_palette, glb_spz);
    let (lost, removed) = without_gil(py, progress, |watch| {
        let output = output(&path, overwrite);
        output.check()?;
        match kind {
            Kind::Lexi => {
                let report = Compression::from(Packing::default()).run(&splats, output, watch)?;
                told.extend(report.warnings);
                Ok((lost_in_packed(&splats), Some(report.removed)))
            }
            kind => Ok((write(kind, &splats, &options, output, watch)?.1, None)),
        }
    })?;
    Ok((json(py, &Told { lost, removed })?, told))
}

/// The facts about a written file.
#[derive(Serialize)]
struct Told {
    #[serde(flatten)]
    lost: Lost,
    /// Number of Gaussians that a packed file leaves out.
    #[serde(skip_serializing_if = "Option::is_none")]
    removed: Option<u64>,
}

/// Returns what a packed file lacks of `splats`, apart from Gaussians.
fn lost_in_packed(splats: &Splats) -> Lost {
    let mut lost = Lost::default();
    lost.normals = !splats.geometry.normals.is_empty();
    lost.precision.push("all values, to steps that pictures hardly show (about 40 dB)".to_owned());
    lost.precision.push("SH to sparse codes over a dictionary".to_owned());
    lost
}

/// Returns the output at `path`. The file appears when it is whole.
pub(crate) fn output(path: &std::path::Path, overwrite: bool) -> Output<'_> {
    Output::new(path, if overwrite { Existing::Replace } else { Existing::Refuse })
}

/// Returns `value` as JSON for Python.
pub(crate) fn json(py: Python<'_>, value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value)
        .map_err(|error| raise(py, &Error::parameter("report", error, "a report that can be told as JSON")))
}
