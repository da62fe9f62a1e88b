//! The command line, as typed.

mod eval;
mod limits;

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use lexisplat::packed::Preset;
use lexisplat::{Geometry, Layout, Pursuit};
use lexisplat_eval::SplitFilter;
use lexisplat_eval::views::{ChosenViews, ViewOptions, find_views};
use lexisplat_render::gpu::ShPath;
use lexisplat_render::{Camera, Device};

pub(crate) use self::eval::{Eval, Measures, Photos, Sweep};
use crate::exit::AFTER_HELP;

/// Make trained 3D Gaussian Splatting scenes small, with a promised error, and draw and compare them.
#[derive(Debug, Parser)]
#[command(name = "lexisplat", version, after_help = AFTER_HELP, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options every command takes.
#[derive(Debug, Args)]
pub(crate) struct Common {
    /// Print one JSON object on standard output instead of text.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// No progress and no summary; warnings and errors still appear.
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Threads to use; 0 for all. Results do not depend on it.
    #[arg(long, global = true, default_value_t = 0, value_name = "N")]
    pub(crate) threads: usize,
    /// Replace outputs that exist.
    #[arg(long, global = true)]
    pub(crate) overwrite: bool,
    /// Most that a model or a dictionary may ask for; may be given again for another NAME. It is `gaussians`
    /// (by default 4294967294), `atoms` (1024), `nonzeros` of a Gaussian (72), `bytes` held at once, or read from
    /// a pipe (no limit), such as 2GiB, `expansion`, that is the same for each byte of the file (256),
    /// `header_bytes` (4MiB) or `properties` of an element of a PLY (4096). Exit code 6 if a file asks for more.
    #[arg(long = "limit", global = true, value_name = "NAME=N", value_parser = limits::limit)]
    limits: Vec<(String, u64)>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Compress(Compress),
    Decompress(Decompress),
    Info(Info),
    Render(Render),
    Compare(Compare),
    Eval(Eval),
    Sweep(Box<Sweep>),
    #[cfg(feature = "view")]
    View(View),
    Devices(Devices),
    Bench(Bench),
    Demo(Demo),
    Completions(Completions),
}

