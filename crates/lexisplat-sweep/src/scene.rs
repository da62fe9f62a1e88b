//! One model of a sweep. Each part of its results is stored as soon as it is finished.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lexisplat::ply::{self, ReadOptions};
use lexisplat::{Sensitivity, Splats};
use lexisplat_eval::format::file_name;
use lexisplat_eval::montage::difference;
use lexisplat_eval::views::{View, ViewOptions, find_views, photo};
use lexisplat_eval::{
    BenchOptions, Comparison, DrawOptions, Error, Result, Scorer, bench_cpu, bench_gpu, draw_views, png,
    score_views,
};
use lexisplat_render::gpu::ShPath;
use lexisplat_render::{Camera, Image, Renderer, Scene};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::cache::{Cache, write_whole};
use super::compress_scene::compress_scene;
use super::manifest::Entry;
use super::options::{SweepOptions, SweepProgress};
use super::picture::PictureFiles;
use super::results::{Fps, Point, SceneResult, Setting};

/// Frames timed from each view on a GPU, as the 3DGS authors do (INRIA `gaussian-splatting` issue 351).
const GPU_REPEAT: u32 = 100;
/// Frames timed from each view on the processor: enough to show the spread.
const CPU_REPEAT: u32 = 3;
/// Frames drawn from each view before timing.
const WARMUP: u32 = 1;
/// Bytes read at once for a checksum.
const READ_BYTES: usize = 1 << 20;

/// The settings that a model is compressed at.
pub(super) fn settings<'a>(entry: &Entry, options: &'a SweepOptions) -> &'a [Setting] {
    if entry.method.is_competitor() { &[] } else { &options.settings }
}

/// The reason why work on a scene ended early.
pub(super) enum Failure {
    /// This scene cannot be evaluated; others may.
    Scene(String),
    /// No other scene can be evaluated either: the disk is full, the GPU is lost, or the sweep is cancelled.
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

impl From<lexisplat::Error> for Failure {
    fn from(error: lexisplat::Error) -> Self {
        Error::from(error).into()
    }
}

/// Results of a model as trained.
#[derive(Serialize, Deserialize)]
struct Original {
    to_photos: Option<Comparison>,
    fps: Option<f64>,
}

/// A model under evaluation.
struct Subject {
    splats: Splats,
    cameras: Vec<Camera>,
    /// The views that have photos.
    photos: Vec<View>,
    /// Describes everything that results depend on except the setting.
    key: String,
    /// Start of the names of the model's files.
    name: String,
    /// Indices of the views whose pictures are saved.
    shown: Vec<usize>,
    /// Pictures of the original and photos, made when the first part needs them.
    references: Option<References>,
    sensitivity: Option<Arc<Sensitivity>>,
}

/// Pictures that others are compared with, one for each view.
struct References {
    originals: Vec<Image>,
    /// Empty without photos.
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
    pub(super) fn scene(&mut self, entry: &Entry, place: usize) -> Part<(SceneResult, Vec<PictureFiles>)> {
        if !entry.model.is_file() {
            return Err(Failure::Scene(format!("{} does not exist", entry.model.display())));
        }
        let fingerprint = fingerprint(&entry.model)?;
        let options = ReadOptions::default().with_limits(self.options.limits);
        let read = ply::read(&entry.model, &options)?;
        for warning in &read.warnings {
            self.progress.warn(&entry.name, warning);
        }
        let splats = read.splats;
        let found = find_views(&self.view_options(entry), &splats.geometry)?;
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
            sensitivity: None,
        };
        self.progress.part(&format!("{} {}", entry.name, entry.method));
        let original = self.original(&mut subject)?;
        let mut points = Vec::new();
        let mut files = Vec::new();
        for &setting in settings(entry, self.options) {
            self.progress.part(&format!("{} {} {}", entry.name, entry.method, setting.label()));
            points.push(self.point(&mut subject, setting)?);
            files.extend(subject.shown.iter().map(|&view| self.files(&subject, place, view, setting)));
        }
        let shipped_bytes =
            entry.shipped.as_deref().and_then(|path| std::fs::metadata(path).ok()).map(|found| found.len());
        let scene = SceneResult {
            dataset: entry.dataset.clone(),
            name: entry.name.clone(),
            method: entry.method,
            model: entry.model.display().to_string(),
            gaussians,
            sh_degree,
            ply_bytes: read.summary.file_bytes,
            shipped_bytes,
            views_from: found.from,
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
        let mut options = ViewOptions::default();
        options.cameras.clone_from(&entry.cameras);
        if entry.cameras.is_some() {
            options.split = entry.split;
        }
        options.hold = self.options.hold;
        options.kind = self.options.kind;
        options.count = self.options.generated;
        options.max_width = self.options.max_width;
        options.images.clone_from(&entry.images);
        options.resolution = entry.resolution;
        options
    }

