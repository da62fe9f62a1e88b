//! Evaluates one model of a sweep. Each part of its results is stored as soon as it is finished.

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use lexisplat::ply::ReadOptions;
use lexisplat::{Input, Layout, Splats};
use lexisplat_compress::Looked;
use lexisplat_compress::views::{View, ViewOptions, find_views, photo};
use lexisplat_compress::{Error, Result, draw_views};
use lexisplat_eval::format::file_name;
use lexisplat_eval::montage::difference;
use lexisplat_eval::{
    BenchOptions, Comparison, FrameRate, SceneFile, Scorer, bench_cpu_in_turn, bench_gpu_in_turn, png,
    score_views,
};
use lexisplat_render::{Camera, Image, Renderer, Scene};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::cache::{Cache, write_whole};
use super::compress_scene::compress_scene;
use super::manifest::Entry;
use super::options::{SweepOptions, SweepProgress};
use super::picture::PictureFiles;
use super::results::{Fps, Point, SceneResult, Setting};

/// Number of timed frames of each view on a GPU, as in measurements of the 3DGS authors (INRIA `gaussian-splatting` issue
/// 351).
const GPU_REPEAT: u32 = 100;
/// Number of timed frames of each view on the processor. It is enough to show the spread.
const CPU_REPEAT: u32 = 5;
/// Number of frames drawn of each view before timing.
const WARMUP: u32 = 1;
/// Word for pictures of a model as trained in file names.
const ORIGINAL: &str = "original";
/// Word for photos in file names.
const PHOTO: &str = "photo";

/// Returns the settings at which a model is compressed.
pub(super) fn settings<'a>(entry: &Entry, options: &'a SweepOptions) -> &'a [Setting] {
    if entry.method.is_competitor() { &[] } else { &options.settings }
}

/// Reason why work on a scene ended early.
pub(super) enum Failure {
    /// This scene cannot be evaluated. Other scenes may be.
    Scene(String),
    /// No other scene can be evaluated either: the disk is full, the GPU is lost, or the sweep was cancelled.
    Sweep(Error),
}

/// The result of a part of a scene.
type Part<T> = std::result::Result<T, Failure>;

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Render(lexisplat_render::Error::Gpu { .. }) => Self::Sweep(error),
            Error::Codec(lexisplat::Error::Cancelled) => Self::Sweep(error),
            error => Self::Scene(error.to_string()),
        }
    }
}

/// Results of a model as trained.
#[derive(Serialize, Deserialize)]
struct Original {
    to_photos: Option<Comparison>,
    fps: Option<f64>,
}

/// A model that is being evaluated.
struct Subject {
    splats: Splats,
    cameras: Vec<Camera>,
    /// Views that have photos.
    photos: Vec<View>,
    /// Text that describes everything on which results depend, except the setting.
    key: String,
    /// Prefix of the names of the model's files.
    name: String,
    /// Indices of the views whose pictures are saved.
    shown: Vec<usize>,
    /// Pictures of the original, and photos. They are made when the first part needs them.
    references: Option<References>,
    looked: Option<Arc<Looked>>,
}

/// Pictures with which others are compared, one for each view.
struct References {
    originals: Vec<Image>,
    /// Photos; empty if there are none.
    photos: Vec<Image>,
}

pub(super) struct Evaluator<'a> {
    pub(super) options: &'a SweepOptions,
    pub(super) scorer: &'a Scorer,
    pub(super) renderer: Renderer,
    pub(super) cache: Cache,
    pub(super) pictures: PathBuf,
    pub(super) progress: &'a dyn SweepProgress,
}

