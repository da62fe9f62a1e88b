//! The two models. They are read and compressed on threads of their own.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};

use lexisplat::packed::Packed;
use lexisplat::ply::{Dialect, ReadOptions};
use lexisplat::simd::Simd;
use lexisplat::{CodeLayout, CompressOptions, Layout, Limits, Model, Progress, ShDegree, Splats, Stage};
use lexisplat_compress::{Compression, Packing, SplitFilter, choose_views};
use lexisplat_eval::{Loaded, SceneFile};
use lexisplat_render::{Camera, bulk, near_plane};

use crate::command::{Quality, Slot};
use crate::error::{Error, Result};

/// Number of bytes of a value in a PLY.
const PLY_VALUE: u64 = 4;
/// Number of values of a Gaussian in INRIA's layout, without SH-rest: position, normal, base colour, opacity, scales,
/// rotation.
const PLY_VALUES: u64 = 3 + 3 + 3 + 1 + 3 + 4;

/// An open model, with the facts about it that the panel shows.
#[derive(Debug)]
pub(crate) struct OpenModel {
    /// Id, unique among all opened models.
    pub(crate) id: u64,
    pub(crate) scene: SceneFile,
    /// The file that the model was read from, if there is one.
    pub(crate) path: Option<PathBuf>,
    pub(crate) layout: String,
    /// The guarantees of the file, if there are any.
    pub(crate) guarantee: Option<String>,
    /// An orbit of generated cameras, for scenes without a camera file.
    pub(crate) orbit: Vec<Camera>,
    /// Centre and radius of a ball that holds most Gaussians, in world units.
    pub(crate) bulk: ([f64; 3], f64),
    /// Distance of the near plane of free views, in world units.
    pub(crate) near: f32,
}

/// Number of views of a generated orbit, and their largest width in pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OrbitSize {
    pub(crate) views: u16,
    pub(crate) max_width: u32,
    /// Distance of the near plane, in world units. `None` chooses a distance that suits the scene's size.
    pub(crate) near: Option<f32>,
}

impl OpenModel {
    fn new(id: u64, scene: SceneFile, path: Option<PathBuf>, size: OrbitSize) -> Result<Self> {
        let geometry = scene.scene().geometry();
        let mut orbit = choose_views(None, SplitFilter::All, size.views, size.max_width, geometry)?;
        let (bulk, near) = (bulk(geometry), size.near.unwrap_or_else(|| near_plane(geometry)));
        orbit.iter_mut().for_each(|camera| camera.near = near);
        let (layout, guarantee) = match &scene.loaded {
            Loaded::Ply(read) => (dialect(read.summary.dialect), None),
            Loaded::Other(read) => (read.kind.to_string(), None),
            Loaded::Lexi(model, packed) => {
                let exact = Layout::of(CodeLayout::Compact, model.codes().values().value_type());
                let layout = if packed.is_some() { Layout::Packed } else { exact };
                (layout.to_string(), guarantee(model, packed.as_deref()))
            }
        };
        Ok(Self { id, scene, path, layout, guarantee, orbit, bulk, near })
    }

    /// Returns the name without folders.
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

    /// Returns the scene with dense SH; `None` for a .lexi.
    pub(crate) fn splats(&self) -> Option<&Splats> {
        self.scene.splats()
    }