    /// Describes everything that results depend on except the setting.
    fn key(&self, model: &str, cameras: &[Camera], photos: &[View]) -> Result<String> {
        let paths = photos.iter().filter_map(|view| view.photo.as_deref());
        let photos = paths.map(fingerprint).collect::<Result<Vec<_>>>()?;
        let o = self.options;
        Ok(format!(
            "lexisplat {}; model {model}; cameras {cameras:?}; photos {photos:?}; metrics {:?} {}; 8bit {}; fps {}; \
             background {:?}; device {}; {} {} seed {}",
            env!("CARGO_PKG_VERSION"),
            self.scorer.metrics(),
            o.fingerprint,
            o.eight_bit,
            o.fps,
            o.background,
            self.renderer.name(),
            o.pursuit,
            o.layout,
            o.seed
        ))
    }

    /// The stored part `name`, if `key` is the same and its pictures still exist.
    fn find<T: DeserializeOwned>(&self, name: &str, key: &str, pictures: &[PathBuf]) -> Option<T> {
        let part = self.cache.find(name, key).filter(|_| pictures.iter().all(|path| path.is_file()))?;
        self.progress.done(1, true);
        Some(part)
    }

    fn store(&self, name: &str, key: &str, part: &impl Serialize) -> Part<()> {
        self.cache.store(name, key, part).map_err(Failure::Sweep)?;
        self.progress.done(1, false);
        Ok(())
    }

    fn original(&mut self, subject: &mut Subject) -> Part<Original> {
        let shown: Vec<PathBuf> =
            subject.shown.iter().map(|&view| self.picture(subject, view, "original")).collect();
        if let Some(original) = self.find(&subject.name, &subject.key, &shown) {
            return Ok(original);
        }
        let References { originals, photos } = self.references(subject)?;
        for (&view, path) in subject.shown.iter().zip(&shown) {
            self.save(path, &originals[view])?;
            if let Some(photo) = photos.get(view) {
                self.save(&self.picture(subject, view, "photo"), photo)?;
            }
        }
        let to_photos = self.score_photos(subject, &photos, &originals)?;
        let fps = self.fps(&Scene::from(&subject.splats), &subject.cameras)?;
        let original = Original { to_photos, fps };
        subject.references = Some(References { originals, photos });
        self.store(&subject.name, &subject.key, &original)?;
        Ok(original)
    }

    fn point(&mut self, subject: &mut Subject, setting: Setting) -> Part<Point> {
        let label = setting.label();
        let name = format!("{}-{}", subject.name, file_name(&label));
        let key = format!("{}; {label}", subject.key);
        let shown: Vec<PathBuf> =
            subject.shown.iter().map(|&view| self.picture(subject, view, &label)).collect();
        if let Some(point) = self.find(&name, &key, &shown) {
            return Ok(point);
        }
        let References { originals, photos } = self.references(subject)?;
        let Subject { splats, sensitivity, .. } = subject;
        let (model, compressed) =
            compress_scene(splats, setting, self.options, &mut self.renderer, sensitivity, self.progress)?;
        let scene = Scene::from(&model);
        let drawn = self.draw(&scene, &subject.cameras)?;
        for (&view, path) in subject.shown.iter().zip(&shown) {
            self.save(path, &drawn[view])?;
            let apart = difference(&originals[view], &drawn[view]);
            self.save(&self.picture(subject, view, &format!("{label} difference")), &apart)?;
        }
        // Dense and sparse are timed one right after the other, so that other load on the machine slows both.
        let dense = self.fps(&Scene::from(&subject.splats), &subject.cameras)?;
        let fps = dense.zip(self.fps(&scene, &subject.cameras)?).map(|(dense, sparse)| Fps { dense, sparse });
        let point = Point {
            to_original: score_views(self.scorer, &subject.cameras, &originals, &drawn)?,
            to_photos: self.score_photos(subject, &photos, &drawn)?,
            fps,
            ..compressed
        };
        subject.references = Some(References { originals, photos });
        self.store(&name, &key, &point)?;
        Ok(point)
    }