impl Evaluator<'_> {
    pub(super) fn scene(&mut self, entry: &Entry, number: usize) -> Part<(SceneResult, Vec<PictureFiles>)> {
        if !entry.model.is_file() {
            let what = if entry.model.is_dir() { "is a folder, not a file" } else { "does not exist" };
            return Err(Failure::Scene(format!("{} {what}", entry.model.display())));
        }
        let fingerprint = fingerprint(&entry.model)?;
        let options = ReadOptions::default().with_limits(self.options.limits);
        let read = SceneFile::read(&entry.model, &options).map_err(Error::from)?;
        for warning in read.warnings() {
            self.progress.warn(&entry.name, warning);
        }
        let source_bytes = read.bytes;
        let splats = read.into_splats().map_err(Error::from)?;
        let options = ViewOptions { offset: splats.meta.offset, ..self.view_options(entry) };
        let found = find_views(&options, &splats.geometry)?;
        for warning in &found.warnings {
            self.progress.warn(&entry.name, warning);
        }
        let cameras: Vec<Camera> = found.views.iter().map(|view| view.camera.clone()).collect();
        let photos: Vec<View> = found.views.into_iter().filter(|view| view.photo.is_some()).collect();
        let (gaussians, sh_degree) = (splats.len() as u64, splats.degree.get());
        let size = cameras.first().map_or([0, 0], |camera| [camera.width, camera.height]);
        let count = cameras.len();
        let shares = self.options.pictures.min(count);
        let mut subject = Subject {
            key: self.key(&fingerprint, &cameras, &photos)?,
            name: file_start(entry),
            shown: (0..shares).map(|i| (2 * i + 1) * count / (2 * shares)).collect(),
            splats,
            cameras,
            photos,
            references: None,
            looked: None,
        };
        self.progress.part(&format!("{} {}", entry.name, entry.method));
        let original = self.original(&mut subject)?;
        let mut points = Vec::new();
        let mut files = Vec::new();
        for &setting in settings(entry, self.options) {
            self.progress.part(&format!("{} {} {}", entry.name, entry.method, setting.label()));
            points.push(self.point(&mut subject, setting)?);
            files.extend(subject.shown.iter().map(|&view| self.files(&subject, number, view, setting)));
        }
        let shipped_bytes =
            entry.shipped.as_deref().and_then(|path| std::fs::metadata(path).ok()).map(|found| found.len());
        let scene = SceneResult {
            dataset: entry.dataset.clone(),
            name: entry.name.clone(),
            method: entry.method,
            model: shown_path(&entry.model),
            gaussians,
            sh_degree,
            ply_bytes: source_bytes,
            shipped_bytes,
            views_from: shown_path(Path::new(&found.from)),
            views: count,
            size,
            device: self.renderer.name().to_owned(),
            on_gpu: self.renderer.is_gpu(),
            to_photos: original.to_photos,
            fps: original.fps,
            points,
        };
        Ok((scene, files))
    }

    fn view_options(&self, entry: &Entry) -> ViewOptions {
        let mut options = ViewOptions {
            cameras: entry.cameras.clone(),
            images: entry.images.clone(),
            resolution: entry.resolution,
            near: entry.near.or(self.options.views.near),
            ..self.options.views.clone()
        };
        if entry.cameras.is_some() {
            options.split = entry.split;
        }
        options
    }

    /// Returns a text that describes everything on which results depend, except the setting.
    fn key(&self, model: &str, cameras: &[Camera], photos: &[View]) -> Result<String> {
        let paths = photos.iter().filter_map(|view| view.photo.as_deref());
        let photos = paths.map(fingerprint).collect::<Result<Vec<_>>>()?;
        let o = self.options;
        Ok(format!(
            "lexisplat {}; model {model}; cameras {cameras:?}; photos {photos:?}; metrics {:?} {}; 8bit {}; fps in turn {}; \
             background {:?}; device {}; {} {} seed {}",
            env!("CARGO_PKG_VERSION"),
            self.scorer.metrics(),
            o.fingerprint,
            o.drawing.eight_bit,
            o.fps,
            o.drawing.background,
            self.renderer.name(),
            o.pursuit,
            o.layout,
            o.seed
        ))
    }

    /// Returns a part of a scene: its point at the setting `label`, or without a label the results of the original.
    /// Returns the stored part if it was made from the same inputs and its pictures still exist, and otherwise the result
    /// of `make`.
    fn part<T: Serialize + DeserializeOwned>(
        &mut self,
        subject: &mut Subject,
        label: Option<&str>,
        make: impl FnOnce(&mut Self, &mut Subject, &References) -> Part<T>,
    ) -> Part<T> {
        let (name, key) = (&subject.name, &subject.key);
        let (name, key) = match label {
            Some(label) => (format!("{name}-{}", file_name(label)), format!("{key}; {label}")),
            None => (name.clone(), key.clone()),
        };
        let is_saved = |&view: &usize| self.picture(subject, view, label.unwrap_or(ORIGINAL)).is_file();
        if let Some(part) = self.cache.find(&name, &key).filter(|_| subject.shown.iter().all(is_saved)) {
            self.progress.done(true);
            return Ok(part);
        }
        let references = match subject.references.take() {
            Some(references) => references,
            None => self.references(subject)?,
        };
        let part = make(self, subject, &references)?;
        subject.references = Some(references);
        self.cache.store(&name, &key, &part).map_err(Failure::Sweep)?;
        self.progress.done(false);
        Ok(part)
    }

    fn original(&mut self, subject: &mut Subject) -> Part<Original> {
        self.part(subject, None, |this, subject, References { originals, photos }| {
            for &view in &subject.shown {
                this.save(subject, view, ORIGINAL, &originals[view])?;
                if let Some(photo) = photos.get(view) {
                    this.save(subject, view, PHOTO, photo)?;
                }
            }
            let to_photos = this.score_photos(subject, photos, originals)?;
            let fps = this.fps(&[Scene::from(&subject.splats)], &subject.cameras)?;
            Ok(Original { to_photos, fps: fps.first().map(|rate| rate.mean) })
        })
    }

    fn point(&mut self, subject: &mut Subject, setting: Setting) -> Part<Point> {
        let label = setting.label();
        self.part(subject, Some(&label), |this, subject, References { originals, photos }| {
            let Subject { splats, looked, .. } = subject;
            let (renderer, progress) = (&mut this.renderer, this.progress);
            let (model, report) = compress_scene(splats, setting, this.options, renderer, looked, progress)?;
            let scene = Scene::from(&model);
            let drawn = this.draw(&scene, &subject.cameras)?;
            for &view in &subject.shown {
                this.save(subject, view, &label, &drawn[view])?;
                let apart = difference(&originals[view], &drawn[view]);
                this.save(subject, view, &format!("{label} difference"), &apart)?;
            }
            let fps = this.fps(&[Scene::from(&subject.splats), scene], &subject.cameras)?;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a file's bytes")]
            let sh_bytes = report.sh_bytes.round() as u64;
            Ok(Point {
                setting,
                file_bytes: report.file_bytes,
                sh_bytes,
                resident_sh_bytes: model.resident_sh_bytes() as u64,
                atoms: model.dictionary().len(),
                mean_nonzeros: report.mean_nonzeros,
                coefficient_ratio: report.coefficient_ratio,
                max_residual: (report.layout != Layout::Packed).then_some(report.record.max_residual),
                over_tolerance: report.record.over_tolerance,
                to_original: score_views(this.scorer, &subject.cameras, originals, &drawn, progress)?,
                to_photos: this.score_photos(subject, photos, &drawn)?,
                fps: fps.first().zip(fps.get(1)).map(|(&dense, &sparse)| Fps { dense, sparse }),
                seconds: report.look_seconds + report.pack_seconds,
            })
        })
    }

    /// Draws the original, and reads the photos.
    fn references(&mut self, subject: &Subject) -> Result<References> {
        let read = |view: &View| photo(view, self.options.drawing.background);
        let photos = subject.photos.iter().map(read).collect::<Result<_>>()?;
        let originals = self.draw(&Scene::from(&subject.splats), &subject.cameras)?;
        Ok(References { originals, photos })
    }

    /// Returns the scores of pictures against photos, if there are photos.
    fn score_photos(
        &self,
        subject: &Subject,
        photos: &[Image],
        pictures: &[Image],
    ) -> Result<Option<Comparison>> {
        let score = || score_views(self.scorer, &subject.cameras, photos, pictures, self.progress);
        (!photos.is_empty()).then(score).transpose()
    }

    fn draw(&mut self, scene: &Scene<'_>, cameras: &[Camera]) -> Result<Vec<Image>> {
        draw_views(&mut self.renderer, scene, cameras, &self.options.drawing, self.progress)
    }

    /// Returns the frame rates of `scenes`, drawn in turn. Returns none if they are not asked for.
    fn fps(&self, scenes: &[Scene<'_>], cameras: &[Camera]) -> Result<Vec<FrameRate>> {
        if !self.options.fps {
            return Ok(Vec::new());
        }
        let repeat = if self.options.gpu.is_some() { GPU_REPEAT } else { CPU_REPEAT };
        let mut options = BenchOptions::new(WARMUP, repeat);
        options.background = self.options.drawing.background;
        match &self.options.gpu {
            Some(gpu) => bench_gpu_in_turn(gpu, scenes, cameras, &options, self.progress),
            None => bench_cpu_in_turn(scenes, cameras, &options, self.progress),
        }
    }

    /// Returns the path of a picture of a view.
    fn picture(&self, subject: &Subject, view: usize, what: &str) -> PathBuf {
        self.pictures.join(format!("{}-{view:03}-{}.png", subject.name, file_name(what)))
    }

    fn save(&self, subject: &Subject, view: usize, what: &str, image: &Image) -> Part<()> {
        let bytes = png(image.width, image.height, &image.to_8bit())?;
        let path = self.picture(subject, view, what);
        write_whole(&self.options.outputs, &path, &bytes).map_err(Failure::Sweep)
    }

    fn files(&self, subject: &Subject, scene: usize, view: usize, setting: Setting) -> PictureFiles {
        let label = setting.label();
        let picture = |what: &str| self.picture(subject, view, what);
        PictureFiles {
            scene,
            view: subject.cameras[view].name.clone(),
            original: picture(ORIGINAL),
            compressed: picture(&label),
            difference: picture(&format!("{label} difference")),
            photo: (!subject.photos.is_empty()).then(|| picture(PHOTO)),
            setting: label,
        }
    }
}

