//! The options of `compress` and `decompress`.

use std::path::PathBuf;

use clap::Args;
use lexisplat::packed::Preset;
use lexisplat::{Layout, Pursuit};
use lexisplat_compress::{Viewpoints, choose_layout};
use lexisplat_render::Device;

use super::part::Part;
use super::values::{length, preset, real, size, viewpoints, whole};

/// Heading of the options that say how good or how small the file shall be.
const TARGET: &str = "Target, at most one of";
/// Heading of the options that packed files do not have.
const EXACT: &str = "Options of the layouts f16, f32 and paper";

/// Compress a trained scene to a .lexi file. Needs no photos, no cameras and no retraining.
#[derive(Debug, Args)]
pub(crate) struct Compress {
    /// The scene: a PLY, best the trainer's own, or SPZ, SOG, compressed.ply, .splat, .ksplat or glTF;
    /// `-` reads standard input. Several are the tiles of one scene, of the same SH degree and with the same properties,
    /// and become one file.
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// The compressed file; `-` writes to standard output [default: the input's name with extension .lexi, if there is one
    /// input].
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
    /// Quality of the pictures, from the smallest files to the best pictures: about 35, 40, 45 and 54 dB of PSNR
    /// [default: balanced].
    #[arg(long, value_parser = preset(), group = "goal", value_name = "NAME", help_heading = TARGET)]
    pub(crate) preset: Option<Preset>,
    /// Make the smallest file that has at least this PSNR on average over the views that it is judged by, in dB,
    /// above 0.
    #[arg(long, group = "goal", value_name = "DB", value_parser = real::<f64>("40"), help_heading = TARGET)]
    pub(crate) psnr: Option<f64>,
    /// Make the smallest file that has at least this PSNR in each of the views that it is judged by, in dB, above 0.
    /// Other views may be worse.
    #[arg(long, group = "goal", value_name = "DB", value_parser = real::<f64>("40"), help_heading = TARGET)]
    pub(crate) min_psnr: Option<f64>,
    /// Make the best file of at most this size, such as 10MB or 800kB.
    #[arg(long, group = "goal", value_name = "BYTES", value_parser = size, help_heading = TARGET)]
    pub(crate) size: Option<u64>,
    /// Make the best file that is at least this many times smaller than the source, above 1.
    #[arg(long, group = "goal", value_name = "R", value_parser = real::<f64>("20"), help_heading = TARGET)]
    pub(crate) ratio: Option<f64>,
    /// Cameras to draw and judge the scene from: a cameras.json, a transforms.json or a COLMAP folder [default: cameras that
    /// lie beside the scene or one folder above, or where INRIA's trainer leaves them; else views like photographs, which are
    /// looked for].
    #[arg(long, value_name = "PATH")]
    pub(crate) cameras: Option<PathBuf>,
    /// Use no cameras that lie beside the scene.
    #[arg(long, conflicts_with = "cameras")]
    pub(crate) no_cameras: bool,
    /// Distance of the near plane of --cameras, in the scene's units, above 0. Gaussians nearer than it are not drawn
    /// [default: the trainer's 0.2].
    #[arg(long, value_name = "UNITS", value_parser = length, requires = "cameras")]
    pub(crate) near: Option<f32>,
    /// Draw and judge the scene from around an `object` or from inside a `room`. `auto` looks for views like
    /// photographs [default: auto].
    #[arg(long, value_parser = viewpoints(), conflicts_with = "cameras")]
    pub(crate) views: Option<Viewpoints>,
    /// Store the index that each Gaussian has in the source, 1 to 3 bytes each. Without it packed files lose the
    /// order of the source.
    #[arg(long)]
    pub(crate) keep_order: bool,
    /// Leave no Gaussian out. Otherwise those that show less than their bits are worth are left out, and base colours
    /// and opacities make up for them and for errors. --keep-order and --tol leave none out either.
    #[arg(long)]
    pub(crate) keep_all: bool,
    /// Leave out Gaussians that show least until at most N stay, for viewers with a limit. --preset is then the quality of the
    /// file beside the smaller scene. --psnr and --min-psnr compare it with the original scene [default: no limit].
    #[arg(long, value_name = "N", value_parser = whole::<usize>(1..=u64::MAX), conflicts_with_all = ["keep_all", "keep_order", "tol", "guess"])]
    pub(crate) max_gaussians: Option<usize>,
    /// Largest error of any Gaussian's SH vector, above 0: the L2 norm of the difference, not squared. The encoder
    /// verifies it for every Gaussian. Without --layout everything else is kept exactly (layout f16). With
    /// --layout packed everything else is quantised [default: 0.1 with exact geometry, otherwise none].
    #[arg(long, value_name = "T", value_parser = real::<f64>("0.1"))]
    pub(crate) tol: Option<f64>,
    /// Most nonzeros in the code of one Gaussian. With it --tol is no longer guaranteed: the report counts the
    /// Gaussians whose error is larger [default: no cap].
    #[arg(long, value_name = "K", value_parser = whole::<u8>(0..=255), help_heading = EXACT)]
    pub(crate) max_nonzeros: Option<u8>,
    /// Atoms of the dictionary, 1 to 1024 [default: as many as make the file smaller if packed, otherwise twice the
    /// dimension: 90 at SH degree 3].
    #[arg(long, value_name = "M", value_parser = whole::<usize>(0..=u64::MAX))]
    pub(crate) atoms: Option<usize>,
    /// The pursuit that chooses atoms: `ols` needs fewer of them, `omp` is the paper's [default: ols].
    #[arg(long, value_name = "omp|ols", help_heading = EXACT)]
    pub(crate) pursuit: Option<Pursuit>,
    /// Layout of the file. `packed` quantises and entropy-codes everything. `f16` and `f32` keep geometry exactly
    /// and hold the values of codes in 16 or 32 bits. `paper` holds what the paper counts [default: packed, or
    /// f16 if --tol or an option for exact geometry is given].
    #[arg(long, value_name = "packed|f32|f16|paper")]
    pub(crate) layout: Option<Layout>,
    /// Use the dictionary in this file, a dictionary or a .lexi, instead of learning one.
    #[arg(long, value_name = "FILE", conflicts_with = "atoms", help_heading = EXACT)]
    pub(crate) dictionary: Option<PathBuf>,
    /// Also write the dictionary to this file, for use with other scenes.
    #[arg(long, value_name = "FILE", help_heading = EXACT)]
    pub(crate) save_dictionary: Option<PathBuf>,
    /// Most Gaussians that the dictionary is learned from [default: 65536].
    #[arg(long, value_name = "N", value_parser = whole::<usize>(0..=u64::MAX), help_heading = EXACT)]
    pub(crate) sample: Option<usize>,
    /// Seed of the choice of Gaussians that the dictionary is learned from.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX))]
    pub(crate) seed: u64,
    /// Remove Gaussians with NaN or infinite values. Without this option such a file is refused. Sizes of zero (scales of
    /// -inf) and infinite opacities are always read.
    #[arg(long)]
    pub(crate) drop_invalid: bool,
    /// Leave out properties that 3DGS does not define. Otherwise they are kept as they are, and a column of floats can
    /// take half of a packed file.
    #[arg(long)]
    pub(crate) drop_extras: bool,
    /// Estimate how much each Gaussian shows from its own values instead of drawing the scene. This is several times
    /// faster and makes larger files of the same quality. The only target is then --preset.
    #[arg(long, conflicts_with_all = ["psnr", "min_psnr", "size", "ratio", "cameras", "views"])]
    pub(crate) guess: bool,
    /// Approximate memory that packing a whole scene may take, such as 500MB. A scene that needs more is packed in
    /// parts, each drawn on its own, and so is one of more than 786,432 Gaussians without cameras. The only targets are
    /// then --preset and --psnr. Packing in parts takes up to 1.5 GiB, however small BYTES is. Files of the other
    /// layouts do not depend on it.
    #[arg(long, default_value = "4GiB", value_name = "BYTES", value_parser = size)]
    pub(crate) memory: u64,
    /// The device that draws the scene: `cpu`, `gpu`, `auto` (a GPU if there is one) or a number from `lexisplat
    /// devices`. With `cpu` the same input gives the same file on every machine. A GPU is faster, and its name is
    /// recorded in the file.
    #[arg(long, default_value = "cpu", value_name = "auto|cpu|gpu|N")]
    pub(crate) device: Device,
    /// Print the details too: what bytes, bits, codes and seconds went to.
    #[arg(long)]
    pub(crate) all: bool,
}