    /// Takes the pictures to compare with out of `subject`, or makes them.
    fn references(&mut self, subject: &mut Subject) -> Result<References> {
        if let Some(references) = subject.references.take() {
            return Ok(references);
        }
        let read = |view: &View| photo(view, self.options.background);
        let photos = subject.photos.iter().map(read).collect::<Result<_>>()?;
        let originals = self.draw(&Scene::from(&subject.splats), &subject.cameras)?;
        Ok(References { originals, photos })
    }

    /// Scores of pictures against photos, if there are any.
    fn score_photos(
        &self,
        subject: &Subject,
        photos: &[Image],
        pictures: &[Image],
    ) -> Result<Option<Comparison>> {
        if photos.is_empty() {
            return Ok(None);
        }
        score_views(self.scorer, &subject.cameras, photos, pictures).map(Some)
    }

    fn draw(&mut self, scene: &Scene<'_>, cameras: &[Camera]) -> Result<Vec<Image>> {
        let options = DrawOptions::new(self.options.background, self.options.eight_bit);
        draw_views(&mut self.renderer, scene, cameras, &options, self.progress)
    }

    fn fps(&self, scene: &Scene<'_>, cameras: &[Camera]) -> Result<Option<f64>> {
        if !self.options.fps {
            return Ok(None);
        }
        let repeat = if self.options.gpu.is_some() { GPU_REPEAT } else { CPU_REPEAT };
        let mut options = BenchOptions::new(WARMUP, repeat);
        options.background = self.options.background;
        let times = match &self.options.gpu {
            Some(gpu) => bench_gpu(gpu, scene, ShPath::of(scene), cameras, &options, self.progress)?,
            None => bench_cpu(scene, cameras, &options, self.progress)?,
        };
        Ok(Some(times.fps))
    }

    /// The path of a picture of a view.
    fn picture(&self, subject: &Subject, view: usize, what: &str) -> PathBuf {
        self.pictures.join(format!("{}-{view:03}-{}.png", subject.name, file_name(what)))
    }

    fn save(&self, path: &Path, image: &Image) -> Part<()> {
        let bytes = png(image.width, image.height, &image.to_8bit())?;
        write_whole(&self.options.outputs, path, &bytes).map_err(Failure::Sweep)
    }

    fn files(&self, subject: &Subject, scene: usize, view: usize, setting: Setting) -> PictureFiles {
        let label = setting.label();
        PictureFiles {
            scene,
            view: subject.cameras[view].name.clone(),
            original: self.picture(subject, view, "original"),
            compressed: self.picture(subject, view, &label),
            difference: self.picture(subject, view, &format!("{label} difference")),
            photo: (!subject.photos.is_empty()).then(|| self.picture(subject, view, "photo")),
            setting: label,
        }
    }
}

/// Start of the names of an entry's files. No two entries share one.
pub(super) fn file_start(entry: &Entry) -> String {
    let dataset = if entry.dataset.is_empty() { String::new() } else { format!("{}-", entry.dataset) };
    file_name(&format!("{dataset}{}-{}", entry.name, entry.method))
}

/// Length and checksum of a file.
fn fingerprint(path: &Path) -> Result<String> {
    let mut file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut sum = crc32fast::Hasher::new();
    let mut chunk = vec![0; READ_BYTES];
    let mut length = 0_u64;
    loop {
        let count = file.read(&mut chunk).map_err(|e| Error::io(path, e))?;
        if count == 0 {
            return Ok(format!("{length}:{:08x}", sum.finalize()));
        }
        sum.update(&chunk[..count]);
        length += count as u64;
    }
}
