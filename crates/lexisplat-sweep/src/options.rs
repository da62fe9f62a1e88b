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
    /// Ways of compressing, each of them once, in the order of tables.
    pub settings: Vec<Setting>,
    /// Pursuit of settings with exact geometry. The default is that of the paper.
    pub pursuit: Pursuit,
    /// Layout of settings with exact geometry.
    pub layout: Layout,
    /// Seed of the choice of Gaussians from which dictionaries are learned.
    pub seed: u64,
    /// Options of drawing.
    pub drawing: DrawOptions,
    /// Whether to measure frames per second.
    pub fps: bool,
    /// Options of the views of models. Cameras, photos, resolution and split come from each [`Entry`](crate::Entry)
    /// instead.
    pub views: ViewOptions,
    /// The GPU that draws; `None` stands for the processor.
    pub gpu: Option<Gpu>,
    /// Limits on the size of models.
    pub limits: Limits,
    /// Number of views of each model whose pictures are saved.
    pub pictures: usize,
    /// Whether finished parts in the folder are reused.
    pub resume: bool,
    /// Text that identifies everything that changes scores and is not among these options, such as the weights of LPIPS.
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
    /// [`Error::Parameter`] if there are no settings, or if one is repeated or out of range.
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

/// Receives reports from a sweep, and may cancel it. By default every method does nothing.
pub trait SweepProgress: Progress {
    /// Called when the sweep starts, with the number of its parts.
    fn start(&self, _parts: u64) {}
    /// Called when a part begins. The text names the model and the setting.
    fn part(&self, _what: &str) {}
    /// Called when a part is done. `reused` tells whether an earlier run had finished it.
    fn done(&self, _reused: bool) {}
    /// Called with a warning about a model.
    fn warn(&self, _model: &str, _warning: &str) {}
}
