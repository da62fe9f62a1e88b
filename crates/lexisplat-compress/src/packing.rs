//! The choices of a compression, and which of them go together.

use std::sync::Arc;

use lexisplat::packed::tiles::BUCKET;
use lexisplat::packed::{PackOptions, Preset};
use lexisplat::{CodeLayout, CompressOptions};
use lexisplat_render::gpu::Gpu;
use lexisplat_render::{Camera, Renderer};

use crate::effort::{REFINE, Refine};
use crate::error::{Error, Result};
use crate::packing_views::{Looked, MOST_REFINED_PIXELS};
use crate::solve::KEPT_BYTES;
use crate::target::Target;
use crate::views::Viewpoints;

/// Estimate of the memory that packing a whole scene takes: `MEMORY` bytes, and `MEMORY_PER_TEN_BYTES` bytes for each ten
/// bytes of the source. Without what refitting keeps, a PLY of 99 MB took 540 MB, one of 793 MB 2,320 MB, without the pages of
/// the file itself (docs/results/sizes.md).
const MEMORY: u64 = 320_000_000 + KEPT_BYTES;
const MEMORY_PER_TEN_BYTES: u64 = 26;
/// The same for refining: more bytes, for the pictures that are fitted to, and bytes for each ten bytes of the source if all
/// Gaussians stay. The PLY of 99 MB took 1,440 MB.
const REFINING_MEMORY: u64 = 3 * MOST_REFINED_PIXELS;
const REFINING_PER_TEN_BYTES: u64 = 88;
/// Default of the program and of the Python package for the memory that packing a whole scene may take, in bytes.
pub const DEFAULT_MEMORY: u64 = 4 << 30;
/// Largest number of Gaussians of a scene without cameras that is packed whole. The views of a larger scene show each Gaussian too
/// seldom. Relative to whole scenes at equal quality, files in parts are 4 % larger for 0.4 million Gaussians and 27 % smaller for
/// 1.2 million (docs/results/sizes.md).
const MOST_WHOLE: u64 = 786_432;
/// The same for a scene that is refined. Each part has all steps of the fit. Relative to the whole scene at equal quality, room-large
/// in two parts takes 12 % fewer bytes, in three fifths of the time (docs/METHOD.md, "Refining").
const MOST_WHOLE_REFINED: u64 = BUCKET as u64;

/// Name of [`Packing::with_max_gaussians`] in errors.
const MAX_GAUSSIANS: &str = "max-gaussians";
/// Name of [`Packing::with_refine`] in errors about memory.
const REFINE_WITH_CAMERAS: &str = "refine with cameras";

/// The choices of a compression.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Compression {
    /// The geometry stays exact. The SH become codes over a dictionary, in the given layout.
    Exact(CompressOptions, CodeLayout),
    /// Everything is quantised and entropy-coded. Views of the scene measure the effect of errors and judge the file.
    Packed(Packing),
    /// Everything is quantised and entropy-coded without drawing the scene. The effect of errors is guessed from each
    /// Gaussian alone. This is several times faster than [`Self::Packed`], and makes larger files of the same quality. The
    /// scene is never whole in memory.
    Guessed(Preset, PackOptions),
}

impl Compression {
    /// Returns this compression with cameras that are used if they seem to belong to the scene
    /// ([`Packing::with_likely_cameras`]). Only [`Self::Packed`] changes.
    #[must_use]
    pub fn with_likely_cameras(self, cameras: Vec<Camera>) -> Self {
        match self {
            Self::Packed(packing) => Self::Packed(packing.with_likely_cameras(cameras)),
            other => other,
        }
    }

    /// Returns this compression with these cameras ([`Packing::with_cameras`]). Only [`Self::Packed`] changes.
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
    /// A quality by name. It takes at most three packings.
    Preset(Preset),
    /// A quality or a size, which a search reaches.
    Target(Target),
}

impl Quality {
    /// Returns the PSNR asked for, in dB. It is a quality that a scene in parts can have.
    ///
    /// # Errors
    /// [`Error::Parameter`] for targets other than a mean PSNR, and for a PSNR that is not a finite number above 0.
    pub fn decibels(self) -> Result<f64> {
        match self {
            Self::Preset(preset) => Ok(preset.decibels()),
            Self::Target(target @ Target::MeanPsnr(decibels)) => target.check().map(|()| decibels),
            Self::Target(target) => {
                Err(Error::parameter(target.name(), "a scene in parts", "the whole scene"))
            }
        }
    }
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

/// The choices of packing a scene by its pictures.
///
/// A scene that is large, or needs more than the memory allowed, is packed part by part, with views of each part. Some
/// choices need the whole scene: given cameras, viewpoints, a limit of Gaussians, refining with cameras, and targets other than a
/// mean PSNR.
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
    pub(crate) refine: Option<Refine>,
    memory: u64,
}

impl Default for Packing {
    fn default() -> Self {
        Self::new(Preset::default())
    }
}

