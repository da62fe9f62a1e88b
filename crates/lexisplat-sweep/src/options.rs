//! Options and progress of a sweep.

use lexisplat::output::OutputGroup;
use lexisplat::{Layout, Limits, Progress, Pursuit};
use lexisplat_render::gpu::Gpu;

use super::paper;
use super::results::Setting;
use lexisplat_compress::{DrawOptions, Error, Result, ViewOptions};

/// Options of a sweep.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct SweepOptions {
    /// Ways to compress, each of them once, in the order of tables.
    pub settings: Vec<Setting>,
    /// The pursuit of settings with exact geometry. The default is the paper's.
    pub pursuit: Pursuit,
    /// The layout of settings with exact geometry.
    pub layout: Layout,
    /// Seed of learning samples.
    pub seed: u64,
    /// How pictures are drawn.
    pub drawing: DrawOptions,
    /// Whether to measure frames a second.
    pub fps: bool,
    /// The views of models. Their cameras, photos, resolution and split are those of each [`Entry`](crate::Entry).
    pub views: ViewOptions,
    /// The GPU that draws. `None` stands for the processor.
    pub gpu: Option<Gpu>,
    /// Limits on the size of models.
    pub limits: Limits,
    /// Number of views of each model whose pictures are saved.
    pub pictures: usize,
    /// Whether finished parts in the folder are used.
    pub resume: bool,
    /// Describes what changes scores but is not among these options, such as the weights of LPIPS.
    pub fingerprint: String,
    /// The group of all files that the sweep writes.
    pub outputs: OutputGroup,
}

impl Default for SweepOptions {
    fn default() -> Self {
        Self {
            settings: paper::TOLERANCES.map(Setting::Tolerance).to_vec(),
            pursuit: Pursuit::Omp,
            layout: Layout::F16,
            seed: 0,
            drawing: DrawOptions::default(),
            fps: true,
            views: ViewOptions::default(),
            gpu: None,
            limits: Limits::default(),
            pictures: 1,
            resume: true,
            fingerprint: String::new(),
            outputs: OutputGroup::default(),
        }
    }
}

impl SweepOptions {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there are none, or if one is repeated or out of range.
    pub(super) fn check(&self) -> Result<()> {
        if self.settings.is_empty() {
            return Err(Error::parameter("settings", "none", "a tolerance, a cap on nonzeros or a preset"));
        }
        for (i, setting) in self.settings.iter().enumerate() {
            if self.settings[..i].contains(setting) {
                return Err(Error::parameter("settings", setting.label(), "each of them once"));
            }
            match *setting {
                Setting::Tolerance(t) if !(t.is_finite() && t >= 0.0) => {
                    return Err(Error::parameter("tol", t, "a finite number, 0 or above"));
                }
                Setting::MaxNonzeros(0) => return Err(Error::parameter("max-nonzeros", 0, "1 to 255")),
                _ => {}
            }
        }
        if self.layout == Layout::Packed {
            return Err(Error::parameter("layout", self.layout, "f16, f32 or paper; presets are packed"));
        }
        Ok(())
    }
}

/// Receives reports from a sweep, and may cancel it. Every method does nothing by default.
pub trait SweepProgress: Progress {
    /// The sweep starts and has so many parts.
    fn start(&self, _parts: u64) {}
    /// A part begins. The text names model and setting.
    fn part(&self, _what: &str) {}
    /// One more part is done. It is `reused` if an earlier run had finished it.
    fn done(&self, _reused: bool) {}
    /// A warning about a model.
    fn warn(&self, _model: &str, _warning: &str) {}
}