/// Compress a trained PLY to a .lexi file. No photos, no cameras, no retraining.
#[derive(Debug, Args)]
pub(crate) struct Compress {
    /// The scene, a PLY; `-` for standard input.
    pub(crate) input: PathBuf,
    /// The compressed scene; `-` for standard output [default: the input with extension .lexi].
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
    /// How good: `small`, `balanced`, `high` or `archive` [default: balanced].
    #[arg(long, value_parser = preset(), group = "goal", value_name = "NAME")]
    pub(crate) preset: Option<Preset>,
    /// The smallest file whose pictures reach this PSNR on average, in dB.
    #[arg(long, group = "goal", value_name = "DB")]
    pub(crate) psnr: Option<f64>,
    /// The smallest file whose worst picture reaches this PSNR, in dB.
    #[arg(long, group = "goal", value_name = "DB")]
    pub(crate) min_psnr: Option<f64>,
    /// The best file of at most this size, such as `10MB` or `800kB`.
    #[arg(long, group = "goal", value_name = "BYTES", value_parser = size)]
    pub(crate) size: Option<u64>,
    /// The best file this many times smaller than the PLY.
    #[arg(long, group = "goal", value_name = "R")]
    pub(crate) ratio: Option<f64>,
    /// Cameras to judge by: as for `render` [default: views generated around the scene].
    #[arg(long, value_name = "FILE")]
    pub(crate) cameras: Option<PathBuf>,
    /// Keep each Gaussian's index in the source, for 4 bytes each: packed files are in another order.
    #[arg(long)]
    pub(crate) keep_order: bool,
    /// Leave out Gaussians without which, all together, no pixel of any view changes by more than this many
    /// of 255 levels; 1 if no number is given. How many is reported.
    #[arg(long, value_name = "LEVELS", num_args = 0..=1, default_missing_value = "1", require_equals = true, conflicts_with = "keep_order")]
    pub(crate) prune: Option<f32>,
    /// TargetRecord: no Gaussian's SH vector is off by more (L2 norm, not squared). Without --layout everything
    /// else is then kept exactly (layout f16); with --layout packed it is quantised all the same.
    #[arg(long, value_name = "T")]
    pub(crate) tol: Option<f64>,
    /// Most nonzeros of a Gaussian. Lifts the promise of --tol; what is over it is counted.
    #[arg(long, value_name = "K")]
    pub(crate) max_nnz: Option<u8>,
    /// Atoms of the dictionary, 1 to 1024 [default: packed, as many as pay; else twice the dimension, 90
    /// for SH degree 3].
    #[arg(long, value_name = "M")]
    pub(crate) atoms: Option<usize>,
    /// How atoms are chosen: `ols` needs fewer, `omp` is the paper's. Not for packed files, which weigh
    /// bits against error [default: ols].
    #[arg(long, value_name = "omp|ols")]
    pub(crate) pursuit: Option<Pursuit>,
    /// `packed` quantises and entropy-codes everything; `f16` and `f32` keep geometry exactly; `paper` is
    /// the paper's own count [default: packed, or f16 with --tol, --max-nnz, --pursuit or a dictionary].
    #[arg(long, value_name = "packed|f32|f16|paper")]
    pub(crate) layout: Option<Layout>,
    /// Use the dictionary of this file (a dictionary or a .lexi) instead of learning one.
    #[arg(long, value_name = "FILE", conflicts_with = "atoms")]
    pub(crate) dictionary: Option<PathBuf>,
    /// Also write the dictionary on its own, for other scenes.
    #[arg(long, value_name = "FILE")]
    pub(crate) save_dictionary: Option<PathBuf>,
    /// Gaussians to learn from at most. Not for packed files [default: 65536].
    #[arg(long, value_name = "N")]
    pub(crate) sample: Option<usize>,
    /// Seed of the learning sample.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
    /// Leave out Gaussians with NaN or infinite values instead of refusing the file.
    #[arg(long)]
    pub(crate) drop_invalid: bool,
    /// Guess what shows from each Gaussian alone instead of looking at the scene: several times faster, and
    /// larger files of the same quality. Of the qualities only --preset can be had.
    #[arg(long, conflicts_with_all = ["psnr", "min_psnr", "size", "ratio", "cameras", "prune"])]
    pub(crate) guess: bool,
    /// Memory that packing a whole scene may take, about. A scene that needs more is packed part by part, each
    /// part by its own views, and of the qualities only --preset can be had. That takes up to 1.5 GiB, however
    /// small BYTES is: 0.3 GB for a million Gaussians. Files of the other layouts do not depend on it.
    #[arg(long, default_value = "2GiB", value_name = "BYTES", value_parser = size)]
    pub(crate) memory: u64,
    /// What looks at the scene and judges pictures: `cpu`, so that the same input gives the same file
    /// everywhere; or faster, and recorded in the file, `gpu`, `auto` or a number from `lexisplat devices`.
    #[arg(long, default_value = "cpu", value_name = "auto|cpu|gpu|N")]
    pub(crate) device: Device,
}

