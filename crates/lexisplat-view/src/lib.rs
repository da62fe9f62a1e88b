//! A window that shows one or two 3D Gaussian Splatting scenes.
//!
//! [`run`] opens it and returns when it is closed. Everything a key, a button, a dropped file or a script
//! does is a command to one state, which knows no window and is tested without; drawing happens on a
//! thread of its own behind a trait, so that the window stays alive however long a picture takes.
//!
//! | module | one idea |
//! |---|---|
//! | `command`, `keys`, `script` | what can be asked for; by which key; in which words |
//! | `state` | what is shown and from where |
//! | `eye` | orbiting, panning and flying |
//! | `models` | reading and compressing on worker threads |
//! | `painter`, `painting` | pictures of scenes; the thread that makes them |
//! | `present`, `compose` | one or two pictures on screen, or in a file |
//! | `app`, `deeds`, `stage`, `panel` | the window's life, what commands do to it, its picture, its controls |

mod app;
mod command;
mod compose;
mod deeds;
mod error;
mod eye;
mod keys;
mod models;
mod painter;
mod painting;
mod panel;
mod present;
mod script;
mod stage;
mod state;
mod window;

use std::path::PathBuf;

use lexisplat::Limits;
use lexisplat_eval::SplitFilter;
use lexisplat_render::Device;

pub use error::{Error, Result};
pub use window::run;

/// What the words of a script mean; for `--help`.
pub use script::WORDS as SCRIPT_WORDS;

/// What to show, and how to begin.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// One or two scenes: PLY or .lexi.
    pub files: Vec<PathBuf>,
    /// Cameras from an INRIA `cameras.json`; without, an orbit fitted to the first scene.
    pub cameras: Option<PathBuf>,
    /// Which of those cameras.
    pub split: SplitFilter,
    /// Views of the orbit, at least 1.
    pub orbit: u16,
    /// Widest picture of a camera's screenshot, in pixels, at least 1.
    pub max_width: u32,
    /// Colour behind the scenes, 0 to 1 in each channel.
    pub background: [f32; 3],
    /// What draws. The window itself always needs an adapter, if only one in software.
    pub device: Device,
    /// Whether a screenshot asked for by name may replace a file.
    pub overwrite: bool,
    /// What files may ask for, those dropped on the window too.
    pub limits: Limits,
    /// What to do without being asked: see [`SCRIPT_WORDS`]. Empty for nothing.
    pub script: String,
}
