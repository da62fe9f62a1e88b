//! How to compress: the choices, and which of them go together.

use std::sync::Arc;

use lexisplat::packed::{PackOptions, Preset};
use lexisplat::{CodeLayout, CompressOptions};
use lexisplat_render::gpu::Gpu;
use lexisplat_render::{Camera, Renderer};

use crate::error::{Error, Result};
use crate::packing_views::Looked;
use crate::target::Target;
use crate::views::Viewpoints;

/// Bytes of memory that packing a whole scene takes: so many, and tenths of a byte for each byte of its source. A PLY of 99 MB
/// took 540 MB, one of 793 MB 2,320 MB, without the pages of the file itself (docs/results/sizes.md).
const MEMORY: u64 = 320_000_000;
const MEMORY_PER_TEN_BYTES: u64 = 26;
/// Bytes of memory that the program and the Python package allow by default for packing a whole scene.
pub const DEFAULT_MEMORY: u64 = 4 << 30;
/// Most Gaussians of a scene without cameras that is packed whole. Pictures of a larger one as a whole show each of its Gaussians too
/// seldom: files in parts are 4 % larger at equal quality for 0.4 million Gaussians, and 25 % smaller for 1.2 million
/// (docs/results/sizes.md).
const MOST_WHOLE: u64 = 786_432;

/// Name of [`Packing::with_max_gaussians`] in errors.
const MAX_GAUSSIANS: &str = "max-gaussians";

/// How to compress a scene.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Compression {
    /// The geometry stays exact, and the SH become codes over a dictionary, laid out as given.
    Exact(CompressOptions, CodeLayout),
    /// Everything is quantised and entropy-coded as far as views of the scene allow.
    Packed(Packing),
    /// Everything is quantised and entropy-coded without drawing the scene: what shows follows from each
    /// Gaussian alone. Several times faster than [`Self::Packed`], for larger files of the same quality. The
    /// scene is never whole in memory.
    Guessed(Preset, PackOptions),
}

impl Compression {
    /// The same with these cameras if they seem to belong to the scene ([`Packing::with_likely_cameras`]), if it is one that
    /// draws.
    #[must_use]
    pub fn with_likely_cameras(self, cameras: Vec<Camera>) -> Self {
        match self {
            Self::Packed(packing) => Self::Packed(packing.with_likely_cameras(cameras)),
            other => other,
        }
    }

    /// The same with these cameras ([`Packing::with_cameras`]), if it is one that draws.
    #[must_use]
    pub fn with_cameras(self, cameras: Vec<Camera>) -> Self {
        match self {
            Self::Packed(packing) => Self::Packed(packing.with_cameras(cameras)),
            other => other,
        }
    }
}

impl From<CompressOptions> for Compression {
    fn from(options: CompressOptions) -> Self {
        Self::Exact(options, CodeLayout::default())
    }
}

impl From<Packing> for Compression {
    fn from(packing: Packing) -> Self {
        Self::Packed(packing)
    }
}

/// The quality of a packed file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Quality {
    /// A quality by name, which at most three packings give.
    Preset(Preset),
    /// A quality or a size that a search reaches.
    Target(Target),
}

impl From<Preset> for Quality {
    fn from(preset: Preset) -> Self {
        Self::Preset(preset)
    }
}

impl From<Target> for Quality {
    fn from(target: Target) -> Self {
        Self::Target(target)
    }
}

/// How to pack a scene by what shows in views of it.
///
/// A large scene, and one that needs more than the memory allowed, is packed part by part, each part by its own views, if no
/// choice needs the whole scene: cameras, viewpoints, a limit of Gaussians, and targets other than a mean PSNR do.
#[derive(Debug, Clone)]
pub struct Packing {
    pub(crate) quality: Quality,
    pub(crate) options: PackOptions,
    pub(crate) cameras: Option<Vec<Camera>>,
    pub(crate) likely_cameras: Option<Vec<Camera>>,
    pub(crate) viewpoints: Viewpoints,
    pub(crate) gpu: Option<Gpu>,
    pub(crate) looked: Option<Arc<Looked>>,
    pub(crate) max_gaussians: Option<usize>,
    memory: u64,
}

impl Default for Packing {
    fn default() -> Self {
        Self::new(Preset::default())
    }
}

impl Packing {
    /// Packs to `quality`, by views generated around the scene that the processor draws, in any memory.
    #[must_use]
    pub fn new(quality: impl Into<Quality>) -> Self {
        Self {
            quality: quality.into(),
            options: PackOptions::default(),
            cameras: None,
            likely_cameras: None,
            viewpoints: Viewpoints::Auto,
            gpu: None,
            looked: None,
            max_gaussians: None,
            memory: u64::MAX,
        }
    }

    /// Packs with these options of the codec.
    #[must_use]
    pub fn with_options(self, options: PackOptions) -> Self {
        Self { options, ..self }
    }

    /// Measures and judges by these cameras instead of generated ones. Their positions are relative to the scene's
    /// [offset](lexisplat::SceneMeta::offset), as those of Gaussians are. [`Compression::run`] refuses fewer than
    /// two.
    #[must_use]
    pub fn with_cameras(self, cameras: Vec<Camera>) -> Self {
        Self { cameras: Some(cameras), ..self }
    }

    /// Measures and judges by these cameras if they seem to belong to the scene, as [`Self::with_cameras`] does, and otherwise
    /// as if there were none. Nothing but the default viewpoints go with them, and a scene that is packed part by part does
    /// without. The report says whether they were used: [`ReachedRecord::cameras`](lexisplat::packed::ReachedRecord::cameras).
    #[must_use]
    pub fn with_likely_cameras(self, cameras: Vec<Camera>) -> Self {
        Self { likely_cameras: Some(cameras), ..self }
    }

