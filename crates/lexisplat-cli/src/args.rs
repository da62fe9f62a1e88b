//! The command line, as typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use lexisplat::{Layout, Pursuit};

use crate::exit::CODES;

/// Make trained 3D Gaussian Splatting scenes small, with a promised error, and draw and compare them.
#[derive(Debug, Parser)]
#[command(name = "lexisplat", version, after_help = CODES, max_term_width = 100)]
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
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Compress(Compress),
    Decompress(Decompress),
    Info(Info),
    Render(Render),
    Compare(Compare),
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
    /// Largest error of a Gaussian's SH vector (L2 norm, not squared). Half is about 6 dB better
    /// [default: 0.1, unless --max-nnz is given].
    #[arg(long, value_name = "T")]
    pub(crate) tol: Option<f64>,
    /// Most nonzeros of a Gaussian. Lifts the promise of --tol; what is over it is counted.
    #[arg(long, value_name = "K")]
    pub(crate) max_nnz: Option<u8>,
    /// Atoms of the dictionary, 1 to 1024 [default: twice the dimension, 90 for SH degree 3].
    #[arg(long, value_name = "M")]
    pub(crate) atoms: Option<usize>,
    /// How atoms are chosen: `ols` needs fewer, `omp` is the paper's.
    #[arg(long, default_value_t = Pursuit::Ols, value_name = "omp|ols")]
    pub(crate) pursuit: Pursuit,
    /// How codes are stored: `f16` is smallest, `paper` is the paper's own count.
    #[arg(long, default_value_t = Layout::F16, value_name = "f32|f16|paper")]
    pub(crate) layout: Layout,
    /// Use the dictionary of this file (a dictionary or a .lexi) instead of learning one.
    #[arg(long, value_name = "FILE", conflicts_with = "atoms")]
    pub(crate) dictionary: Option<PathBuf>,
    /// Also write the dictionary on its own, for other scenes.
    #[arg(long, value_name = "FILE")]
    pub(crate) save_dictionary: Option<PathBuf>,
    /// Gaussians to learn from at most.
    #[arg(long, default_value_t = lexisplat::learn::DEFAULT_SAMPLE, value_name = "N")]
    pub(crate) sample: usize,
    /// Seed of the learning sample.
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
    /// Leave out Gaussians with NaN or infinite values instead of refusing the file.
    #[arg(long)]
    pub(crate) drop_invalid: bool,
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
    /// Cameras from an INRIA cameras.json [default: an orbit fitted to the scene].
    #[arg(long, value_name = "FILE", conflicts_with = "orbit")]
    pub(crate) cameras: Option<PathBuf>,
    /// Use only the cameras marked with this split.
    #[arg(long, value_enum, default_value_t = Split::All, requires = "cameras")]
    pub(crate) split: Split,
    /// Views of the automatic orbit.
    #[arg(long, default_value_t = lexisplat_eval::DEFAULT_ORBIT, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) orbit: u16,
    /// Widest picture; wider cameras are scaled down.
    #[arg(long, default_value_t = lexisplat_eval::DEFAULT_MAX_WIDTH, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub(crate) width: u32,
    /// Colour behind the scene: `black`, `white`, or R,G,B from 0 to 1.
    #[arg(long, default_value = "black", value_parser = colour)]
    pub(crate) background: [f32; 3],
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Split {
    All,
    Train,
    Test,
}

impl From<Split> for lexisplat_eval::SplitFilter {
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
    fn colours_are_names_or_numbers() {
        assert_eq!(colour("white"), Ok([1.0; 3]));
        assert_eq!(colour("0, 0.5,1"), Ok([0.0, 0.5, 1.0]));
        for bad in ["red", "0,0", "0,0,2", "0,0,0,0", "0,x,0", "nan,0,0"] {
            assert!(colour(bad).is_err(), "{bad}");
        }
    }
}