    /// Returns the ratio of the size of `original` to the size of this compressed model, and a text that describes it. If
    /// `original` cannot be the source of this model, the size of the model's own PLY in INRIA's layout is used instead.
    pub(crate) fn ratio(&self, original: Option<&Self>) -> Option<(f64, &'static str)> {
        if matches!(self.scene.loaded, Loaded::Ply(_)) || self.scene.bytes == 0 {
            return None;
        }
        // Pruning may halve the number of Gaussians. With fewer, `original` counts as another scene.
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

/// Returns the name of a PLY's dialect, for the panel.
fn dialect(dialect: Dialect) -> String {
    match dialect {
        Dialect::Other => "PLY".to_owned(),
        writer => format!("PLY, {writer:?}"),
    }
}

/// Returns the guarantees of a compressed file, in one line.
fn guarantee(model: &Model, packed: Option<&Packed>) -> Option<String> {
    let record = model.record();
    let mut parts = Vec::new();
    if let Some(p) = packed.and_then(|packed| packed.head().target.as_ref()) {
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

/// The current step of a job.
#[derive(Debug, Default)]
pub(crate) struct JobStep {
    label: String,
    done: u64,
    total: u64,
    /// Number of stages that began and did not end. Only the outermost of them is shown.
    stages: usize,
}

/// Progress of a job. The thread of the job writes it, and the panel reads it.
#[derive(Debug, Default)]
pub(crate) struct JobProgress(Mutex<JobStep>);

impl JobProgress {
    fn start(&self, label: &str, total: u64) {
        *self.lock() = JobStep { label: label.to_owned(), total, ..JobStep::default() };
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, JobStep> {
        // A thread that panicked while it held the lock leaves at worst an old number.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the name of the step, and its completed share from 0 to 1 if that is known.
    pub(crate) fn read(&self) -> (String, Option<f32>) {
        let step = self.lock();
        #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
        let share = (step.total > 0).then(|| (step.done as f64 / step.total as f64).min(1.0) as f32);
        (step.label.clone(), share)
    }
}

impl Progress for JobProgress {
    fn begin(&self, stage: Stage, total: u64) {
        let label = match stage {
            Stage::Draw => "looking",
            Stage::Learn => "learning",
            Stage::Code => "coding",
            Stage::Read => "reading",
            Stage::Write => "writing",
            _ => "working",
        };
        if self.lock().stages == 0 {
            self.start(label, total);
        }
        self.lock().stages += 1;
    }

    fn advance(&self, units: u64) {
        let mut step = self.lock();
        if step.stages <= 1 {
            step.done = step.done.saturating_add(units);
        }
    }

    fn end(&self) {
        let mut step = self.lock();
        step.stages = step.stages.saturating_sub(1);
    }
}

/// A job that makes a model.
#[derive(Debug)]
pub(crate) struct Job {
    /// Id, unique among all jobs. A model of another job than the current job of the slot is outdated.
    pub(crate) id: u64,
    pub(crate) name: String,
    pub(crate) progress: Arc<JobProgress>,
}

/// The result of a job.
#[derive(Debug)]
pub(crate) struct FinishedJob {
    pub(crate) id: u64,
    pub(crate) slot: Slot,
    pub(crate) result: Result<OpenModel>,
}

/// Sends finished jobs to the window and wakes it.
#[derive(Clone)]
pub(crate) struct Notifier {
    pub(crate) sender: Sender<FinishedJob>,
    pub(crate) wake: Arc<dyn Fn() + Send + Sync>,
}

/// Starts a job that reads `path` within `limits` as the model of `slot`.
pub(crate) fn open(
    id: u64,
    slot: Slot,
    path: PathBuf,
    limits: Limits,
    size: OrbitSize,
    notifier: Notifier,
) -> Job {
    let name = path.display().to_string();
    spawn(id, slot, name, notifier, move |progress| {
        progress.start("reading", 0);
        let scene = SceneFile::read(&path, &ReadOptions::default().with_limits(limits))?;
        OpenModel::new(id, scene, Some(path), size)
    })
}

/// Starts a job that makes the second model by compressing `original`, which must not be a .lexi. Sensitivity is measured
/// from `cameras` if there are any, otherwise from generated views.
pub(crate) fn compress_to(
    id: u64,
    original: Arc<OpenModel>,
    quality: Quality,
    cameras: Option<Vec<Camera>>,
    size: OrbitSize,
    notifier: Notifier,
) -> Job {
    let name = format!("{} ({quality})", original.short_name());
    let title = name.clone();
    spawn(id, Slot::Second, name, notifier, move |progress| {
        let Some(splats) = original.splats() else {
            let expected = "no .lexi; a compressed scene cannot be compressed again";
            return Err(lexisplat::Error::parameter("scene", &original.scene.name, expected).into());
        };
        let scene = compressed(splats, &title, quality, cameras.as_deref(), progress)?;
        OpenModel::new(id, scene, None, size)
    })
}

/// Compresses `splats` like `lexisplat compress`, with this preset or tolerance.
fn compressed(
    splats: &Splats,
    name: &str,
    quality: Quality,
    cameras: Option<&[Camera]>,
    progress: &JobProgress,
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
    compression.run(splats, &mut file, progress)?;
    progress.start("unpacking", 0);
    Ok(SceneFile::read_bytes(name, &file, &ReadOptions::default())?)
}

/// Starts a thread that makes the model of `slot` by calling `work`.
fn spawn(
    id: u64,
    slot: Slot,
    name: String,
    notifier: Notifier,
    work: impl FnOnce(&JobProgress) -> Result<OpenModel> + Send + 'static,
) -> Job {
    let progress = Arc::new(JobProgress::default());
    let (again, reported, simd) = (notifier.clone(), Arc::clone(&progress), Simd::current());
    let tell = move |notifier: &Notifier, result| {
        // After the window has closed there is no receiver.
        let _ = notifier.sender.send(FinishedJob { id, slot, result });
        (notifier.wake)();
    };
    let run = move || tell(&notifier, simd.scope(|| work(&reported)));
    if let Err(error) = std::thread::Builder::new().name("model".into()).spawn(run) {
        tell(&again, Err(Error::Window(format!("cannot start a thread: {error}"))));
    }
    Job { id, name, progress }
}

#[cfg(test)]
mod tests {
    use lexisplat::packed::Preset;
    use lexisplat::{lexi, ply};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    const SIZE: OrbitSize = OrbitSize { views: 3, max_width: 100, near: None };

    #[test]
    fn a_stage_within_another_is_not_shown() {
        let progress = JobProgress::default();
        progress.begin(Stage::Code, 100);
        progress.advance(25);
        progress.begin(Stage::Draw, 8);
        progress.advance(8);
        assert_eq!(progress.read(), ("coding".to_owned(), Some(0.25)));
        progress.end();
        progress.advance(25);
        assert_eq!(progress.read(), ("coding".to_owned(), Some(0.5)));
        progress.end();
        progress.begin(Stage::Write, 4);
        assert_eq!(progress.read(), ("writing".to_owned(), Some(0.0)));
    }

    #[test]
    fn compressing_makes_what_a_file_would_hold() {
        let splats = scene(&SampleOptions::new(600, 0));
        for quality in [Quality::Preset(Preset::Small), Quality::Tolerance(0.2)] {
            let made = compressed(&splats, "made", quality, None, &JobProgress::default()).unwrap();
            let Loaded::Lexi(model, packed) = &made.loaded else { panic!("a model") };
            let mut bytes = Vec::new();
            match packed {
                Some(packed) => {
                    lexi::LexiWriter::packed(packed).write(&mut bytes, &lexisplat::Silent).unwrap()
                }
                None => lexi::write(&mut bytes, model).unwrap(),
            };
            assert_eq!(made.bytes, bytes.len() as u64, "{quality}");
            let open = OpenModel::new(1, made, None, SIZE).unwrap();
            assert_eq!(open.guarantee.is_some(), matches!(quality, Quality::Tolerance(_)), "{quality}");
            assert!(open.ratio(None).is_some_and(|(ratio, _)| ratio > 2.0));
        }
    }

    #[test]
    fn files_are_opened_and_failures_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let (good, bad) = (folder.path().join("good.ply"), folder.path().join("bad.ply"));
        ply::write(&good, &scene(&SampleOptions::new(20, 0))).unwrap();
        std::fs::write(&bad, "nonsense").unwrap();
        let (sender, finished) = std::sync::mpsc::channel();
        let notifier = Notifier { sender, wake: Arc::new(|| ()) };
        open(7, Slot::Second, good, Limits::default(), SIZE, notifier.clone());
        let done = finished.recv().unwrap();
        let model = done.result.unwrap();
        assert_eq!((done.id, done.slot, model.gaussians()), (7, Slot::Second, 20));
        assert_eq!(model.short_name(), "good.ply");
        assert!(model.ratio(None).is_none());
        assert_eq!((model.orbit.len(), model.orbit[0].width), (3, 100));
        open(8, Slot::First, bad, Limits::default(), SIZE, notifier.clone());
        assert!(finished.recv().unwrap().result.is_err());
        let original = Arc::new(model);
        compress_to(9, original, Quality::Tolerance(-1.0), None, SIZE, notifier);
        assert!(finished.recv().unwrap().result.is_err(), "a tolerance out of range");
    }
}
