//! The steps of packing a scene in tiles. Each step works on the bytes that the step before returned. `lexisplat.ray`
//! runs them in tasks.

use std::path::{Path, PathBuf};

use lexisplat::packed::PackOptions;
use lexisplat::packed::tiles::{
    Assembly, Bucket, BucketReader, Coded, Coding, Counts, LookStatistics, Looked, Plan, Sample,
    SampleStatistics, Steps, Survey, Tables,
};
use lexisplat::ply::ReadOptions;
use lexisplat::{Silent, SplatSource, Splats};
use lexisplat_compress::{CompressionReport, Error, Quality, Refine, RefineReport, Target, tiles};
use lexisplat_render::{Device, Renderer};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::from_python;
use crate::bytes::Given;
use crate::choices::{effort, pack_options, preset, refuse};
use crate::draw::device;
use crate::errors::{Result, raise};
use crate::files::{json, output, read_options, with_source};
use crate::work::without_gil;

/// A tile: a file, or arrays that Ray holds.
struct Tile {
    name: String,
    content: Content,
}

enum Content {
    File(PathBuf),
    Splats(Box<Splats>),
}

/// A tile from Python: its name in messages, and a path or arrays.
type Named<'py> = (String, Bound<'py, PyAny>);

impl Tile {
    fn of((name, given): Named<'_>) -> PyResult<Self> {
        let content = match given.extract::<PathBuf>() {
            Ok(path) => Content::File(path),
            Err(_) => Content::Splats(Box::new(from_python(&given)?)),
        };
        Ok(Self { name, content })
    }

    /// Calls `work` with the tile. Errors name the tile.
    fn with<T>(
        &self,
        options: &ReadOptions,
        work: &mut dyn FnMut(&dyn SplatSource) -> Result<T>,
    ) -> Result<T> {
        let done = match &self.content {
            Content::Splats(splats) => work(&**splats),
            // The file is mapped only while it is read, so that not all tiles of a bucket are mapped at once.
            Content::File(path) => {
                with_source(Given::Path(path.clone()), &self.name, options, |_| false, &Silent, work)
            }
        };
        done.map_err(|error| match error {
            Error::Codec(error @ lexisplat::Error::Parameter { .. }) => {
                Error::format(&self.name, error.to_string())
            }
            error => error,
        })
    }
}

/// Options of reading and packing tiles, with their names in Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Choices {
    preset: Option<String>,
    psnr: Option<f64>,
    tol: Option<f64>,
    atoms: Option<usize>,
    seed: u64,
    keep_order: bool,
    keep_all: bool,
    lod: bool,
    /// `quick`, `thorough` or minutes.
    refine: Option<String>,
    guess: bool,
    device: String,
    drop_invalid: bool,
    drop_extras: bool,
}

impl Choices {
    fn reading(&self, py: Python<'_>, limit: Option<&Bound<'_, PyDict>>) -> PyResult<ReadOptions> {
        read_options(py, self.drop_invalid, self.drop_extras, limit)
    }

    fn options(&self) -> PackOptions {
        pack_options(self.tol, self.atoms, self.keep_order, self.keep_all, self.lod, self.seed)
    }

    fn effort(&self) -> Result<Option<Refine>> {
        effort(self.refine.as_deref())
    }

    /// Returns the PSNR asked for, in dB.
    fn decibels(&self) -> Result<f64> {
        match self.psnr {
            Some(decibels) => Quality::from(Target::MeanPsnr(decibels)).decibels(),
            None => Ok(preset(self.preset.as_deref())?.decibels()),
        }
    }

    /// Returns the renderer; `None` if the sensitivity is guessed.
    fn renderer(&self, device: Device) -> Result<Option<Renderer>> {
        Ok(match self.guess {
            true => None,
            false => Some(Renderer::open(device)?),
        })
    }
}

/// Runs of rows: the first row of each, and the row after its last.
type Runs = Vec<(usize, usize)>;