impl Compress {
    /// The options that only layouts with exact geometry have, and whether they are given.
    fn exact_only(&self) -> [(&'static str, bool); 5] {
        [
            ("--max-nonzeros", self.max_nonzeros.is_some()),
            ("--pursuit", self.pursuit.is_some()),
            ("--dictionary", self.dictionary.is_some()),
            ("--save-dictionary", self.save_dictionary.is_some()),
            ("--sample", self.sample.is_some()),
        ]
    }

    /// The options that only packed files have, and whether they are given.
    fn packed_only(&self) -> [(&'static str, bool); 11] {
        [
            ("--guess", self.guess),
            ("--preset", self.preset.is_some()),
            ("--psnr", self.psnr.is_some()),
            ("--min-psnr", self.min_psnr.is_some()),
            ("--size", self.size.is_some()),
            ("--ratio", self.ratio.is_some()),
            ("--cameras", self.cameras.is_some()),
            ("--views", self.views.is_some()),
            ("--keep-order", self.keep_order),
            ("--keep-all", self.keep_all),
            ("--max-gaussians", self.max_gaussians.is_some()),
        ]
    }

    /// Whether cameras that lie beside the scene are used.
    pub(crate) fn looks_beside(&self) -> bool {
        let other = self.cameras.is_some() || self.no_cameras || self.views.is_some();
        !other && self.inputs.len() == 1
    }

    /// Returns the layout that is given, or the one that the other options need.
    ///
    /// # Errors
    /// A layout and an option that do not go together.
    pub(crate) fn chosen_layout(&self) -> lexisplat_compress::Result<Layout> {
        let given = |options: &[(&'static str, bool)]| options.iter().find(|o| o.1).map(|o| o.0);
        let (exact, packed) = (given(&self.exact_only()), given(&self.packed_only()));
        choose_layout(self.layout, self.tol.is_some(), exact, packed)
    }
}

/// Turn a .lexi file back into a PLY in INRIA's layout.
#[derive(Debug, Args)]
pub(crate) struct Decompress {
    /// The compressed scene, a .lexi file; `-` reads standard input.
    pub(crate) input: PathBuf,
    /// The PLY; `-` writes to standard output [default: the input's name with extension .ply].
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) part: Part,
}
