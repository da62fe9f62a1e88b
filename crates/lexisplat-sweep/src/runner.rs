//! One model of a sweep: its parts, each kept as soon as it is finished.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lexisplat::ply::{self, ReadOptions};
use lexisplat::{Sensitivity, Silent, Splats};
use lexisplat_render::gpu::{Gpu, ShPath};
use lexisplat_render::{Camera, Image, Renderer, Scene};
use serde::{Deserialize, Serialize};

use super::kept::{Kept, file_name, write_whole};
use super::manifest::Entry;
use super::options::{SweepOptions, Watch};
use super::results::{Fps, Point, SceneResult, Setting};
use super::run::Saved;
use super::squeeze::{How, squeeze};
use lexisplat_eval::Comparison;
use lexisplat_eval::Scorer;
use lexisplat_eval::montage::difference;
use lexisplat_eval::png;
use lexisplat_eval::views::{View, ViewOptions, find_views, photo};
use lexisplat_eval::{BenchOptions, bench_cpu, bench_gpu};
use lexisplat_eval::{DrawOptions, draw_views, score_views};
use lexisplat_eval::{Error, Result};

/// Frames timed from each view: on a GPU as the 3DGS authors do (INRIA `gaussian-splatting` issue 351),
/// on the processor as many as show the spread.
const GPU_REPEAT: u32 = 100;
const CPU_REPEAT: u32 = 3;
/// Frames drawn from each view before.
const WARMUP: u32 = 1;
/// Bytes read at once to recognise a file.
const CHUNK: usize = 1 << 20;

/// What a model is compressed to.
pub(super) fn settings<'a>(entry: &Entry, options: &'a SweepOptions) -> &'a [Setting] {
    if entry.method.is_competitor() { &[] } else { &options.settings }
}

/// Why work on a scene ended early.
pub(super) enum Stop {
    /// This scene cannot be evaluated; others may.
    Scene(String),
    /// Nothing further can be: the disk is full, the GPU is lost.
    All(Error),
}

/// What a part of a scene gives.
type Part<T> = std::result::Result<T, Stop>;

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        match error {
            Error::Render(lexisplat_render::Error::Gpu { .. }) => Self::All(error),
            error => Self::Scene(error.to_string()),
        }
    }
}

impl From<lexisplat::Error> for Stop {
    fn from(error: lexisplat::Error) -> Self {
        Error::from(error).into()
    }
}

/// What is known of a model itself.
#[derive(Serialize, Deserialize)]
struct Base {
    to_photos: Option<Comparison>,
    fps: Option<f64>,
}

/// A model under evaluation. Its pictures are made when the first part needs them.
struct Subject {
    splats: Splats,
    cameras: Vec<Camera>,
    /// The views again, if they have photos.
    photos: Vec<View>,
    /// Everything that results depend on but the setting.
    key: String,
    /// Start of its files' names.
    name: String,
    /// Places of the views whose pictures are saved.
    shown: Vec<usize>,
    originals: Option<Vec<Image>>,
    pictures_of_photos: Option<Vec<Image>>,
    seen: Option<Arc<Sensitivity>>,
}

pub(super) struct Runner<'a> {
    pub(super) options: &'a SweepOptions,
    pub(super) scorer: &'a Scorer,
    pub(super) gpu: Option<Gpu>,
    pub(super) renderer: Renderer,
    pub(super) kept: Kept,
    pub(super) pictures: PathBuf,
    pub(super) watch: &'a dyn Watch,
}

