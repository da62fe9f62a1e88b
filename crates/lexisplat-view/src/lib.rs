//! A window that shows one or two 3D Gaussian Splatting scenes.
//!
//! [`run`] opens the window and returns when it is closed. Keys, buttons, dropped files and scripts give commands
//! to one state, which is independent of the window and tested without it. A thread of its own draws the pictures,
//! so that the window responds however long a picture takes.
//!
//! | module | purpose |
//! |---|---|
//! | `command`, `keys`, `script` | all commands; their keys; their words in scripts |
//! | `state` | what is shown and from where |
//! | `camera_controller` | orbiting, panning and flying |
//! | `models` | reading and compressing on threads of their own |
//! | `scene_renderer`, `render_thread` | drawing by the GPU or the CPU; the thread that does it |
//! | `present`, `compose` | one or two pictures on screen, or in memory |
//! | `app`, `command_handlers`, `viewport`, `panel` | the window, its commands, its picture, its controls |

mod app;
mod camera_controller;
mod command;
mod command_handlers;
mod compose;
mod error;
mod keys;
mod models;
mod panel;
mod present;
mod render_thread;
mod scene_renderer;
mod script;
mod state;
mod viewport;
mod window;

use std::path::PathBuf;

use lexisplat::Limits;
use lexisplat::output::OutputGroup;
use lexisplat_eval::SplitFilter;
use lexisplat_render::Device;

pub use error::{Error, Result};
pub use window::run;

/// The words of a script and their meanings, for `--help`.
pub use script::WORDS as SCRIPT_WORDS;

/// What to show, and the initial settings.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// One or two scenes: PLY or .lexi.
    pub files: Vec<PathBuf>,
    /// A file or folder of cameras. Without it the cameras are an orbit around the first scene.
    pub cameras: Option<PathBuf>,
    /// Which cameras of the file to take.
    pub split: SplitFilter,
    /// Number of views of the orbit; 0 counts as 1.
    pub orbit: u16,
    /// Largest width of a screenshot, in pixels; 0 counts as 1.
    pub max_width: u32,
    /// Colour behind the scenes, 0 to 1 in each channel.
    pub background: [f32; 3],
    /// The device that draws the scenes. The window itself always needs a graphics adapter, which may be software.
    pub device: Device,
    /// Whether a screenshot with a given name may replace a file.
    pub overwrite: bool,
    /// Limits on what files may make the program allocate, including files dropped on the window.
    pub limits: Limits,
    /// Commands to carry out at the start, as [`SCRIPT_WORDS`] describes; may be empty.
    pub script: String,
    /// The group of all pictures that are saved.
    pub outputs: OutputGroup,
}
