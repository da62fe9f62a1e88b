//! A viewer of one or two 3D Gaussian Splatting scenes: its commands, its state, and a window.
//!
//! The core is independent of windows. Keys, gestures, scripts and links make [`Command`]s. A [`State`] applies them and holds what
//! is shown and from where:
//!
//! ```
//! use lexisplat_render::Camera;
//! use lexisplat_view::{Drag, SceneBounds, State, keys, script};
//!
//! let camera = Camera {
//!     name: "front".into(),
//!     width: 640,
//!     height: 480,
//!     fx: 500.0,
//!     fy: 500.0,
//!     position: [0.0, 0.0, -4.0],
//!     rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
//!     near: 0.2,
//!     split: None,
//!     tiles: None,
//!     background: None,
//! };
//! let mut state = State::new([0.0; 3]);
//! state.set_open([true, false]);
//! state.set_cameras(vec![camera], true, SceneBounds::new(([0.0; 3], 1.0), 0.02, &[]));
//! for command in script::parse("orbit=30:10,degree=1")? {
//!     state.apply(&command);
//! }
//! state.drag(Drag::Pan, 0.1, 0.0);
//! if let Some(command) = keys::command_of_key("f") {
//!     state.apply(&command);
//! }
//! let link = state.link();
//! state.apply_link(&link)?;
//! assert_eq!(state.link(), link);
//! # Ok::<(), lexisplat::Error>(())
//! ```
//!
//! Without the default feature `window` the crate has this core alone, which also compiles for a browser. With the feature `gpu`,
//! `Presenter` shows one or two pictures on any surface of wgpu, and `Composer` composes them in memory.
//!
//! With the feature `window`, `run` opens the window and returns when the window is closed. Buttons and dropped files make commands
//! as well. A thread of its own draws the pictures, so that the window responds however long a picture takes.
//!
//! | module | purpose |
//! |---|---|
//! | `command`, [`keys`], [`script`] | all commands; their keys; their words in scripts |
//! | `state` | the shown scenes and the camera |
//! | `camera_controller`, `gesture` | orbiting, panning and flying; the effect of mouse, fingers and held keys |
//! | `link` | a link to exactly the view shown |
//! | `picture`, `present`, `compose` | with `gpu`: one or two pictures on screen, or in memory |
//! | `models` | with `window`: reading and compressing on threads of their own |
//! | `scene_renderer`, `render_thread` | with `window`: drawing by the GPU or the CPU, and its thread |
//! | `app`, `command_handlers`, `viewport`, `present_callback`, `panel` | the window, its commands, its picture, its controls |

#[cfg(feature = "window")]
mod app;
mod camera_controller;
mod command;
#[cfg(feature = "window")]
mod command_handlers;
#[cfg(feature = "gpu")]
mod compose;
mod error;
mod gesture;
#[cfg(feature = "window")]
mod given_cameras;
pub mod keys;
mod link;
#[cfg(feature = "window")]
mod models;
#[cfg(feature = "window")]
mod options;
#[cfg(feature = "window")]
mod panel;
#[cfg(feature = "gpu")]
mod picture;
#[cfg(feature = "gpu")]
mod present;
#[cfg(feature = "window")]
mod present_callback;
#[cfg(feature = "window")]
mod render_thread;
#[cfg(feature = "window")]
mod scene_renderer;
pub mod script;
mod state;
#[cfg(feature = "window")]
mod viewport;
#[cfg(feature = "window")]
mod window;
#[cfg(feature = "window")]
mod window_frame;

pub use camera_controller::{CameraController, SceneBounds, fitted};
pub use command::{Command, Mode, Quality, Slot};
#[cfg(feature = "gpu")]
pub use compose::{Composer, Rgb8Image};
pub use error::{Error, Result};
pub use gesture::Drag;
/// Vectors of three numbers in double precision, used by [`SceneBounds`] and [`keys::flight`].
pub use glam::DVec3;
#[cfg(feature = "window")]
pub use options::Options;
#[cfg(feature = "gpu")]
pub use picture::Picture;
#[cfg(feature = "gpu")]
pub use present::{Composition, Presenter};
/// The words of a script and their meanings, for `--help`.
pub use script::WORDS as SCRIPT_WORDS;
pub use state::{Arrangement, State};
#[cfg(feature = "window")]
pub use window::run;
