//! The shortest way to compress: one call that does what the program does.

use std::fmt;
use std::path::{Path, PathBuf};

use lexisplat::packed::Preset;
use lexisplat::ply::ReadOptions;
use lexisplat::{Input, Progress, Silent, Sink, SplatSource, Splats};
use lexisplat_formats::{Opened, Siblings, scene_path};
use lexisplat_render::gpu::Gpu;
use lexisplat_render::{Camera, ViewSet};

use crate::error::{Error, Result};
use crate::packing::{Compression, DEFAULT_MEMORY, Packing, Quality};
use crate::report::CompressionReport;
use crate::target::Target;
use crate::views::read_beside;

/// The scene to compress.
#[derive(Clone)]
#[non_exhaustive]
pub enum Source<'a> {
    /// A scene file of any format that can be read, or the folder of such a file.
    File(PathBuf),
    /// A scene that is open or in memory.
    Open(&'a dyn SplatSource),
}

impl fmt::Debug for Source<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => f.debug_tuple("File").field(path).finish(),
            Self::Open(source) => write!(f, "Open({} Gaussians)", source.len()),
        }
    }
}

impl<'a> From<&'a str> for Source<'a> {
    fn from(path: &'a str) -> Self {
        Self::File(path.into())
    }
}

impl<'a> From<&'a Path> for Source<'a> {
    fn from(path: &'a Path) -> Self {
        Self::File(path.to_owned())
    }
}

impl From<PathBuf> for Source<'_> {
    fn from(path: PathBuf) -> Self {
        Self::File(path)
    }
}

impl<'a> From<&'a Splats> for Source<'a> {
    fn from(splats: &'a Splats) -> Self {
        Self::Open(splats)
    }
}

impl<'a> From<&'a dyn SplatSource> for Source<'a> {
    fn from(source: &'a dyn SplatSource) -> Self {
        Self::Open(source)
    }
}

/// Begins to compress `source`, a path or splats. [`Compress::write`] and [`Compress::to_bytes`] run the compression.
/// Without other choices the quality is [`Preset::Balanced`]. It is judged by cameras that lie beside the file and seem to
/// belong to the scene, or else by views like photographs, which a search finds.
///
/// ```
/// use lexisplat_sample::{SampleOptions, scene};
///
/// let splats = scene(&SampleOptions::new(100, 0));
/// let (file, report) = lexisplat_compress::compress(&splats).psnr(38.0).to_bytes()?;
/// assert_eq!(report.file_bytes, file.len() as u64);
/// # Ok::<(), lexisplat_compress::Error>(())
/// ```
pub fn compress<'a>(source: impl Into<Source<'a>>) -> Compress<'a> {
    Compress {
        source: source.into(),
        quality: Preset::default().into(),
        read: ReadOptions::default(),
        cameras: None,
        beside: true,
        gpu: None,
        progress: &Silent,
    }
}

/// A scene to compress and the choices for it. [`compress`] makes it.
#[derive(Clone)]
#[must_use = "`write` or `to_bytes` compresses"]
pub struct Compress<'a> {
    source: Source<'a>,
    quality: Quality,
    read: ReadOptions,
    cameras: Option<Vec<Camera>>,
    beside: bool,
    gpu: Option<Gpu>,
    progress: &'a dyn Progress,
}

impl fmt::Debug for Compress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { source, quality, .. } = self;
        f.debug_struct("Compress").field("source", source).field("quality", quality).finish_non_exhaustive()
    }
}

impl<'a> Compress<'a> {
    /// Sets the quality by name.
    pub fn preset(self, preset: Preset) -> Self {
        self.quality(preset)
    }

    /// Sets the quality as a mean PSNR over views of the scene, in dB.
    pub fn psnr(self, decibels: f64) -> Self {
        self.quality(Target::MeanPsnr(decibels))
    }

    /// Sets any quality or size: a [`Preset`] or a [`Target`].
    pub fn quality(self, quality: impl Into<Quality>) -> Self {
        Self { quality: quality.into(), ..self }
    }

    /// Measures and judges by these cameras, in the world of the scene, instead of by cameras that lie beside it.
    pub fn cameras(self, cameras: Vec<Camera>) -> Self {
        Self { cameras: Some(cameras), ..self }
    }

    /// Ignores cameras that lie beside the file.
    pub fn no_cameras(self) -> Self {
        Self { beside: false, ..self }
    }

    /// Reads the file with these options: its limits, and the treatment of values that are not finite.
    pub fn read_options(self, read: ReadOptions) -> Self {
        Self { read, ..self }
    }

    /// Draws on `gpu` instead of the processor.
    pub fn gpu(self, gpu: Gpu) -> Self {
        Self { gpu: Some(gpu), ..self }
    }

    /// Reports every step to `progress`, which can cancel.
    pub fn progress(self, progress: &'a dyn Progress) -> Self {
        Self { progress, ..self }
    }

    /// Compresses into the file `path`, which appears when it is whole.
    ///
    /// # Errors
    /// Errors of [`Compression::run`] and of reading the file.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<CompressionReport> {
        self.run(path.as_ref().into())
    }

    /// Compresses into memory. Returns the bytes of the file and the report.
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn to_bytes(&self) -> Result<(Vec<u8>, CompressionReport)> {
        let mut file = Vec::new();
        let report = self.run((&mut file).into())?;
        Ok((file, report))
    }

    fn run(&self, sink: Sink<'_>) -> Result<CompressionReport> {
        let path = match &self.source {
            Source::Open(source) => return self.run_source(*source, None, sink),
            Source::File(path) => &*scene_path(path),
        };
        let beside = if self.beside && self.cameras.is_none() { read_beside(path) } else { None };
        let name = path.display().to_string();
        let bytes = Input::open_within(path, &self.read.limits)?;
        let whole = self.compression().holds_whole(bytes.len() as u64, beside.is_some());
        let opened =
            lexisplat_formats::open(&name, &bytes, Siblings::of(path), &self.read, whole, self.progress)?;
        let opened = opened.releasing_pages_of(&bytes);
        if matches!(opened, Opened::Lexi(_)) {
            return Err(Error::format(&name, "is a .lexi already: expected a scene that is not compressed"));
        }
        self.run_source(opened.some(&name)?, beside.map(|(_, set)| set), sink)
    }

    fn compression(&self) -> Compression {
        Packing::new(self.quality).with_gpu(self.gpu.clone()).with_memory(DEFAULT_MEMORY).into()
    }

    fn run_source(
        &self,
        source: &dyn SplatSource,
        beside: Option<ViewSet>,
        sink: Sink<'_>,
    ) -> Result<CompressionReport> {
        let (mut compression, offset) = (self.compression(), source.empty().meta.offset);
        if let Some(cameras) = &self.cameras {
            let positions = cameras.iter().map(|camera| camera.position.map(f64::from)).collect();
            let set = ViewSet { cameras: cameras.clone(), positions, warnings: Vec::new() };
            compression = compression.with_cameras(set.relative_to(offset).cameras);
        }
        if let Some(set) = beside {
            compression = compression.with_likely_cameras(set.relative_to(offset).cameras);
        }
        compression.run(source, sink, self.progress)
    }
}
