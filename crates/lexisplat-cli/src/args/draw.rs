//! The options of the commands that draw: `render`, `compare`, `view` and `bench`.

use std::path::PathBuf;

use clap::Args;
use lexisplat_render::gpu::ShPath;

use super::part::Part;
use super::values::{sh_path, size, whole};
use super::views::Views;

/// Draw a scene to PNG files. A .lexi is drawn from its sparse codes, without dense SH.
#[derive(Debug, Args)]
pub(crate) struct Render {
    /// The scene, of any format (docs/FORMATS.md); `-` reads standard input.
    pub(crate) file: PathBuf,
    /// Folder for the pictures [default: the scene's name with `-views` added].
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Draw one picture instead, a PNG or a JPEG by its name, of the view from which viewers show the scene first.
    /// It has 1280 x 720 pixels; --width makes it smaller.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["output", "cameras", "orbit", "viewpoints", "budget"])]
    pub(crate) poster: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) part: Part,
    /// Draw each view of a packed file with at most N Gaussians: near and visible chunks in full, the others from the
    /// first layers. Only the ranges of the file that a view needs are read, decoded and held. `compress --lod`
    /// makes files for it.
    #[arg(long, value_name = "N", value_parser = whole::<u64>(1..=u64::MAX), conflicts_with = "first")]
    pub(crate) budget: Option<u64>,
    /// With --budget, hold at most this many bytes of the file at a time, such as 16MB [default: no limit].
    #[arg(long, value_name = "SIZE", value_parser = size, requires = "budget")]
    pub(crate) budget_bytes: Option<u64>,
    #[command(flatten)]
    pub(crate) views: Views,
}

/// Draw two scenes from the same cameras and score the second against the first.
///
/// Without --cameras, --orbit and --views, cameras that lie beside A are used, if they seem to belong to the scene: the
/// test cameras if some are marked, and at most 24. If there are none, a search finds views like photographs, as sharp
/// as the scene, as in `compress`.
#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// The original scene, of any format.
    pub(crate) a: PathBuf,
    /// The scene to score against the original, of any format.
    pub(crate) b: PathBuf,
    #[command(flatten)]
    pub(crate) views: Views,
    /// Ignore cameras that lie beside A, one folder above it or where INRIA's trainer leaves them.
    #[arg(long, conflicts_with = "cameras")]
    pub(crate) no_cameras: bool,
    /// Round pictures to 8 bits before scoring, as in saved pictures.
    #[arg(long = "8bit")]
    pub(crate) eight_bit: bool,
    /// Folder for a picture of each view: both scenes and their amplified difference, side by side.
    #[arg(long, value_name = "DIR")]
    pub(crate) save_views: Option<PathBuf>,
}

/// Open a window on one or two scenes: fly, compare, measure PSNR, compress.
///
/// Drag to orbit. Drag with shift to pan, with ctrl to look around. Turn the wheel to come nearer. W A S D Q E fly.
/// The square brackets choose a camera. 1 to 5 show the first scene, the second, both side by side, both with a wipe
/// between them, or their difference. P saves a screenshot. A file dropped on the window becomes the second scene; it
/// becomes the first if shift is held or no scene is open.
#[cfg(feature = "view")]
#[derive(Debug, Args)]
#[command(after_long_help = lexisplat_view::SCRIPT_WORDS)]
pub(crate) struct View {
    /// One or two scenes, of any format.
    #[arg(required = true, num_args = 1..=2, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) views: Views,
    /// Actions for tests and recordings, such as `camera=3,mode=wipe,screenshot=a.png,quit`. The end of `lexisplat view
    /// --help` lists the words.
    #[arg(long, value_name = "WORDS", default_value = "", hide_default_value = true)]
    pub(crate) actions: String,
}

/// Measure how long each stage of drawing takes, for each way of holding SH in memory.
///
/// Each view is drawn --warmup times and then --repeat times on the GPU, --cpu-repeat times on the CPU. Only drawing is
/// timed. A GPU is timed by its own time stamps.
#[derive(Debug, Args)]
pub(crate) struct Bench {
    /// The scene, of any format. A .lexi is also drawn with dense SH; on the CPU, a frame of each in turn.
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) views: Views,
    /// Number of timed frames of each view on the GPU; at least 1.
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = whole::<u32>(1..=u64::from(u32::MAX)))]
    pub(crate) repeat: u32,
    /// Number of frames drawn of each view before the timed frames.
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = whole::<u32>(0..=u64::from(u32::MAX)))]
    pub(crate) warmup: u32,
    /// Number of timed frames of each view on the CPU; 0 leaves the CPU out.
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = whole::<u32>(0..=u64::from(u32::MAX)))]
    pub(crate) cpu_repeat: u32,
    /// Ways of holding SH in GPU memory to measure, with commas between them [default: all that the scene allows].
    #[arg(long, value_delimiter = ',', value_name = "NAMES", value_parser = sh_path())]
    pub(crate) paths: Vec<ShPath>,
}
