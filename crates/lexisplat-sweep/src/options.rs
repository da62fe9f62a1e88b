//! Options and progress of a sweep.

use lexisplat::output::OutputGroup;
use lexisplat::{Layout, Limits, Progress, Pursuit};
use lexisplat_render::gpu::Gpu;

use super::results::Setting;
use lexisplat_eval::views::{DEFAULT_HOLD, DEFAULT_MAX_WIDTH, DEFAULT_ORBIT, SceneKind};
use lexisplat_eval::{Error, Result};

/// Options of a sweep.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct SweepOptions {
    /// Ways to compress, each of them once, in the order of tables.
    pub settings: Vec<Setting>,
    /// The pursuit of settings with exact geometry.
    pub pursuit: Pursuit,
    /// The layout of settings with exact geometry.
    pub layout: Layout,
    /// Seed of learning samples.
    pub seed: u64,
    /// Whether pictures are rounded to 8 bits before scoring, as when they are saved and read back.
    pub eight_bit: bool,
    /// Whether to measure frames a second.
    pub fps: bool,
    /// Colour behind scenes: red, green, blue in 0..1.
    pub background: [f32; 3],
    /// Largest width of a picture, in pixels.
    pub max_width: u32,
    /// Every `hold`-th camera in order of names is a test camera, if no camera is marked as one.
    pub hold: usize,
    /// The kind of scene that views are generated for, where a model has no cameras.
    pub kind: SceneKind,
    /// Number of generated views.
    pub generated: u16,
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
            settings: [0.03, 0.05, 0.1, 0.2].map(Setting::Tolerance).to_vec(),
            pursuit: Pursuit::Ols,
            layout: Layout::F16,
            seed: 0,
            eight_bit: false,
            fps: true,
            background: [0.0; 3],
            max_width: DEFAULT_MAX_WIDTH,
            hold: DEFAULT_HOLD,
            kind: SceneKind::Auto,
            generated: DEFAULT_ORBIT,
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
                Setting::MaxNonzeros(0) => return Err(Error::parameter("max-nnz", 0, "1 to 255")),
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
    /// The sweep starts and has `parts` parts.
    fn start(&self, parts: u64) {
        let _ = parts;
    }
    /// A part begins. `what` names model and setting.
    fn part(&self, what: &str) {
        let _ = what;
    }
    /// `parts` more parts are done. They are `reused` if an earlier run had finished them.
    fn done(&self, parts: u64, reused: bool) {
        let _ = (parts, reused);
    }
    /// A warning about a model.
    fn warn(&self, model: &str, warning: &str) {
        let _ = (model, warning);
    }
}
