//! The two models: read and compressed on worker threads.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};

use lexisplat::packed::Packed;
use lexisplat::ply::{Dialect, ReadOptions};
use lexisplat::{CodeLayout, CompressOptions, Layout, Limits, Model, Progress, ShDegree, Splats, Stage};
use lexisplat_eval::{Compression, Loaded, Packing, SceneFile, SplitFilter, choose_views};
use lexisplat_render::{Camera, bulk};

use crate::command::{Quality, Which};
use crate::error::{Error, Result};

/// Bytes of a value in a PLY, and values of a Gaussian in INRIA's layout besides SH-rest: position,
/// normal, base colour, opacity, scales, rotation.
const PLY_VALUE: u64 = 4;
const PLY_VALUES: u64 = 3 + 3 + 3 + 1 + 3 + 4;

/// An open model, with what the panel says about it.
#[derive(Debug)]
pub(crate) struct Open {
    /// Different for every model opened.
    pub(crate) id: u64,
    pub(crate) scene: SceneFile,
    /// Where it came from, if it is a file.
    pub(crate) path: Option<PathBuf>,
    pub(crate) layout: String,
    /// What the file promises, if anything.
    pub(crate) promise: Option<String>,
    /// Cameras around it, for scenes without their own.
    pub(crate) orbit: Vec<Camera>,
    /// Centre and radius of where most of it is, in world units.
    pub(crate) bulk: ([f64; 3], f64),
}

/// How many views an orbit has, and how wide they are at most, in pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OrbitSize {
    pub(crate) views: u16,
    pub(crate) max_width: u32,
}

impl Open {
    fn new(id: u64, scene: SceneFile, path: Option<PathBuf>, size: OrbitSize) -> Result<Self> {
        let geometry = scene.scene().geometry();
        let orbit = choose_views(None, SplitFilter::All, size.views, size.max_width, geometry)?;
        let bulk = bulk(geometry);
        let (layout, promise) = match &scene.loaded {
            Loaded::Ply(read) => (dialect(read.source.dialect), None),
            Loaded::Lexi(model, packed) => {
                let exact = Layout::of(CodeLayout::Compact, model.codes().values().value_type());
                let layout = if packed.is_some() { Layout::Packed } else { exact };
                (layout.to_string(), promise(model, packed.as_deref()))
            }
        };
        Ok(Self { id, scene, path, layout, promise, orbit, bulk })
    }

    /// The name without folders.
    pub(crate) fn short_name(&self) -> String {
        let name = Path::new(&self.scene.name).file_name();
        name.map_or_else(|| self.scene.name.clone(), |n| n.to_string_lossy().into_owned())
    }

    pub(crate) fn degree(&self) -> ShDegree {
        self.scene.scene().degree()
    }

    pub(crate) fn gaussians(&self) -> usize {
        self.scene.scene().len()
    }

    /// The scene with dense SH, if it is a PLY.
    pub(crate) fn splats(&self) -> Option<&Splats> {
        match &self.scene.loaded {
            Loaded::Ply(read) => Some(&read.splats),
            Loaded::Lexi(..) => None,
        }
    }

    /// How many times smaller it is than `original`, or than itself as a PLY in INRIA's layout.
    pub(crate) fn ratio(&self, original: Option<&Self>) -> Option<(f64, &'static str)> {
        if matches!(self.scene.loaded, Loaded::Ply(_)) || self.scene.bytes == 0 {
            return None;
        }
        // Of another scene, that is of many fewer or more Gaussians, the size says nothing.
        let count = self.gaussians();
        let is_source = |other: &Self| {
            other.splats().is_some() && (count..=count.saturating_mul(2)).contains(&other.gaussians())
        };
        let (bytes, of) = match original {
            Some(other) if is_source(other) => (other.scene.bytes, "than the first"),
            _ => {
                let values = PLY_VALUES + self.degree().rest() as u64;
                (count as u64 * values * PLY_VALUE, "than as a PLY")
            }
        };
        Some((bytes as f64 / self.scene.bytes as f64, of))
    }
}

/// A PLY by its probable writer.
fn dialect(dialect: Dialect) -> String {
    match dialect {
        Dialect::Other => "PLY".to_owned(),
        writer => format!("PLY, {writer:?}"),
    }
}