impl Runner<'_> {
    pub(super) fn scene(&mut self, entry: &Entry, place: usize) -> Part<(SceneResult, Vec<Saved>)> {
        if !entry.model.is_file() {
            return Err(Stop::Scene(format!("{} is not there", entry.model.display())));
        }
        let fingerprint = fingerprint(&entry.model)?;
        let options = ReadOptions::default().with_limits(self.options.limits);
        let read = ply::read(&entry.model, &options)?;
        for warning in &read.warnings {
            self.watch.warn(&entry.name, warning);
        }
        let splats = read.splats;
        let found = find_views(&self.view_options(entry), &splats.geometry)?;
        for warning in &found.warnings {
            self.watch.warn(&entry.name, warning);
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
            originals: None,
            pictures_of_photos: None,
            seen: None,
        };
        self.watch.part(&format!("{} {}", entry.name, entry.method));
        let base = self.base(&mut subject)?;
        let mut points = Vec::new();
        let mut saved = Vec::new();
        for &setting in settings(entry, self.options) {
            self.watch.part(&format!("{} {} {}", entry.name, entry.method, setting.label()));
            points.push(self.point(&mut subject, setting)?);
            saved.extend(subject.shown.iter().map(|&view| self.saved(&subject, place, view, setting)));
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
            to_photos: base.to_photos,
            fps: base.fps,
            points,
        };
        Ok((scene, saved))
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

    /// Everything that results depend on but the setting, in words.
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

    fn base(&mut self, subject: &mut Subject) -> Part<Base> {
        let shown: Vec<PathBuf> =
            subject.shown.iter().map(|&view| self.picture(subject, view, "original")).collect();
        let kept = self.kept.find(&subject.name, &subject.key);
        if let Some(base) = kept.filter(|_| shown.iter().all(|path| path.is_file())) {
            self.watch.done(1, true);
            return Ok(base);
        }
        self.look(subject)?;
        let (originals, photos) = (subject.originals(), subject.photographs());
        let to_photos = match photos {
            [] => None,
            photos => Some(score_views(self.scorer, &subject.cameras, photos, originals)?),
        };
        for &view in &subject.shown {
            self.save(&self.picture(subject, view, "original"), &originals[view])?;
            if let Some(photo) = photos.get(view) {
                self.save(&self.picture(subject, view, "photo"), photo)?;
            }
        }
        let fps = self.fps(&Scene::from(&subject.splats), &subject.cameras)?;
        let base = Base { to_photos, fps };
        self.kept.keep(&subject.name, &subject.key, &base).map_err(Stop::All)?;
        self.watch.done(1, false);
        Ok(base)
    }

    fn point(&mut self, subject: &mut Subject, setting: Setting) -> Part<Point> {
        let label = setting.label();
        let name = format!("{}-{}", subject.name, file_name(&label));
        let key = format!("{}; {label}", subject.key);
        let shown: Vec<PathBuf> =
            subject.shown.iter().map(|&view| self.picture(subject, view, &label)).collect();
        let kept = self.kept.find(&name, &key);
        if let Some(point) = kept.filter(|_| shown.iter().all(|path| path.is_file())) {
            self.watch.done(1, true);
            return Ok(point);
        }
        self.look(subject)?;
        let o = self.options;
        let how = How { pursuit: o.pursuit, layout: o.layout, seed: o.seed };
        let renderer = &mut self.renderer;
        let squeezed = squeeze(&subject.splats, setting, how, renderer, &mut subject.seen, &Silent)?;
        let scene = Scene::from(&squeezed.model);
        let drawn = self.draw(&scene, &subject.cameras)?;
        let (originals, photos) = (subject.originals(), subject.photographs());
        for (&view, path) in subject.shown.iter().zip(&shown) {
            self.save(path, &drawn[view])?;
            let apart = difference(&originals[view], &drawn[view]);
            self.save(&self.picture(subject, view, &format!("{label} difference")), &apart)?;
        }
        // Side by side, so that whatever else the machine does slows both.
        let dense = self.fps(&Scene::from(&subject.splats), &subject.cameras)?;
        let fps = match (dense, self.fps(&scene, &subject.cameras)?) {
            (Some(dense), Some(sparse)) => Some(Fps { dense, sparse }),
            _ => None,
        };
        let point = Point {
            setting,
            file_bytes: squeezed.file_bytes,
            sh_bytes: squeezed.sh_bytes,
            resident_sh_bytes: squeezed.model.resident_sh_bytes() as u64,
            atoms: squeezed.model.dictionary().len(),
            mean_nonzeros: squeezed.mean_nonzeros,
            coefficient_ratio: squeezed.coefficient_ratio,
            max_residual: squeezed.max_residual,
            over_tolerance: squeezed.over_tolerance,
            to_original: score_views(self.scorer, &subject.cameras, originals, &drawn)?,
            to_photos: match photos {
                [] => None,
                photos => Some(score_views(self.scorer, &subject.cameras, photos, &drawn)?),
            },
            fps,
            seconds: squeezed.seconds,
        };
        self.kept.keep(&name, &key, &point).map_err(Stop::All)?;
        self.watch.done(1, false);
        Ok(point)
    }

    /// Draws the original and reads the photos, unless that was done.
    fn look(&mut self, subject: &mut Subject) -> Result<()> {
        if subject.originals.is_none() {
            subject.originals = Some(self.draw(&Scene::from(&subject.splats), &subject.cameras)?);
        }
        if subject.pictures_of_photos.is_none() {
            let read = |view: &View| photo(view, self.options.background);
            let photos: Result<Vec<Image>> = subject.photos.iter().map(read).collect();
            subject.pictures_of_photos = Some(photos?);
        }
        Ok(())
    }

    fn draw(&mut self, scene: &Scene<'_>, cameras: &[Camera]) -> Result<Vec<Image>> {
        let options = DrawOptions::new(self.options.background, self.options.eight_bit);
        draw_views(&mut self.renderer, scene, cameras, &options, &Silent)
    }

    fn fps(&self, scene: &Scene<'_>, cameras: &[Camera]) -> Result<Option<f64>> {
        if !self.options.fps {
            return Ok(None);
        }
        let repeat = if self.gpu.is_some() { GPU_REPEAT } else { CPU_REPEAT };
        let mut options = BenchOptions::new(WARMUP, repeat);
        options.background = self.options.background;
        let times = match &self.gpu {
            Some(gpu) => bench_gpu(gpu, scene, ShPath::of(scene), cameras, &options, &Silent)?,
            None => bench_cpu(scene, cameras, &options, &Silent)?,
        };
        Ok(Some(times.fps))
    }

    /// Where a picture of a view is saved.
    fn picture(&self, subject: &Subject, view: usize, what: &str) -> PathBuf {
        self.pictures.join(format!("{}-{view:03}-{}.png", subject.name, file_name(what)))
    }

    fn save(&self, path: &Path, image: &Image) -> Part<()> {
        write_whole(&self.options.outputs, path, &png(image.width, image.height, &image.to_8bit())?)
            .map_err(Stop::All)
    }

    fn saved(&self, subject: &Subject, scene: usize, view: usize, setting: Setting) -> Saved {
        let label = setting.label();
        Saved {
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

impl Subject {
    fn originals(&self) -> &[Image] {
        self.originals.as_deref().unwrap_or_default()
    }

    fn photographs(&self) -> &[Image] {
        self.pictures_of_photos.as_deref().unwrap_or_default()
    }
}

/// How the names of an entry's files start: no two entries share one.
pub(super) fn file_start(entry: &Entry) -> String {
    let dataset = if entry.dataset.is_empty() { String::new() } else { format!("{}-", entry.dataset) };
    file_name(&format!("{dataset}{}-{}", entry.name, entry.method))
}

/// Length and checksum of a file.
fn fingerprint(path: &Path) -> Result<String> {
    let mut file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut sum = crc32fast::Hasher::new();
    let mut chunk = vec![0; CHUNK];
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
