//! Options of the window.

use std::path::PathBuf;

use lexisplat::Limits;
use lexisplat::output::OutputGroup;
use lexisplat_compress::SplitFilter;
use lexisplat_render::Device;

/// The files to show, and the initial settings.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// One or two scenes, of any format.
    pub files: Vec<PathBuf>,
    /// A file or folder of cameras. Without it the cameras are an orbit around the first scene.
    pub cameras: Option<PathBuf>,
    /// The cameras of the file to use.
    pub split: SplitFilter,
    /// Number of views of the orbit; 0 counts as 1.
    pub orbit: u16,
    /// Largest width of a screenshot, in pixels; 0 counts as 1.
    pub max_width: u32,
    /// Distance of the near plane, in world units, above 0. `None` chooses the trainer's distance for cameras of a file,
    /// and a distance that suits the scene's size for other cameras.
    pub near: Option<f32>,
    /// Colour behind the scenes, each channel from 0 to 1.
    pub background: [f32; 3],
    /// The device that draws the scenes. The window itself always needs a graphics adapter, which may be software.
    pub device: Device,
    /// Whether a screenshot with a given name may replace a file.
    pub overwrite: bool,
    /// Limits on files, also on files that are dropped on the window.
    pub limits: Limits,
    /// Commands to carry out at the start, in the words of [`SCRIPT_WORDS`](crate::SCRIPT_WORDS); may be empty.
    pub script: String,
    /// The group of all pictures that are saved.
    pub outputs: OutputGroup,
}