/// What a compressed file says it keeps, in a line.
fn promise(model: &Model, packed: Option<&Packed>) -> Option<String> {
    let record = model.record();
    let mut parts = Vec::new();
    if let Some(p) = packed.and_then(|packed| packed.head().target()) {
        parts.push(format!("{:.2} dB mean, {:.2} dB worst of {} views", p.mean_psnr, p.min_psnr, p.views));
    }
    match (record.tolerance, record.max_nonzeros) {
        (Some(tolerance), None) => {
            parts.push(format!("SH within {tolerance} (is {:.4})", record.max_residual));
        }
        (Some(_), Some(most)) => parts.push(format!("at most {most} nonzeros")),
        _ => {}
    }
    if packed.is_none() {
        parts.push("geometry exact".to_owned());
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// How far work on a model is.
#[derive(Debug, Default)]
pub(crate) struct Step {
    label: String,
    done: u64,
    total: u64,
}

/// Progress of one job, told by its thread and shown by the panel.
#[derive(Debug, Default)]
pub(crate) struct Gauge(Mutex<Step>);

impl Gauge {
    fn start(&self, label: &str, total: u64) {
        *self.lock() = Step { label: label.to_owned(), done: 0, total };
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Step> {
        // A thread that panicked while it held this left at worst an old number.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is being done, and the share that is, 0 to 1, if known.
    pub(crate) fn read(&self) -> (String, Option<f32>) {
        let step = self.lock();
        #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
        let share = (step.total > 0).then(|| (step.done as f64 / step.total as f64).min(1.0) as f32);
        (step.label.clone(), share)
    }
}

impl Progress for Gauge {
    fn begin(&self, stage: Stage, total: u64) {
        let label = match stage {
            Stage::Draw => "looking",
            Stage::Learn => "learning",
            Stage::Code => "coding",
            Stage::Read => "reading",
            Stage::Write => "writing",
            _ => "working",
        };
        self.start(label, total);
    }

    fn advance(&self, units: u64) {
        let mut step = self.lock();
        step.done = step.done.saturating_add(units);
    }
}

/// Work on one model.
#[derive(Debug)]
pub(crate) struct Work {
    /// Different for every job; a model that comes from another one is out of date.
    pub(crate) id: u64,
    pub(crate) name: String,
    pub(crate) gauge: Arc<Gauge>,
}

/// What became of a job.
#[derive(Debug)]
pub(crate) struct Finished {
    pub(crate) id: u64,
    pub(crate) which: Which,
    pub(crate) result: Result<Open>,
}

/// Tells about finished jobs, and wakes the window for it.
#[derive(Clone)]
pub(crate) struct Bell {
    pub(crate) sender: Sender<Finished>,
    pub(crate) wake: Arc<dyn Fn() + Send + Sync>,
}

/// Starts reading `path`, which may ask for `limits`, as `which`.
pub(crate) fn open(
    id: u64,
    which: Which,
    path: PathBuf,
    limits: Limits,
    size: OrbitSize,
    bell: Bell,
) -> Work {
    let gauge = Arc::new(Gauge::default());
    gauge.start("reading", 0);
    let name = path.display().to_string();
    spawn(id, which, bell, move || {
        let scene = SceneFile::read(&path, &ReadOptions { limits, ..ReadOptions::default() })?;
        Open::new(id, scene, Some(path), size)
    });
    Work { id, name, gauge }
}

/// Starts compressing `original`, which has dense SH, to the second model. `cameras` say what shows, if
/// there are at least two.
pub(crate) fn compress_to(
    id: u64,
    original: Arc<Open>,
    quality: Quality,
    cameras: Option<Vec<Camera>>,
    size: OrbitSize,
    bell: Bell,
) -> Work {
    let gauge = Arc::new(Gauge::default());
    let name = format!("{} ({quality})", original.short_name());
    let (told, title) = (Arc::clone(&gauge), name.clone());
    spawn(id, Which::Second, bell, move || {
        let Some(splats) = original.splats() else {
            let expected = "a PLY: compressed scenes are not compressed again";
            return Err(lexisplat::Error::parameter("scene", &original.scene.name, expected).into());
        };
        let scene = compressed(splats, &title, quality, cameras.as_deref(), &told)?;
        Open::new(id, scene, None, size)
    });
    Work { id, name, gauge }
}

/// `splats` as `lexisplat compress` makes them with this preset or tolerance.
fn compressed(
    splats: &Splats,
    name: &str,
    quality: Quality,
    cameras: Option<&[Camera]>,
    gauge: &Gauge,
) -> Result<SceneFile> {
    let compression: Compression = match (quality, cameras) {
        (Quality::Preset(preset), Some(cameras)) => {
            Packing::new(preset).with_cameras(cameras.to_vec()).into()
        }
        (Quality::Preset(preset), None) => Packing::new(preset).into(),
        (Quality::Tolerance(tolerance), _) => {
            let mut options = CompressOptions::default();
            options.tolerance = Some(tolerance);
            options.into()
        }
    };
    let mut file = Vec::new();
    compression.run(splats, &mut file, gauge)?;
    gauge.start("unpacking", 0);
    Ok(SceneFile::read_bytes(name, &file, &ReadOptions::default())?)
}

fn spawn(id: u64, which: Which, bell: Bell, work: impl FnOnce() -> Result<Open> + Send + 'static) {
    let again = bell.clone();
    let tell = move |bell: &Bell, result| {
        // Nobody listens when the window is gone.
        let _ = bell.sender.send(Finished { id, which, result });
        (bell.wake)();
    };
    let started = std::thread::Builder::new().name("model".into()).spawn(move || tell(&bell, work()));
    if let Err(error) = started {
        tell(&again, Err(Error::Window(format!("cannot start a thread: {error}"))));
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::packed::Preset;
    use lexisplat::{lexi, ply};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    const SIZE: OrbitSize = OrbitSize { views: 3, max_width: 100 };

    #[test]
    fn compressing_makes_what_a_file_would_hold() {
        let splats = scene(&SampleOptions::new(600, 0));
        for quality in [Quality::Preset(Preset::Small), Quality::Tolerance(0.2)] {
            let made = compressed(&splats, "made", quality, None, &Gauge::default()).unwrap();
            let Loaded::Lexi(model, packed) = &made.loaded else { panic!("a model") };
            let mut bytes = Vec::new();
            match packed {
                Some(packed) => {
                    lexi::LexiWriter::packed(packed).write(&mut bytes, &lexisplat::Silent).unwrap()
                }
                None => lexi::write(&mut bytes, model).unwrap(),
            };
            assert_eq!(made.bytes, bytes.len() as u64, "{quality}");
            let open = Open::new(1, made, None, SIZE).unwrap();
            assert_eq!(open.promise.is_some(), matches!(quality, Quality::Tolerance(_)), "{quality}");
            assert!(open.ratio(None).is_some_and(|(ratio, _)| ratio > 2.0));
        }
    }

    #[test]
    fn files_are_opened_and_failures_told() {
        let folder = tempfile::tempdir().unwrap();
        let (good, bad) = (folder.path().join("good.ply"), folder.path().join("bad.ply"));
        ply::write(&good, &scene(&SampleOptions::new(20, 0))).unwrap();
        std::fs::write(&bad, "nonsense").unwrap();
        let (sender, finished) = std::sync::mpsc::channel();
        let bell = Bell { sender, wake: Arc::new(|| ()) };
        open(7, Which::Second, good, Limits::default(), SIZE, bell.clone());
        let told = finished.recv().unwrap();
        let model = told.result.unwrap();
        assert_eq!((told.id, told.which, model.gaussians()), (7, Which::Second, 20));
        assert_eq!(model.short_name(), "good.ply");
        assert!(model.ratio(None).is_none());
        assert_eq!((model.orbit.len(), model.orbit[0].width), (3, 100));
        open(8, Which::First, bad, Limits::default(), SIZE, bell.clone());
        assert!(finished.recv().unwrap().result.is_err());
        let original = Arc::new(model);
        compress_to(9, original, Quality::Tolerance(-1.0), None, SIZE, bell);
        assert!(finished.recv().unwrap().result.is_err(), "a tolerance out of range");
    }
}