    /// Measures and judges by views around an object or inside a room. By default views like photographs are looked
    /// for. Cameras that are given count more.
    #[must_use]
    pub fn with_viewpoints(self, viewpoints: Viewpoints) -> Self {
        Self { viewpoints, ..self }
    }

    /// Draws on `gpu`, or on the processor if there is none. The file records a GPU, because its results are not
    /// the same on every machine.
    #[must_use]
    pub fn with_gpu(self, gpu: Option<Gpu>) -> Self {
        Self { gpu, ..self }
    }

    /// Allows about `bytes` bytes of memory for packing a whole scene. A scene that needs more is packed part by
    /// part, which takes up to 1.5 GiB however small `bytes` is.
    #[must_use]
    pub fn with_memory(self, bytes: u64) -> Self {
        Self { memory: bytes, ..self }
    }

    /// Packs by what looking at the scene gave before, for several files of one scene.
    #[must_use]
    pub fn with_looked(self, looked: Arc<Looked>) -> Self {
        Self { looked: Some(looked), ..self }
    }

    /// Leaves out the Gaussians that show least until there are at most this many, 1 or more. A preset is then the quality
    /// of the file beside that scene; a target in decibels is beside the scene that was given.
    #[must_use]
    pub fn with_max_gaussians(self, most: impl Into<Option<usize>>) -> Self {
        Self { max_gaussians: most.into(), ..self }
    }

    /// The renderer that the choices mean.
    pub(crate) fn renderer(&self) -> Result<Renderer> {
        match &self.gpu {
            Some(gpu) => Ok(Renderer::on(gpu)?),
            None => Ok(Renderer::cpu()),
        }
    }

    /// Refuses choices that are out of range or do not go together.
    pub(crate) fn check(&self) -> Result<()> {
        if let Quality::Target(target) = self.quality {
            target.check()?;
        }
        match self.max_gaussians {
            Some(0) => Err(Error::parameter(MAX_GAUSSIANS, 0, "at least 1")),
            Some(most) if !self.options.may_change() => {
                let expected = "no limit with keep_all, keep_order or a tolerance";
                Err(Error::parameter(MAX_GAUSSIANS, most, expected))
            }
            _ => Ok(()),
        }
    }

    /// Whether a scene of `gaussians` Gaussians, which are `bytes` bytes without compression, is packed whole, with or without
    /// cameras that belong to it. Otherwise it is packed part by part.
    ///
    /// # Errors
    /// [`Error::Memory`] if the memory allowed is too small for the whole scene and a choice needs it.
    pub(crate) fn is_whole(&self, gaussians: u64, bytes: u64, cameras: bool) -> Result<bool> {
        let grows = u128::from(bytes) * u128::from(MEMORY_PER_TEN_BYTES) / 10;
        let needed = u64::try_from(grows).unwrap_or(u64::MAX).saturating_add(MEMORY);
        let fits = needed <= self.memory;
        match self.needs_whole() {
            Some(choice) if !fits => Err(Error::Memory { choice, needed, allowed: self.memory }),
            Some(_) => Ok(true),
            None => Ok(fits && (cameras || gaussians <= MOST_WHOLE)),
        }
    }

    /// The quality that is asked for, in dB.
    ///
    /// # Errors
    /// [`Error::Parameter`] for other targets than a mean PSNR.
    pub(crate) fn decibels(&self) -> Result<f64> {
        match self.quality {
            Quality::Preset(preset) => Ok(preset.decibels()),
            Quality::Target(Target::MeanPsnr(decibels)) => Ok(decibels),
            Quality::Target(target) => {
                Err(Error::parameter(target.name(), "a scene in parts", "the whole scene"))
            }
        }
    }

    /// The first choice that needs the whole scene in memory.
    fn needs_whole(&self) -> Option<&'static str> {
        match self.quality {
            Quality::Target(target) if !matches!(target, Target::MeanPsnr(_)) => Some(target.name()),
            _ if self.cameras.is_some() => Some("cameras"),
            _ if self.viewpoints != Viewpoints::Auto => Some("views"),
            _ if self.max_gaussians.is_some() => Some(MAX_GAUSSIANS),
            _ => self.looked.as_ref().map(|_| "looked"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_scenes_are_packed_in_parts_unless_there_are_cameras() {
        let large = MOST_WHOLE + 1;
        let bytes = 248 * large;
        let psnr = Packing::new(Target::MeanPsnr(40.0));
        for packing in [Packing::default(), psnr] {
            assert!(packing.is_whole(large - 1, bytes, false).unwrap());
            assert!(!packing.is_whole(large, bytes, false).unwrap());
            assert!(packing.is_whole(large, bytes, true).unwrap());
            assert!(!packing.with_memory(bytes).is_whole(large, bytes, true).unwrap());
        }
        for packing in [
            Packing::new(Target::Size(1_000_000)),
            Packing::default().with_cameras(Vec::new()),
            Packing::default().with_max_gaussians(5),
        ] {
            assert!(packing.is_whole(large, bytes, false).unwrap());
            let packing = packing.with_memory(bytes);
            assert!(matches!(packing.is_whole(large, bytes, false), Err(Error::Memory { .. })));
        }
        assert!(matches!(Packing::default().is_whole(u64::MAX, u64::MAX, true), Ok(true)));
    }
}
