//! The options of `html`.

use std::path::PathBuf;

use clap::Args;

/// Write one web page that shows a scene. Viewer and scene are in one file, which opens from disk and loads nothing
/// else.
///
/// Browsers draw the scene by WebGPU, or on the processor where there is none; a .lexi is drawn from its codes. Browsers that can do
/// neither show a still picture. A wipe line compares the first scene with the second, if there is one. The page has a small bar; `--tools` shows the whole
/// panel with figures and files. Without a scene the page is a viewer for files that are dropped on it.
#[derive(Debug, Args)]
pub(crate) struct Html {
    /// The scene and, if wanted, a second scene to compare it with, of any format; `-` reads standard input. A .lexi
    /// makes the smallest page. A SOG of several files is stored as one file.
    #[arg(num_args = 0..=2, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// The page [default: the scene's name with extension .html].
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Title of the page [default: the scene's name].
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,
    /// The still picture, a PNG or JPEG [default: a picture drawn of the scene].
    #[arg(long, value_name = "FILE", conflicts_with = "no_poster")]
    pub(crate) poster: Option<PathBuf>,
    /// Put no still picture into the page.
    #[arg(long)]
    pub(crate) no_poster: bool,
    /// Show the whole panel: files, views, drawing and figures.
    #[arg(long)]
    pub(crate) tools: bool,
    /// Keep the scene still. Without this option the scene turns until somebody touches it.
    #[arg(long)]
    pub(crate) still: bool,
    /// First view of the page, in the words of `lexisplat view --actions`, such as `mode=wipe,split=0.3,degree=0`.
    #[arg(long, value_name = "WORDS", default_value = "", hide_default_value = true)]
    pub(crate) actions: String,
}
