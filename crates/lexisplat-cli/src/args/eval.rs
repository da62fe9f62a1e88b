//! The options of `eval` and `sweep`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use lexisplat::packed::Preset;
use lexisplat::{Layout, Pursuit};
use lexisplat_sweep::Method;

use super::{Views, preset};

/// What to measure.
#[derive(Debug, Args)]
pub(crate) struct Measures {
    /// Also measure LPIPS with the weights in this file, made by `scripts/lpips_weights.py`; may be given twice, for VGG
    /// and Alex.
    #[arg(long, value_name = "FILE")]
    pub(crate) lpips: Vec<PathBuf>,
    /// Do not measure FLIP.
    #[arg(long)]
    pub(crate) no_flip: bool,
    /// Round pictures to 8 bits before scoring, as when they are saved and read back.
    #[arg(long = "8bit")]
    pub(crate) eight_bit: bool,
}

/// Photos to score against.
#[derive(Debug, Args)]
pub(crate) struct Photos {
    /// Folder of photos; they belong to the cameras of the same name. Without --split the test split is used.
    #[arg(long, value_name = "DIR", requires = "cameras")]
    pub(crate) images: Option<PathBuf>,
    /// Photos at one part in 1, 2, 4 or 8 of their size: from the folder `DIR_2` and so on if it is there.
    #[arg(long, value_name = "N", requires = "images")]
    pub(crate) resolution: Option<u32>,
}

/// Score models against photos, against their original, or both.
#[derive(Debug, Args)]
pub(crate) struct Eval {
    /// Models: PLY or .lexi.
    #[arg(required = true, value_name = "MODEL")]
    pub(crate) models: Vec<PathBuf>,
    /// What the models were made from: they are scored against its pictures.
    #[arg(long, value_name = "FILE")]
    pub(crate) original: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) photos: Photos,
    #[command(flatten)]
    pub(crate) views: Views,
    #[command(flatten)]
    pub(crate) measures: Measures,
    /// Also write the scores of every view to this file.
    #[arg(long, value_name = "FILE")]
    pub(crate) csv: Option<PathBuf>,
    /// Save each view to this folder: the photo, or else the original, beside the model and their amplified difference.
    #[arg(long, value_name = "DIR")]
    pub(crate) save_views: Option<PathBuf>,
}

/// Compress models in many ways, score and time them all: tables, figures and a report.
///
/// Finished points are kept in the output folder: run the same command again to go on after an interruption.
#[derive(Debug, Args)]
pub(crate) struct Sweep {
    /// Models, PLY files.
    #[arg(value_name = "MODEL", required_unless_present = "manifest")]
    pub(crate) models: Vec<PathBuf>,
    /// Name of a scene, for tables; may be given for each model, in their order [default: from the path].
    #[arg(long = "name", value_name = "NAME", value_parser = NonEmptyStringValueParser::new())]
    pub(crate) names: Vec<String>,
    /// Models with their methods, cameras and photos: a TOML file with a table `scene` for each
    /// (docs/EVALUATION.md). Models that do not exist are skipped and listed.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["models", "names", "cameras", "images", "method"])]
    pub(crate) manifest: Option<PathBuf>,
    /// Where relative paths in the manifest start [default: its folder].
    #[arg(long, value_name = "DIR", requires = "manifest")]
    pub(crate) root: Option<PathBuf>,
    /// Who trained the models, for tables.
    #[arg(long, value_name = "3dgs|mcmc|pixelgs|eagles|eagles-no-sq|other", default_value = "other")]
    pub(crate) method: Method,
    /// Tolerances [default, without --max-nnz and --presets: 0.03,0.05,0.1,0.2, the paper's].
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) tol: Vec<f64>,
    /// Caps on nonzeros, without a tolerance.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) max_nnz: Vec<u8>,
    /// Presets of packed files: small, balanced, high, archive.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = preset())]
    pub(crate) presets: Vec<Preset>,
    /// How atoms are chosen: `ols` needs fewer, `omp` is the paper's. Not for presets.
    #[arg(long, value_name = "omp|ols", default_value = "ols")]
    pub(crate) pursuit: Pursuit,
    /// Layout of the files with --tol and --max-nnz: f32, f16 or paper.
    #[arg(long, value_name = "f32|f16|paper", default_value = "f16")]
    pub(crate) layout: Layout,
    /// Seed of learning samples.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
    #[command(flatten)]
    pub(crate) photos: Photos,
    #[command(flatten)]
    pub(crate) views: Views,
    #[command(flatten)]
    pub(crate) measures: Measures,
    /// Do not measure frames a second.
    #[arg(long)]
    pub(crate) no_fps: bool,
    /// Views of each model whose pictures go into the report.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) pictures: usize,
    /// Folder for everything a sweep makes.
    #[arg(short, long, default_value = "lexisplat-sweep", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Make finished points again.
    #[arg(long)]
    pub(crate) fresh: bool,
    /// Date to print in the report, as text.
    #[arg(long, value_name = "TEXT")]
    pub(crate) date: Option<String>,
}