/// The input of a bucket: numbers of tiles, with the tiles and their rows; or pieces that were scattered.
#[derive(FromPyObject)]
pub(crate) enum Pieces<'py> {
    Rows(Vec<(usize, Named<'py>, Runs)>),
    Scattered(Vec<PyBackedBytes>),
}

/// The source from which a bucket is read.
enum From {
    Rows(Vec<(usize, Tile, Runs)>),
    Scattered(Vec<PyBackedBytes>),
}

impl From {
    fn of(pieces: Pieces<'_>) -> PyResult<Self> {
        Ok(match pieces {
            Pieces::Scattered(pieces) => Self::Scattered(pieces),
            Pieces::Rows(tiles) => {
                let of = |(number, tile, rows): (usize, Named<'_>, Runs)| Ok((number, Tile::of(tile)?, rows));
                Self::Rows(tiles.into_iter().map(of).collect::<PyResult<_>>()?)
            }
        })
    }

    fn bucket(&self, plan: &Plan, number: usize, options: &ReadOptions) -> Result<Bucket> {
        let mut reader = BucketReader::new(plan, number);
        match self {
            Self::Scattered(pieces) => pieces.iter().try_for_each(|piece| reader.add_piece(piece))?,
            Self::Rows(tiles) => {
                for (number, tile, rows) in tiles {
                    tile.with(options, &mut |source| {
                        let add = |&(start, stop): &(usize, usize)| {
                            reader.add(*number, source, start..stop, &Silent)
                        };
                        Ok(rows.iter().try_for_each(add)?)
                    })?;
                }
            }
        }
        Ok(reader.finish())
    }
}

/// Bytes for Python.
type Made = Py<PyBytes>;

fn made(py: Python<'_>, bytes: Vec<u8>) -> Made {
    PyBytes::new(py, &bytes).unbind()
}

/// Reads all `messages`.
fn all<T>(messages: &[impl AsRef<[u8]>], read: impl Fn(&[u8]) -> lexisplat::Result<T>) -> Result<Vec<T>> {
    Ok(messages.iter().map(|message| read(message.as_ref())).collect::<lexisplat::Result<_>>()?)
}

/// Returns the number of Gaussians of a tile, and its warnings.
#[pyfunction]
#[pyo3(signature = (tile, choices, limit))]
pub(crate) fn tile_open(
    py: Python<'_>,
    tile: Named<'_>,
    choices: Choices,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<(usize, u64, Vec<String>)> {
    let options = choices.reading(py, limit)?;
    let tile = Tile::of(tile)?;
    without_gil(py, None, move |_| {
        tile.with(&options, &mut |source| {
            Ok((source.len(), source.source_bytes(), source.warnings().to_vec()))
        })
    })
}

/// Surveys rows of a tile.
#[pyfunction]
#[pyo3(signature = (tile, rows, choices, limit))]
pub(crate) fn tile_survey(
    py: Python<'_>,
    tile: Named<'_>,
    rows: (usize, usize),
    choices: Choices,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<Made> {
    let options = choices.reading(py, limit)?;
    let tile = Tile::of(tile)?;
    let seed = choices.seed;
    let bytes = without_gil(py, None, move |watch| {
        let survey =
            |source: &dyn SplatSource| Ok(Survey::of(source, rows.0..rows.1, seed, watch)?.to_bytes());
        tile.with(&options, &mut { survey })
    })?;
    Ok(made(py, bytes))
}

/// Returns an error for a tile that does not go together with the first tile. `own` and `first` are surveys of a block of
/// each.
#[pyfunction]
pub(crate) fn tile_check(
    py: Python<'_>,
    name: String,
    own: PyBackedBytes,
    first: Option<PyBackedBytes>,
) -> PyResult<()> {
    let read = |bytes: &PyBackedBytes| Survey::from_bytes(bytes);
    let check = || {
        let own = read(&own)?;
        own.check(&name, first.as_ref().map(read).transpose()?.as_ref())
    };
    check().map_err(|error| raise(py, &error.into()))
}

/// Returns the plan of a scene, with its numbers of Gaussians, buckets and groups, and the buckets of each group and of
/// each file.
#[pyfunction]
#[pyo3(signature = (surveys, choices, one_each))]
#[expect(clippy::type_complexity, reason = "what Python unpacks")]
pub(crate) fn tile_plan(
    py: Python<'_>,
    surveys: Vec<(String, Vec<PyBackedBytes>)>,
    choices: Choices,
    one_each: bool,
) -> PyResult<(Py<PyBytes>, usize, Vec<Vec<usize>>, Vec<(usize, usize)>)> {
    let (bytes, gaussians, groups, files) = without_gil(py, None, move |_| {
        let read =
            |(name, blocks): (String, Vec<PyBackedBytes>)| Ok((name, all(&blocks, Survey::from_bytes)?));
        let surveys = surveys.into_iter().map(read).collect::<Result<Vec<_>>>()?;
        let plan = Plan::new(&surveys, &choices.options(), choices.decibels()?, one_each)?;
        let groups = (0..plan.groups()).map(|group| plan.group(group)).collect();
        let files = plan.files().into_iter().map(|file| (file.start, file.end)).collect();
        Ok((plan.to_bytes(), plan.len(), groups, files))
    })?;
    Ok((made(py, bytes), gaussians, groups, files))
}

/// Returns for each bucket the runs of rows that it reads.
#[pyfunction]
#[pyo3(signature = (plan, number, tile, rows, choices, limit))]
pub(crate) fn tile_runs(
    py: Python<'_>,
    plan: PyBackedBytes,
    number: usize,
    tile: Named<'_>,
    rows: (usize, usize),
    choices: Choices,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<(usize, Runs)>> {
    let options = choices.reading(py, limit)?;
    let tile = Tile::of(tile)?;
    without_gil(py, None, move |watch| {
        let plan = Plan::from_bytes(&plan)?;
        let runs =
            tile.with(&options, &mut |source| Ok(plan.runs(number, source, rows.0..rows.1, watch)?))?;
        let pairs = |runs: Vec<std::ops::Range<usize>>| runs.into_iter().map(|r| (r.start, r.end)).collect();
        Ok(runs.into_iter().map(|(bucket, runs)| (bucket, pairs(runs))).collect())
    })
}

/// Returns the rows of a tile in pieces, by bucket.
#[pyfunction]
#[pyo3(signature = (plan, number, tile, rows, choices, limit))]
pub(crate) fn tile_scatter(
    py: Python<'_>,
    plan: PyBackedBytes,
    number: usize,
    tile: Named<'_>,
    rows: (usize, usize),
    choices: Choices,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<(usize, Py<PyBytes>)>> {
    let options = choices.reading(py, limit)?;
    let tile = Tile::of(tile)?;
    let pieces = without_gil(py, None, move |watch| {
        let plan = Plan::from_bytes(&plan)?;
        tile.with(&options, &mut |source| Ok(plan.scatter(number, source, rows.0..rows.1, watch)?))
    })?;
    Ok(pieces.into_iter().map(|(bucket, piece)| (bucket, made(py, piece))).collect())
}

/// Measures the sensitivity of a bucket. Returns the statistics, the results for its Gaussians, the name of the GPU that drew,
/// and the result of refining as JSON.
#[pyfunction]
#[pyo3(signature = (plan, bucket, pieces, choices, limit))]
pub(crate) fn tile_look(
    py: Python<'_>,
    plan: PyBackedBytes,
    bucket: usize,
    pieces: Pieces<'_>,
    choices: Choices,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<(Made, Made, Option<String>, Option<String>)> {
    let options = choices.reading(py, limit)?;
    let (from, device) = (From::of(pieces)?, device(py, &choices.device)?);
    let (statistics, looked, gpu, refined) = without_gil(py, None, move |watch| {
        let plan = Plan::from_bytes(&plan)?;
        let bucket = from.bucket(&plan, bucket, &options)?;
        let mut renderer = choices.renderer(device)?;
        let (asked, refine) = (choices.decibels()?, choices.effort()?);
        let (statistics, looked, refined) =
            tiles::look(&plan, &bucket, renderer.as_mut(), asked, refine, watch)?;
        let gpu = renderer.filter(Renderer::is_gpu).map(|renderer| renderer.name().to_owned());
        Ok((statistics.to_bytes(), looked.to_bytes(), gpu, refined))
    })?;
    let refined = refined.map(|refined| json(py, &refined)).transpose()?;
    Ok((made(py, statistics), made(py, looked), gpu, refined))
}

/// Returns the steps of a scene.
#[pyfunction]
pub(crate) fn tile_steps(py: Python<'_>, plan: PyBackedBytes, buckets: Vec<PyBackedBytes>) -> PyResult<Made> {
    let bytes = without_gil(py, None, move |_| {
        let statistics = all(&buckets, LookStatistics::from_bytes)?;
        Ok(Steps::new(&Plan::from_bytes(&plan)?, &statistics)?.to_bytes())
    })?;
    Ok(made(py, bytes))
}

/// The sample of a group of buckets. It stays in the process in which it was drawn.
#[pyclass(module = "lexisplat._native")]
pub(crate) struct TileSample {
    plan: Plan,
    sample: Sample,
}

#[pymethods]
impl TileSample {
    #[new]
    fn new(py: Python<'_>, plan: PyBackedBytes) -> PyResult<Self> {
        let plan = Plan::from_bytes(&plan).map_err(|error| raise(py, &error.into()))?;
        Ok(Self { plan, sample: Sample::new() })
    }

    /// Adds the next bucket of the group.
    #[pyo3(signature = (bucket, pieces, looked, choices, limit))]
    fn add(
        &mut self,
        py: Python<'_>,
        bucket: usize,
        pieces: Pieces<'_>,
        looked: PyBackedBytes,
        choices: Choices,
        limit: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        let options = choices.reading(py, limit)?;
        let from = From::of(pieces)?;
        without_gil(py, None, |_| {
            let bucket = from.bucket(&self.plan, bucket, &options)?;
            Ok(self.sample.add(&self.plan, &bucket, &Looked::from_bytes(&looked)?)?)
        })
    }

    /// Returns sums over the sample.
    fn statistics(&self, py: Python<'_>, steps: PyBackedBytes) -> PyResult<Made> {
        let bytes = without_gil(py, None, |_| {
            Ok(self.sample.statistics(&self.plan, &Steps::from_bytes(&steps)?)?.to_bytes())
        })?;
        Ok(made(py, bytes))
    }
}

/// Returns the data with which all buckets are coded.
#[pyfunction]
pub(crate) fn tile_coding(
    py: Python<'_>,
    plan: PyBackedBytes,
    steps: PyBackedBytes,
    groups: Vec<PyBackedBytes>,
) -> PyResult<Made> {
    let bytes = without_gil(py, None, move |watch| {
        let (plan, steps) = (Plan::from_bytes(&plan)?, Steps::from_bytes(&steps)?);
        let groups = all(&groups, SampleStatistics::from_bytes)?;
        Ok(Coding::new(&plan, &steps, &groups, watch)?.to_bytes())
    })?;
    Ok(made(py, bytes))
}

/// Returns how often each symbol occurs in a bucket, and the bucket coded with tables of its own.
#[pyfunction]
#[pyo3(signature = (plan, coding, bucket, pieces, looked, choices, limit))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn tile_code(
    py: Python<'_>,
    plan: PyBackedBytes,
    coding: PyBackedBytes,
    bucket: usize,
    pieces: Pieces<'_>,
    looked: PyBackedBytes,
    choices: Choices,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<(Made, Made)> {
    let options = choices.reading(py, limit)?;
    let from = From::of(pieces)?;
    let (counts, coded) = without_gil(py, None, move |watch| {
        let (plan, coding) = (Plan::from_bytes(&plan)?, Coding::from_bytes(&coding)?);
        let (bucket, looked) = (from.bucket(&plan, bucket, &options)?, Looked::from_bytes(&looked)?);
        let refine = choices.effort()?;
        let (counts, coded) = tiles::code(&plan, &coding, &bucket, &looked, choices.guess, refine, watch)?;
        Ok((counts.to_bytes(), coded.to_bytes()))
    })?;
    Ok((made(py, counts), made(py, coded)))
}

/// Returns the tables with which all buckets are coded.
#[pyfunction]
pub(crate) fn tile_tables(py: Python<'_>, counts: Vec<PyBackedBytes>) -> PyResult<Made> {
    let bytes =
        without_gil(py, None, move |_| Ok(Tables::new(&all(&counts, Counts::from_bytes)?)?.to_bytes()))?;
    Ok(made(py, bytes))
}

/// Returns a bucket coded with the common tables.
#[pyfunction]
pub(crate) fn tile_finish(
    py: Python<'_>,
    plan: PyBackedBytes,
    coding: PyBackedBytes,
    tables: PyBackedBytes,
    coded: PyBackedBytes,
) -> PyResult<Made> {
    let bytes = without_gil(py, None, move |_| {
        let (plan, coding) = (Plan::from_bytes(&plan)?, Coding::from_bytes(&coding)?);
        let tables = Tables::from_bytes(&tables)?;
        Ok(Coded::from_bytes(&coded)?.with_tables(&plan, &coding, &tables)?.to_bytes())
    })?;
    Ok(made(py, bytes))
}

/// Writes file `file` of the coded buckets that `next` returns one after the other. `refined` holds the results of refining that
/// [`tile_look`] returned. Returns the report as JSON.
#[pyfunction]
#[pyo3(signature = (plan, coding, tables, file, next, counts, refined, path, *, source_bytes, overwrite, guess, gpu))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn tile_assemble(
    py: Python<'_>,
    plan: PyBackedBytes,
    coding: PyBackedBytes,
    tables: PyBackedBytes,
    file: usize,
    next: &Bound<'_, PyAny>,
    counts: Vec<PyBackedBytes>,
    refined: Vec<String>,
    path: PathBuf,
    source_bytes: u64,
    overwrite: bool,
    guess: bool,
    gpu: Option<String>,
) -> PyResult<String> {
    let fail = |error: lexisplat::Error| raise(py, &error.into());
    let plan = Plan::from_bytes(&plan).map_err(fail)?;
    let coding = Coding::from_bytes(&coding).map_err(fail)?;
    let tables = Tables::from_bytes(&tables).map_err(fail)?;
    let counts = all(&counts, Counts::from_bytes).map_err(|error| raise(py, &error))?;
    let results = all(&refined, |text| {
        serde_json::from_slice::<RefineReport>(text)
            .map_err(|error| lexisplat::Error::parameter("refined", error, "results of refining"))
    });
    let results = results.map_err(|error| raise(py, &error))?;
    output(&path, overwrite).check().map_err(fail)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut assembly = Assembly::new(&plan, &coding, &tables, file, folder).map_err(fail)?;
    for bucket in next.try_iter()? {
        let bucket: PyBackedBytes = bucket?.extract()?;
        py.detach(|| assembly.push(Coded::from_bytes(&bucket)?)).map_err(fail)?;
    }
    let done = without_gil(py, None, move |watch| {
        Ok(assembly.finish(&counts, gpu, output(&path, overwrite), watch)?)
    })?;
    let mut report = CompressionReport::in_parts(&done, guess);
    report.source_bytes = source_bytes;
    report.refined = RefineReport::of_parts(results);
    json(py, &report)
}

/// Returns an error for choices that are out of range, before any work.
#[pyfunction]
#[pyo3(signature = (choices, limit))]
pub(crate) fn tile_choices(
    py: Python<'_>,
    choices: Choices,
    limit: Option<&Bound<'_, PyDict>>,
) -> PyResult<()> {
    choices.reading(py, limit)?;
    device(py, &choices.device)?;
    let check = || {
        let (psnr, refine) = (("psnr", choices.psnr.is_some()), ("refine", choices.effort()?.is_some()));
        refuse(&[("preset", choices.preset.is_some())], &[psnr])?;
        refuse(&[("guess", choices.guess)], &[psnr, refine])?;
        let keeping = [
            ("keep_all", choices.keep_all),
            ("keep_order", choices.keep_order),
            ("tol", choices.tol.is_some()),
        ];
        refuse(&[refine], &keeping)?;
        choices.decibels()?;
        Ok(choices.options().check()?)
    };
    check().map_err(|error: Error| raise(py, &error))
}
