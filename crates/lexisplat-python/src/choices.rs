//! Compression, with its choices by name.

use std::path::PathBuf;
use std::sync::Arc;

use lexisplat::packed::{LOD_FIRST_LAYER, PackOptions, Preset};
use lexisplat::{
    CompressOptions, DEFAULT_TOLERANCE, Dictionary, Layout, Limits, Pursuit, ShDegree, SplatSource, Splats,
    lexi,
};
use lexisplat_compress::{
    Compression, CompressionReport, Error, Packing, Quality, Refine, Target, Viewpoints, WithView,
    choose_layout, read_beside,
};
use lexisplat_render::{Device, Pose, ViewSet};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::finite_from_python;
use crate::bytes::{Bytes, Given};
use crate::cameras::{CameraTuple, cameras};
use crate::draw::device;
use crate::errors::{Result, parameter, raise};
use crate::files::{json, read_options, with_source};
use crate::scene::Scene;
use crate::work::{Watch, without_gil};

/// The choices with their names in Python. `None` means the library's default.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Choices {
    preset: Option<String>,
    psnr: Option<f64>,
    min_psnr: Option<f64>,
    size: Option<u64>,
    ratio: Option<f64>,
    tol: Option<f64>,
    max_nonzeros: Option<u8>,
    atoms: Option<usize>,
    pursuit: Option<String>,
    layout: Option<String>,
    sample: Option<usize>,
    seed: u64,
    cameras: Option<Vec<CameraTuple>>,
    /// File of the scene, if cameras that lie beside it should be used.
    beside: Option<PathBuf>,
    views: Option<String>,
    /// The first view: `auto`, a link, or none.
    view: Option<String>,
    keep_order: bool,
    lod: bool,
    keep_all: bool,
    max_gaussians: Option<usize>,
    /// `quick`, `thorough` or minutes.
    refine: Option<String>,
    guess: bool,
    memory: Option<u64>,
    device: String,
}

/// Name in messages of a file that was made here.
const MADE: &str = "scene.lexi";

/// The name of a choice, and whether the choice was made.
type Named = (&'static str, bool);

/// Returns the name of the first choice that was made.
fn made(choices: &[Named]) -> Option<&'static str> {
    choices.iter().find(|choice| choice.1).map(|choice| choice.0)
}

/// Returns an error if a choice of each list was made.
pub(crate) fn refuse(a: &[Named], b: &[Named]) -> Result<()> {
    match (made(a), made(b)) {
        (Some(a), Some(b)) => Err(Error::parameter(b, "given", format!("not together with {a}"))),
        _ => Ok(()),
    }
}

/// Returns the effort of refining: `quick`, `thorough` or minutes.
pub(crate) fn effort(refine: Option<&str>) -> Result<Option<Refine>> {
    refine.map(str::parse).transpose()
}

impl Choices {
    /// Returns the choices that only layouts with exact geometry have.
    fn exact_only(&self, has_dictionary: bool) -> [Named; 4] {
        [
            ("max_nonzeros", self.max_nonzeros.is_some()),
            ("pursuit", self.pursuit.is_some()),
            ("dictionary", has_dictionary),
            ("sample", self.sample.is_some()),
        ]
    }

    /// Returns the targets. At most one may be chosen.
    fn goals(&self) -> [Named; 5] {
        [
            ("preset", self.preset.is_some()),
            ("psnr", self.psnr.is_some()),
            ("min_psnr", self.min_psnr.is_some()),
            ("size", self.size.is_some()),
            ("ratio", self.ratio.is_some()),
        ]
    }

    /// Returns the choices that only packed files have, without the targets.
    fn packed_only(&self) -> [Named; 8] {
        [
            ("guess", self.guess),
            ("cameras", self.cameras.is_some()),
            ("views", self.views.is_some()),
            ("keep_order", self.keep_order),
            ("keep_all", self.keep_all),
            ("lod", self.lod),
            ("max_gaussians", self.max_gaussians.is_some()),
            ("refine", self.refine.is_some()),
        ]
    }

    /// Returns an error for choices that do not go together.
    fn check(&self, has_dictionary: bool) -> Result<()> {
        let goals = self.goals();
        (1..goals.len()).try_for_each(|k| refuse(&goals[..k], &goals[k..=k]))?;
        let [_, psnr, min_psnr, size, ratio] = goals;
        let [guess, cameras, views, keep_order, keep_all, _, max_gaussians, refine] = self.packed_only();
        refuse(&[guess], &[psnr, min_psnr, size, ratio, cameras, views, max_gaussians, refine])?;
        refuse(&[cameras], &[views])?;
        let keeping = [keep_all, keep_order, ("tol", self.tol.is_some())];
        refuse(&[max_gaussians], &keeping)?;
        refuse(&[refine], &keeping)?;
        refuse(&[("dictionary", has_dictionary)], &[("atoms", self.atoms.is_some())])
    }