/// Returns `path` without folders of this machine. A path that leads down from the current folder stays as given.
/// Otherwise it is reduced to the name of the file, and to the folders of its training if that name is the same for all
/// models.
#[must_use]
pub fn shown_path(path: &Path) -> String {
    let is_down = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    if path.components().all(is_down) {
        return path.display().to_string();
    }
    let parts: Vec<_> = path.components().filter(|part| matches!(part, Component::Normal(_))).collect();
    let is_alike = |part: &Component<'_>| {
        let name = part.as_os_str().to_string_lossy();
        name.starts_with("point_cloud") || name.starts_with("iteration_")
    };
    let alike = parts.iter().rev().take_while(|part| is_alike(part)).count();
    let kept = if alike == 0 { 1 } else { alike + 1 };
    parts.iter().skip(parts.len().saturating_sub(kept)).collect::<PathBuf>().display().to_string()
}

/// Returns `reason` with the paths of `entry` replaced by those of [`shown_path`].
pub(super) fn without_paths(reason: &str, entry: &Entry) -> String {
    let paths = [Some(&entry.model), entry.cameras.as_ref(), entry.images.as_ref()];
    paths
        .into_iter()
        .flatten()
        .filter(|path| path.has_root() || path.starts_with(".."))
        .fold(reason.to_owned(), |reason, path| {
            reason.replace(&path.display().to_string(), &shown_path(path))
        })
}

/// Returns the prefix of the names of an entry's files. No two entries have the same prefix.
pub(super) fn file_start(entry: &Entry) -> String {
    let dataset = if entry.dataset.is_empty() { String::new() } else { format!("{}-", entry.dataset) };
    file_name(&format!("{dataset}{}-{}", entry.name, entry.method))
}

/// Returns the length and the checksum (CRC-32) of a file, as text.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read.
pub fn fingerprint(path: &Path) -> Result<String> {
    let bytes = Input::open(path)?;
    Ok(format!("{}:{:08x}", bytes.len(), crc32fast::hash(&bytes)))
}
