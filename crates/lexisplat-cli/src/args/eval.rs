//! The options of `eval` and `sweep`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use lexisplat::packed::Preset;
use lexisplat::{Layout, Pursuit};
use lexisplat_sweep::Method;

use super::values::{preset, real, whole};
use super::views::{Photos, Views};

/// The measures of quality.
#[derive(Debug, Args)]
pub(crate) struct Measures {
    /// File of LPIPS weights; LPIPS is measured too. `scripts/lpips_weights.py` makes the file. The option may be given
    /// twice, for VGG and for AlexNet.
    #[arg(long, value_name = "FILE")]
    pub(crate) lpips: Vec<PathBuf>,
    /// Do not measure FLIP.
    #[arg(long)]
    pub(crate) no_flip: bool,
    /// Round pictures to 8 bits before scoring, as in saved pictures.
    #[arg(long = "8bit")]
    pub(crate) eight_bit: bool,
}

/// Score models against photos, against their original model, or both.
#[derive(Debug, Args)]
pub(crate) struct Eval {
    /// The models to score, of any format.
    #[arg(required = true, value_name = "MODEL")]
    pub(crate) models: Vec<PathBuf>,
    /// The model from which the others were made, of any format. The others are scored against its pictures.
    #[arg(long, value_name = "FILE")]
    pub(crate) original: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) photos: Photos,
    #[command(flatten)]
    pub(crate) views: Views,
    #[command(flatten)]
    pub(crate) measures: Measures,
    /// CSV file for the scores of every view.
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Folder for a picture of each view: the photo (the original's picture if there are no photos), the model's
    /// picture and their amplified difference, side by side.
    #[arg(long, value_name = "DIR")]
    pub(crate) save_views: Option<PathBuf>,
}

/// Compress models in many ways, score and time the results, and write tables, figures and a report.
///
/// Finished points are kept in the output folder. To continue after an interruption, run the same command again.
#[derive(Debug, Args)]
pub(crate) struct Sweep {
    /// The models to compress, of any format but .lexi.
    #[arg(value_name = "MODEL", required_unless_present = "manifest")]
    pub(crate) models: Vec<PathBuf>,
    /// Name of the first model's scene in the tables. The option may be given again for the next models, in their order
    /// [default: a name made of the path].
    #[arg(long = "name", value_name = "NAME", value_parser = NonEmptyStringValueParser::new())]
    pub(crate) names: Vec<String>,
    /// A TOML file that lists models with their methods, cameras and photos, each in a table `scene`
    /// (docs/EVALUATION.md). Models that do not exist are skipped and listed in the report.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["models", "names", "cameras", "images", "method"])]
    pub(crate) manifest: Option<PathBuf>,
    /// Folder from which relative paths in the manifest start [default: the manifest's folder].
    #[arg(long, value_name = "DIR", requires = "manifest")]
    pub(crate) root: Option<PathBuf>,
    /// Method that trained the models, for the tables.
    #[arg(long, value_name = "3dgs|mcmc|pixelgs|eagles|eagles-no-sq|other", default_value = "other")]
    pub(crate) method: Method,
    /// Tolerances of exact files to make, each above 0, with commas between them
    /// [default: the tolerances of the paper, 0.03,0.05,0.1,0.2; none if --max-nonzeros or --presets is given].
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = real::<f64>("0.1"))]
    pub(crate) tol: Vec<f64>,
    /// Caps on the nonzeros of a Gaussian for exact files without a tolerance, with commas between them, such as
    /// 4,8,16.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = whole::<u8>(0..=255))]
    pub(crate) max_nonzeros: Vec<u8>,
    /// Presets of packed files to make, with commas between them, such as small,balanced.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = preset())]
    pub(crate) presets: Vec<Preset>,
    /// Pursuit that chooses the atoms, with --tol and --max-nonzeros. `omp` is the pursuit of the paper, whose numbers
    /// the tables list beside the results; `ols`, the default of `compress`, needs fewer atoms.
    #[arg(long, value_name = "omp|ols", default_value = "omp")]
    pub(crate) pursuit: Pursuit,
    /// Layout of the files made with --tol and --max-nonzeros.
    #[arg(long, value_name = "f32|f16|paper", default_value = "f16")]
    pub(crate) layout: Layout,
    /// Seed of the random choice of Gaussians from which dictionaries are learned.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX))]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) photos: Photos,
    #[command(flatten)]
    pub(crate) views: Views,
    #[command(flatten)]
    pub(crate) measures: Measures,
    /// Do not measure frames per second.
    #[arg(long)]
    pub(crate) no_fps: bool,
    /// Number of views of each model whose pictures the report shows.
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = whole::<usize>(0..=u64::MAX))]
    pub(crate) pictures: usize,
    /// Folder for all output of the sweep.
    #[arg(short, long, default_value = "lexisplat-sweep", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Make all points again, finished ones too.
    #[arg(long)]
    pub(crate) fresh: bool,
    /// Date that the report prints, as text [default: none].
    #[arg(long, value_name = "TEXT")]
    pub(crate) date: Option<String>,
}