    /// Returns the chosen layout, or else the layout that the other choices need, as in the program.
    fn chosen_layout(&self, has_dictionary: bool) -> Result<Layout> {
        let packed = made(&self.goals()).or(made(&self.packed_only()));
        let asked = self.layout.as_deref().map(str::parse).transpose()?;
        choose_layout(asked, self.tol.is_some(), made(&self.exact_only(has_dictionary)), packed)
    }

    /// Returns the library's compression for these choices.
    fn compression(self, device: Device, dictionary: Option<Dictionary>) -> Result<Compression> {
        self.check(dictionary.is_some())?;
        let layout = self.chosen_layout(dictionary.is_some())?;
        if layout != Layout::Packed {
            return Ok(Compression::Exact(self.exact(layout, dictionary)?, layout.codes()));
        }
        let options = pack_options(self.tol, self.atoms, self.keep_order, self.keep_all, self.lod, self.seed);
        let preset = preset(self.preset.as_deref())?;
        if self.guess {
            return Ok(Compression::Guessed(preset, options));
        }
        let target = Target::chosen(self.psnr, self.min_psnr, self.size, self.ratio);
        let quality = target.map_or(Quality::Preset(preset), Quality::Target);
        let mut packing = Packing::new(quality)
            .with_options(options)
            .with_gpu(device.open_gpu()?)
            .with_viewpoints(self.views.as_deref().map_or(Ok(Viewpoints::Auto), views)?)
            .with_max_gaussians(self.max_gaussians)
            .with_refine(effort(self.refine.as_deref())?);
        if let Some(bytes) = self.memory {
            packing = packing.with_memory(bytes);
        }
        if let Some(views) = self.cameras {
            packing = packing.with_cameras(cameras(views, None));
        }
        Ok(packing.into())
    }

    fn exact(self, layout: Layout, dictionary: Option<Dictionary>) -> Result<CompressOptions> {
        let mut options = CompressOptions::default();
        options.tolerance = self.tol.or_else(|| self.max_nonzeros.is_none().then_some(DEFAULT_TOLERANCE));
        options.max_nonzeros = self.max_nonzeros;
        options.atoms = self.atoms;
        options.pursuit = self.pursuit.map_or(Ok(options.pursuit), |name| name.parse::<Pursuit>())?;
        options.values = layout.values();
        options.sample = self.sample.unwrap_or(options.sample);
        options.seed = self.seed;
        options.dictionary = dictionary;
        Ok(options)
    }
}

/// Returns the viewpoints of generated views by their name.
fn views(name: &str) -> Result<Viewpoints> {
    name.parse().map_err(|error| match error {
        Error::Parameter { value, expected, .. } => Error::parameter("views", value, expected),
        error => error,
    })
}

/// Returns the options of the codec that all packed files have.
pub(crate) fn pack_options(
    tol: Option<f64>,
    atoms: Option<usize>,
    keep_order: bool,
    keep_all: bool,
    lod: bool,
    seed: u64,
) -> PackOptions {
    PackOptions::default()
        .with_tolerance(tol)
        .with_atoms(atoms)
        .with_keep_order(keep_order)
        .with_keep_all(keep_all)
        .with_lod(lod.then_some(LOD_FIRST_LAYER))
        .with_seed(seed)
}

/// Returns the preset of this name; `None` gives the default preset.
pub(crate) fn preset(name: Option<&str>) -> Result<Preset> {
    Ok(name.map_or(Ok(Preset::default()), str::parse)?)
}

/// Returns a dictionary from an array of (atoms, coefficients), from a file, or from the bytes of a file.
fn dictionary_of(given: &Bound<'_, PyAny>) -> PyResult<Option<Dictionary>> {
    let py = given.py();
    let fail = |error: lexisplat::Error| raise(py, &error.into());
    if given.is_none() {
        return Ok(None);
    }
    if let Ok(file) = given.extract::<Given>() {
        let (name, limits) = (file.name(), Limits::default());
        let bytes = file.bytes(&limits).map_err(|error| raise(py, &error))?;
        return lexi::read_dictionary_bytes(&name, bytes.as_ref(), &limits).map(Some).map_err(fail);
    }
    let atoms: PyReadonlyArray2<'_, f32> = given.extract()?;
    let dim = atoms.shape()[1];
    let degree = (1..=4).filter_map(|degree| ShDegree::new(degree).ok()).find(|degree| degree.rest() == dim);
    let Some(degree) = degree else {
        return Err(parameter(
            py,
            "dictionary",
            format!("{:?}", atoms.shape()),
            "rows of 9, 24, 45 or 72 values",
        ));
    };
    let atoms = atoms.as_array().iter().copied().collect();
    Dictionary::new(degree, atoms).map(Some).map_err(fail)
}