impl Compress {
    /// Options that only layouts with exact geometry have, as given.
    fn exact_only(&self) -> [(&'static str, bool); 5] {
        [
            ("--max-nnz", self.max_nnz.is_some()),
            ("--pursuit", self.pursuit.is_some()),
            ("--dictionary", self.dictionary.is_some()),
            ("--save-dictionary", self.save_dictionary.is_some()),
            ("--sample", self.sample.is_some()),
        ]
    }

    /// Options that only packed files have, as given.
    fn packed_only(&self) -> [(&'static str, bool); 9] {
        [
            ("--guess", self.guess),
            ("--preset", self.preset.is_some()),
            ("--psnr", self.psnr.is_some()),
            ("--min-psnr", self.min_psnr.is_some()),
            ("--size", self.size.is_some()),
            ("--ratio", self.ratio.is_some()),
            ("--cameras", self.cameras.is_some()),
            ("--keep-order", self.keep_order),
            ("--prune", self.prune.is_some()),
        ]
    }

    /// The layout asked for, or the one the other options ask for.
    ///
    /// # Errors
    /// Two options that do not go together.
    pub(crate) fn chosen_layout(&self) -> Result<Layout, lexisplat::Error> {
        let given = |options: &[(&'static str, bool)]| options.iter().find(|o| o.1).map(|o| o.0);
        let (exact, packed) = (given(&self.exact_only()), given(&self.packed_only()));
        let layout = self.layout.unwrap_or(match (exact, packed, self.tol) {
            (None, Some(_), _) | (None, None, None) => Layout::Packed,
            _ => Layout::F16,
        });
        let wrong = if layout == Layout::Packed { exact } else { packed };
        match wrong {
            None => Ok(layout),
            Some(option) => {
                let other = if layout == Layout::Packed { "f16, f32 or paper" } else { "packed" };
                Err(lexisplat::Error::parameter("layout", layout, format!("{other}, which {option} is for")))
            }
        }
    }
}

/// The names of presets, as `clap` lists and checks them.
fn preset() -> impl TypedValueParser<Value = Preset> {
    PossibleValuesParser::new(Preset::ALL.map(Preset::name)).try_map(|name| name.parse::<Preset>())
}

/// The names of ways to hold SH, as `clap` lists and checks them.
fn sh_path() -> impl TypedValueParser<Value = ShPath> {
    PossibleValuesParser::new(ShPath::ALL.map(ShPath::name)).try_map(|name| name.parse::<ShPath>())
}

/// A number of bytes: plain, or with kB, MB, GB (powers of 1000) or KiB, MiB, GiB (of 1024).
fn size(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kb" => 1e3,
        "m" | "mb" => 1e6,
        "g" | "gb" => 1e9,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        _ => return Err("a size such as 800kB, 10MB or 1.5MiB".to_owned()),
    };
    match digits.trim().parse::<f64>() {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        Ok(v) if v.is_finite() && v > 0.0 && v * unit < 1e18 => Ok((v * unit) as u64),
        _ => Err("a size such as 800kB, 10MB or 1.5MiB".to_owned()),
    }
}

/// Turn a .lexi file back into a PLY in INRIA's layout.
#[derive(Debug, Args)]
pub(crate) struct Decompress {
    /// The compressed scene; `-` for standard input.
    pub(crate) input: PathBuf,
    /// The PLY; `-` for standard output [default: the input with extension .ply].
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
}

/// Say what a PLY or .lexi file holds, and what looks wrong with it.
#[derive(Debug, Args)]
pub(crate) struct Info {
    /// The file; `-` for standard input.
    pub(crate) file: PathBuf,
    /// Leave out Gaussians with NaN or infinite values instead of refusing the file.
    #[arg(long)]
    pub(crate) drop_invalid: bool,
}

/// Which cameras to draw from, and on what.
#[derive(Debug, Args)]
pub(crate) struct Views {
    /// Cameras: INRIA's cameras.json, a transforms.json of nerfstudio, or a COLMAP folder such as
    /// sparse/0 [default: views that fit the scene].
    #[arg(long, visible_alias = "sparse", value_name = "PATH", conflicts_with_all = ["orbit", "scene"])]
    pub(crate) cameras: Option<PathBuf>,
    /// Which of the cameras: those marked so, or, if none is marked, every 8th by name as test [default: all,
    /// and test with photos].
    #[arg(long, value_enum, requires = "cameras")]
    pub(crate) split: Option<Split>,
    /// Every how manyeth camera by name is a test one, where cameras are not marked.
    #[arg(long, default_value_t = lexisplat_eval::views::DEFAULT_HOLD, value_name = "N", requires = "cameras")]
    pub(crate) hold: usize,
    /// What kind of scene generated views are for: an `object` seen from around, a `room` seen from inside, or
    /// `auto` to judge by the scene.
    #[arg(long, value_enum, default_value_t = SceneKind::Auto)]
    pub(crate) scene: SceneKind,
    /// Number of generated views.
    #[arg(long, default_value_t = lexisplat_eval::DEFAULT_ORBIT, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) orbit: u16,
    /// Widest picture; wider cameras are scaled down.
    #[arg(long, default_value_t = lexisplat_eval::DEFAULT_MAX_WIDTH, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub(crate) width: u32,
    /// Colour behind the scene: `black`, `white`, or R,G,B from 0 to 1.
    #[arg(long, default_value = "black", value_parser = colour)]
    pub(crate) background: [f32; 3],
    /// What to draw on: `auto` (a GPU if there is one that is not software), `cpu`, `gpu`, or a number from
    /// `lexisplat devices`.
    #[arg(long, default_value = "auto", value_name = "auto|cpu|gpu|N")]
    pub(crate) device: Device,
}

impl Views {
    /// The views that these options mean for a scene.
    pub(crate) fn find(
        &self,
        geometry: &Geometry,
        photos: Option<&Photos>,
    ) -> lexisplat_eval::Result<ChosenViews> {
        let mut options = ViewOptions::default();
        options.cameras.clone_from(&self.cameras);
        options.hold = self.hold;
        options.kind = self.scene.into();
        options.count = self.orbit;
        options.max_width = self.width;
        if let Some(photos) = photos {
            options.images.clone_from(&photos.images);
            options.resolution = photos.resolution;
        }
        let with_photos = options.images.is_some();
        options.split = match self.split {
            Some(split) => split.into(),
            None if with_photos => SplitFilter::Test,
            None => SplitFilter::All,
        };
        find_views(&options, geometry)
    }

    /// The cameras that these options mean for a scene; warnings about them are printed.
    pub(crate) fn choose(&self, geometry: &Geometry) -> lexisplat_eval::Result<Vec<Camera>> {
        let found = self.find(geometry, None)?;
        crate::files::warn("views", &found.warnings);
        Ok(found.views.into_iter().map(|view| view.camera).collect())
    }
}

/// What kind of scene views are generated for.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum SceneKind {
    Auto,
    Object,
    Room,
}

impl From<SceneKind> for lexisplat_eval::views::SceneKind {
    fn from(kind: SceneKind) -> Self {
        match kind {
            SceneKind::Auto => Self::Auto,
            SceneKind::Object => Self::Object,
            SceneKind::Room => Self::Room,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Split {
    All,
    Train,
    Test,
}

impl From<Split> for SplitFilter {
    fn from(split: Split) -> Self {
        match split {
            Split::All => Self::All,
            Split::Train => Self::Train,
            Split::Test => Self::Test,
        }
    }
}

/// Draw a scene to PNG files; a .lexi straight from its sparse codes.
#[derive(Debug, Args)]
pub(crate) struct Render {
    /// A PLY or .lexi; `-` for standard input.
    pub(crate) file: PathBuf,
    /// Folder for the pictures [default: the file's name with `-views`].
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) views: Views,
}

/// Draw two scenes from the same cameras and score the second against the first.
#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// The original: PLY or .lexi.
    pub(crate) a: PathBuf,
    /// The other: PLY or .lexi.
    pub(crate) b: PathBuf,
    #[command(flatten)]
    pub(crate) views: Views,
    /// Round pictures to 8 bits before scoring, as when they are saved and read back.
    #[arg(long = "8bit")]
    pub(crate) eight_bit: bool,
    /// Save both pictures and their amplified difference, side by side, to this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) save_views: Option<PathBuf>,
}

/// Open a window on one or two scenes: fly, wipe, difference, live PSNR, compress.
///
/// Drag to orbit, with shift to pan, with ctrl to look around; wheel to come nearer; W A S D Q E to fly; the square
/// brackets for the cameras; 1 to 5 for first, second, side by side, wipe, difference; P for a screenshot. A file
/// dropped on the window becomes the second model, or the first if shift is held or none is open.
#[cfg(feature = "view")]
#[derive(Debug, Args)]
#[command(after_long_help = lexisplat_view::SCRIPT_WORDS)]
pub(crate) struct View {
    /// One or two scenes: PLY or .lexi.
    #[arg(required = true, num_args = 1..=2, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) views: Views,
    /// For tests and recordings: what to do without being asked, such as `camera=3,mode=wipe,screenshot=a.png,quit`.
    #[arg(long, value_name = "WORDS", default_value = "", hide_default_value = true)]
    pub(crate) actions: String,
}

/// Time drawing, stage by stage, with SH held in every way the scene has.
///
/// Every view is drawn repeatedly after a warm-up; only drawing is timed, on a GPU by its own time stamps.
#[derive(Debug, Args)]
pub(crate) struct Bench {
    /// A PLY or .lexi; a .lexi is also drawn dense.
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) views: Views,
    /// Frames timed from each view.
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) repeat: u32,
    /// Frames drawn from each view before that.
    #[arg(long, default_value_t = 3, value_name = "N")]
    pub(crate) warmup: u32,
    /// Frames timed from each view on the processor; 0 for none.
    #[arg(long, default_value_t = 3, value_name = "N")]
    pub(crate) cpu_repeat: u32,
    /// Ways to hold SH, of dense-f32, dense-f16, sparse, sparse-ordered, sparse-shared and sparse-table [default: all].
    #[arg(long, value_delimiter = ',', value_name = "NAMES", value_parser = sh_path())]
    pub(crate) paths: Vec<ShPath>,
}

/// List the GPUs that can draw, best first.
#[derive(Debug, Args)]
pub(crate) struct Devices {}

/// Make a sample scene, compress, draw and compare it, and write a report to look at.
#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Folder for everything the demo makes.
    #[arg(short, long, default_value = "lexisplat-demo")]
    pub(crate) output: PathBuf,
    /// Gaussians of the scene.
    #[arg(long, default_value_t = 60_000, value_name = "N")]
    pub(crate) gaussians: usize,
    /// Seed of the scene and of the learning sample.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
}