impl Packing {
    /// Returns choices for `quality`. Views are generated, the processor draws, and memory is not limited.
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
            refine: None,
            memory: u64::MAX,
        }
    }

    /// Sets the options of the codec.
    #[must_use]
    pub fn with_options(self, options: PackOptions) -> Self {
        Self { options, ..self }
    }

    /// Measures and judges by these cameras instead of generated ones. Positions of cameras, like those of Gaussians, are
    /// relative to the scene's [offset](lexisplat::SceneMeta::offset). [`Compression::run`] refuses fewer than two cameras.
    #[must_use]
    pub fn with_cameras(self, cameras: Vec<Camera>) -> Self {
        Self { cameras: Some(cameras), ..self }
    }

    /// Measures and judges by these cameras, as [`Self::with_cameras`] does, if they seem to belong to the scene. Otherwise
    /// they are ignored. They are also ignored with other viewpoints than the default, and by a scene that is packed part
    /// by part. The report tells whether they were used:
    /// [`ReachedRecord::cameras`](lexisplat::packed::ReachedRecord::cameras).
    #[must_use]
    pub fn with_likely_cameras(self, cameras: Vec<Camera>) -> Self {
        Self { likely_cameras: Some(cameras), ..self }
    }

    /// Measures and judges by views around an object or inside a room. By default a search finds views like photographs.
    /// Given cameras take precedence.
    #[must_use]
    pub fn with_viewpoints(self, viewpoints: Viewpoints) -> Self {
        Self { viewpoints, ..self }
    }

    /// Draws on `gpu`, or on the processor if `gpu` is `None`. The file records the name of a GPU, because the results of
    /// GPUs differ from machine to machine.
    #[must_use]
    pub fn with_gpu(self, gpu: Option<Gpu>) -> Self {
        Self { gpu, ..self }
    }

    /// Allows about `bytes` bytes of memory for packing a whole scene. A scene that needs more is packed part by part,
    /// which takes up to 1.5 GiB, however small `bytes` is.
    #[must_use]
    pub fn with_memory(self, bytes: u64) -> Self {
        Self { memory: bytes, ..self }
    }

    /// Uses views and sensitivity that were measured before, for several files of one scene.
    #[must_use]
    pub fn with_looked(self, looked: Arc<Looked>) -> Self {
        Self { looked: Some(looked), ..self }
    }

    /// Removes and merges Gaussians, those that change pictures least, until there are at most `most`, 1 or more. A preset is
    /// then the quality relative to the reduced scene. A target in decibels is relative to the original scene.
    #[must_use]
    pub fn with_max_gaussians(self, most: impl Into<Option<usize>>) -> Self {
        Self { max_gaussians: most.into(), ..self }
    }

    /// Removes and merges more Gaussians, and fits everything of the others to pictures of the scene (docs/METHOD.md,
    /// "Refining"). The file is then smaller at the same quality, and takes minutes instead of seconds.
    #[must_use]
    pub fn with_refine(self, refine: impl Into<Option<Refine>>) -> Self {
        Self { refine: refine.into(), ..self }
    }

    /// Returns the renderer on the chosen device.
    pub(crate) fn renderer(&self) -> Result<Renderer> {
        match &self.gpu {
            Some(gpu) => Ok(Renderer::on(gpu)?),
            None => Ok(Renderer::cpu()),
        }
    }

    /// Returns an error for choices that are out of range or do not go together.
    pub(crate) fn check(&self) -> Result<()> {
        if let Quality::Target(target) = self.quality {
            target.check()?;
        }
        if let Some(refine) = self.refine {
            refine.check()?;
            if !self.options.may_change() {
                let expected = "no refining with keep_all, keep_order or a tolerance";
                return Err(Error::parameter(REFINE, "given", expected));
            }
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

    /// Returns whether a scene is packed whole. Otherwise it is packed part by part. The scene has `gaussians` Gaussians
    /// and takes `bytes` bytes without compression. `cameras` tells whether cameras belong to it.
    ///
    /// # Errors
    /// [`Error::Memory`] if a choice needs the whole scene and the memory allowed is too small.
    pub(crate) fn is_whole(&self, gaussians: u64, bytes: u64, cameras: bool) -> Result<bool> {
        let (fixed, per_ten_bytes, most) = match self.refine {
            Some(_) => (MEMORY + REFINING_MEMORY, REFINING_PER_TEN_BYTES, MOST_WHOLE_REFINED),
            None => (MEMORY, MEMORY_PER_TEN_BYTES, MOST_WHOLE),
        };
        let grows = u128::from(bytes) * u128::from(per_ten_bytes) / 10;
        let needed = u64::try_from(grows).unwrap_or(u64::MAX).saturating_add(fixed);
        let fits = needed <= self.memory;
        // A scene in parts ignores cameras that lie beside it. Refining gains much less without them, so a scene with cameras is
        // not refined in parts.
        let with_cameras = self.refine.filter(|_| cameras).map(|_| REFINE_WITH_CAMERAS);
        match self.needs_whole().or(with_cameras) {
            Some(choice) if !fits => Err(Error::Memory { choice, needed, allowed: self.memory }),
            Some(_) => Ok(true),
            None => Ok(fits && (cameras || gaussians <= most)),
        }
    }

    /// Returns the name of the first choice that needs the whole scene in memory.
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
        let refined = Packing::default().with_refine(Refine::Quick).with_memory(8 * bytes);
        assert!(!refined.is_whole(large, bytes, false).unwrap());
        assert!(matches!(
            refined.is_whole(large, bytes, true),
            Err(Error::Memory { choice: REFINE_WITH_CAMERAS, .. })
        ));
        let few = MOST_WHOLE_REFINED;
        assert!(refined.is_whole(few, 248 * few, false).unwrap());
        assert!(!refined.is_whole(few + 1, 248 * (few + 1), false).unwrap());
        assert!(refined.with_memory(u64::MAX).is_whole(large, bytes, true).unwrap());
        assert!(matches!(Packing::default().is_whole(u64::MAX, u64::MAX, true), Ok(true)));
    }
}
