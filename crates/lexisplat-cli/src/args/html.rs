//! The options of `html`.

use std::path::PathBuf;

use clap::Args;

/// Write one web page that shows a scene: viewer and scene in a file that opens from disk and loads nothing else.
///
/// Browsers with WebGPU draw the scene, from its codes if it is a .lexi. Others show a still picture. A second scene is
/// compared with the first by a wipe line. The page has a small bar; `--tools` gives it the whole panel with figures and
/// files. Without a scene the page is a viewer to drop files on.
#[derive(Debug, Args)]
pub(crate) struct Html {
    /// The scene, and one to compare it with, of any format; `-` reads standard input. A .lexi is smallest. A SOG of
    /// several files becomes one.
    #[arg(num_args = 0..=2, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// The page [default: the scene's name with the extension html].
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Title of the page [default: the scene's name].
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,
    /// The still picture, a PNG or JPEG [default: one that is drawn of the scene].
    #[arg(long, value_name = "FILE", conflicts_with = "no_poster")]
    pub(crate) poster: Option<PathBuf>,
    /// Put no still picture into the page.
    #[arg(long)]
    pub(crate) no_poster: bool,
    /// Show the whole panel: files, views, drawing, figures.
    #[arg(long)]
    pub(crate) tools: bool,
    /// Do not turn the scene by itself. Without this it turns until somebody touches it.
    #[arg(long)]
    pub(crate) still: bool,
    /// What the page shows first, in the words of `lexisplat view --actions`, such as `mode=wipe,split=0.3,degree=0`.
    #[arg(long, value_name = "WORDS", default_value = "", hide_default_value = true)]
    pub(crate) actions: String,
}