/// Print completions for a shell.
#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// The shell.
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

/// A colour: a name, or three numbers from 0 to 1.
fn colour(text: &str) -> Result<[f32; 3], String> {
    match text {
        "black" => return Ok([0.0; 3]),
        "white" => return Ok([1.0; 3]),
        _ => {}
    }
    let parts: Vec<f32> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match <[f32; 3]>::try_from(parts) {
        Ok(c) if text.split(',').count() == 3 && c.iter().all(|v| (0.0..=1.0).contains(v)) => Ok(c),
        _ => Err("`black`, `white`, or three numbers from 0 to 1 such as 0.2,0.2,0.2".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn sizes_have_units() {
        assert_eq!(size("10MB"), Ok(10_000_000));
        assert_eq!(size("1.5KiB"), Ok(1536));
        assert_eq!(size("77"), Ok(77));
        for bad in ["", "MB", "-3kB", "10 furlongs", "1e30GB"] {
            assert!(size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn colours_are_names_or_numbers() {
        assert_eq!(colour("white"), Ok([1.0; 3]));
        assert_eq!(colour("0, 0.5,1"), Ok([0.0, 0.5, 1.0]));
        for bad in ["red", "0,0", "0,0,2", "0,0,0,0", "0,x,0", "nan,0,0"] {
            assert!(colour(bad).is_err(), "{bad}");
        }
    }
}
