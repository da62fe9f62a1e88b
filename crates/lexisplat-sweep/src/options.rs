//! How to sweep, and who is told how it goes.

use lexisplat::output::OutputGroup;
use lexisplat::{Layout, Limits, Pursuit};
use lexisplat_render::Device;

use super::results::Setting;
use lexisplat_eval::views::{DEFAULT_HOLD, DEFAULT_MAX_WIDTH, DEFAULT_ORBIT, SceneKind};
use lexisplat_eval::{Error, Result};

/// How to sweep.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct SweepOptions {
    /// Ways to compress, in the order of tables; none twice.
    pub settings: Vec<Setting>,
    /// The pursuit of settings with exact geometry.
    pub pursuit: Pursuit,
    /// Their layout.
    pub layout: Layout,
    /// Seed of learning samples.
    pub seed: u64,
    /// Whether pictures are rounded to 8 bits before scoring, as when they are saved and read back.
    pub eight_bit: bool,
    /// Whether to measure frames a second.
    pub fps: bool,
    /// Colour behind scenes.
    pub background: [f32; 3],
    /// Widest picture.
    pub max_width: u32,
    /// Where cameras are not marked, every how manyeth by name is a test one.
    pub hold: usize,
    /// What views of models without cameras are generated for.
    pub kind: SceneKind,
    /// How many.
    pub generated: u16,
    /// What to draw on.
    pub device: Device,
    /// What models may ask for.
    pub limits: Limits,
    /// Views of each model whose pictures are saved.
    pub pictures: usize,
    /// Whether finished parts that are already in the folder count.
    pub resume: bool,
    /// Stands for what is not among these options but changes scores, such as the weights of LPIPS.
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
            device: Device::Auto,
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
    /// [`Error::Parameter`] if there are none, one is there twice, or out of range.
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

/// Is told how a sweep goes. Everything has a default that does nothing.
pub trait Watch {
    /// `parts` parts are to be done in all.
    fn begin(&self, parts: u64) {
        let _ = parts;
    }
    /// A part begins: `what` says which.
    fn part(&self, what: &str) {
        let _ = what;
    }
    /// `parts` parts are done, or need not be.
    fn done(&self, parts: u64, reused: bool) {
        let _ = (parts, reused);
    }
    /// Something to tell about a model.
    fn warn(&self, model: &str, warning: &str) {
        let _ = (model, warning);
    }
}