/// The scene to compress.
enum Source {
    Splats(Box<Splats>),
    File(Given),
}

/// Compresses arrays or a file by `choices`, in memory. Returns the compressed scene, and messages about Gaussians that
/// were left out of arrays.
#[pyfunction]
#[pyo3(signature = (source, choices, *, dictionary, drop_invalid, drop_extras, limit, progress))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn compress(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    choices: Choices,
    dictionary: &Bound<'_, PyAny>,
    drop_invalid: bool,
    drop_extras: bool,
    limit: Option<&Bound<'_, PyDict>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Scene, Vec<String>)> {
    let mut told = Vec::new();
    let dictionary = dictionary_of(dictionary)?;
    let device = device(py, &choices.device)?;
    let options = read_options(py, drop_invalid, drop_extras, limit)?;
    let source = match source.extract::<Given>() {
        Ok(file) => Source::File(file),
        Err(_) => Source::Splats(Box::new(finite_from_python(source, drop_invalid, &mut told)?)),
    };
    let (bytes, report, unused) = without_gil(py, progress, move |watch| {
        let views = choices.cameras.clone();
        let view = FirstView::of(choices.view.as_deref())?;
        let beside = choices.beside.clone();
        let compression = choices.compression(device, dictionary)?;
        let beside =
            beside.filter(|_| matches!(compression, Compression::Packed(_))).as_deref().and_then(read_beside);
        let (bytes, report) = match source {
            Source::Splats(splats) => run(&compression, views, beside.as_ref(), view, &*splats, watch)?,
            Source::File(given) => {
                let (name, whole) = (given.name(), |bytes| compression.holds_whole(bytes, beside.is_some()));
                with_source(given, &name, &options, whole, watch, &mut |source| {
                    run(&compression, views.clone(), beside.as_ref(), view, source, watch)
                })?
            }
        };
        let unused = beside.filter(|_| report.reached.as_ref().is_some_and(|reached| !reached.cameras));
        Ok((bytes, report, unused.map(|(path, _)| path)))
    })?;
    told.extend(unused.map(|path| {
        let path = path.display();
        format!("the cameras of {path} do not seem to belong to the scene and were not used; cameras=\"{path}\" uses them all the same")
    }));
    let report = json(py, &report)?;
    let scene = Scene::new(MADE.to_owned(), Bytes::Own(Arc::new(bytes)), options.limits, Some(report));
    Ok((scene, told))
}

/// Compresses `source`. The cameras `views`, which are also those of `compression`, and the cameras beside the scene are
/// in the world.
fn run(
    compression: &Compression,
    views: Option<Vec<CameraTuple>>,
    beside: Option<&(PathBuf, ViewSet)>,
    view: FirstView,
    source: &dyn SplatSource,
    watch: &Watch,
) -> Result<(Vec<u8>, CompressionReport)> {
    let mut file = Vec::new();
    let mut compression = compression.clone();
    let offset = source.empty().meta.offset;
    if let (Some(views), offset @ Some(_)) = (views, offset) {
        compression = compression.with_cameras(cameras(views, offset));
    }
    if let Some((_, set)) = beside {
        compression = compression.with_likely_cameras(set.clone().relative_to(offset).cameras);
    }
    let report = match view {
        FirstView::Best => compression.run(source, &mut file, watch)?,
        FirstView::Given(view) => compression.run(&WithView::new(source, view), &mut file, watch)?,
    };
    Ok((file, report))
}

/// The choice of the view from which viewers show a scene first.
#[derive(Clone, Copy)]
enum FirstView {
    /// The best of the cameras or of generated views.
    Best,
    /// This view, or none.
    Given(Option<Pose>),
}

impl FirstView {
    /// Returns the choice that `text` names: `auto`, a link of a viewer, or none.
    fn of(text: Option<&str>) -> Result<Self> {
        match text {
            Some("auto") => Ok(Self::Best),
            None => Ok(Self::Given(None)),
            Some(link) => match Pose::from_link(link) {
                Some(pose) => Ok(Self::Given(Some(pose))),
                None => Err(Error::parameter("view", link, "'auto', a link that a viewer copied, or None")),
            },
        }
    }
}
