//! The options of `compress` and `decompress`.

use std::path::PathBuf;

use clap::Args;
use lexisplat::packed::Preset;
use lexisplat::{Layout, Pursuit};
use lexisplat_compress::{Refine, Viewpoints, choose_layout};
use lexisplat_render::Device;

use super::part::Part;
use super::values::{ViewChoice, first_view, length, preset, real, size, viewpoints, whole};

/// Heading of the options that set the quality or the size of the file.
const TARGET: &str = "Target, at most one of";
/// Heading of the options that packed files do not have.
const EXACT: &str = "Options of the layouts f16, f32 and paper";

/// Compress a trained scene to a .lexi file. Needs no photos, no cameras and no retraining.
#[derive(Debug, Args)]
pub(crate) struct Compress {
    /// The scene file: a PLY (best the trainer's own), SPZ, SOG, compressed.ply, .splat, .ksplat or glTF; `-` reads
    /// standard input. Several files are the tiles of one scene and become one .lexi. Tiles must have the same SH
    /// degree and the same properties.
    #[arg(required = true, value_name = "INPUT")]
    pub(crate) inputs: Vec<PathBuf>,
    /// The compressed file; `-` writes to standard output [default: the input's name with extension .lexi; with several
    /// inputs there is no default].
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
    /// Named quality, from the smallest file to the best pictures: small, balanced, high and archive aim at a PSNR of
    /// 35, 40, 45 and 54 dB [default: balanced].
    #[arg(long, value_parser = preset(), group = "goal", value_name = "NAME", help_heading = TARGET)]
    pub(crate) preset: Option<Preset>,
    /// Make the smallest file with a mean PSNR of at least DB decibels, above 0, such as 40. With cameras the mean is
    /// over all views from which the file is judged, otherwise over the quarter of these views with the lowest PSNR.
    #[arg(long, group = "goal", value_name = "DB", value_parser = real::<f64>("40"), help_heading = TARGET)]
    pub(crate) psnr: Option<f64>,
    /// Make the smallest file with a PSNR of at least DB decibels, above 0, such as 38, in each view from which the file
    /// is judged. Other views of the scene may be worse.
    #[arg(long, group = "goal", value_name = "DB", value_parser = real::<f64>("40"), help_heading = TARGET)]
    pub(crate) min_psnr: Option<f64>,
    /// Make the best file of at most BYTES bytes, such as 10MB or 800kB.
    #[arg(long, group = "goal", value_name = "BYTES", value_parser = size, help_heading = TARGET)]
    pub(crate) size: Option<u64>,
    /// Make the best file that is at least R times smaller than the source, above 1, such as 20.
    #[arg(long, group = "goal", value_name = "R", value_parser = real::<f64>("20"), help_heading = TARGET)]
    pub(crate) ratio: Option<f64>,
    /// Cameras from which the scene is drawn and the file is judged: a cameras.json, a transforms.json or a COLMAP
    /// folder such as sparse/0 [default: cameras beside the scene, one folder above it or where INRIA's trainer leaves
    /// them, if they seem to belong to the scene; otherwise views like photographs, which a search finds].
    #[arg(long, value_name = "PATH")]
    pub(crate) cameras: Option<PathBuf>,
    /// Ignore cameras that lie beside the scene, one folder above it or where INRIA's trainer leaves them.
    #[arg(long, conflicts_with = "cameras")]
    pub(crate) no_cameras: bool,
    /// Distance of the near plane of --cameras, in the scene's units, above 0, such as 0.01. Gaussians nearer than this
    /// distance are not drawn [default: the trainer's 0.2].
    #[arg(long, value_name = "UNITS", value_parser = length, requires = "cameras")]
    pub(crate) near: Option<f32>,
    /// Viewpoints from which the scene is drawn and the file is judged: around an `object`, or inside a `room`. With
    /// `auto` a search finds views like photographs [default: auto].
    #[arg(long, value_parser = viewpoints(), conflicts_with = "cameras")]
    pub(crate) views: Option<Viewpoints>,
    /// View from which viewers show the scene first: a link that a viewer copied, its part after `view=`, or `none`
    /// [default: the best of the cameras, or of generated views; with --guess none].
    #[arg(long, value_name = "LINK", value_parser = first_view, allow_hyphen_values = true)]
    pub(crate) view: Option<ViewChoice>,
    /// Keep the order of the source: store each Gaussian's index in the source, 1 to 3 bytes each. Without this option
    /// packed files have an order of their own.
    #[arg(long)]
    pub(crate) keep_order: bool,
    /// Add levels of detail to a large scene: layers of fewer Gaussians, from which readers draw distant parts. A scene
    /// of 20 million Gaussians has 5 layers instead of 2. Each layer takes 0.15 to 0.25 % more bytes.
    #[arg(long)]
    pub(crate) lod: bool,
    /// Keep all Gaussians. Without this option packing leaves out Gaussians whose effect on the pictures is not worth
    /// their bits. It then fits base colours and opacities to the pictures again, which makes up for the missing
    /// Gaussians and for rounding. --keep-order and --tol keep all Gaussians too.
    #[arg(long)]
    pub(crate) keep_all: bool,
    /// Keep at most N Gaussians, for viewers with a limit. The Gaussians that change the pictures least are left
    /// out, and pairs are merged. --preset is then the quality relative to the reduced scene; --psnr and --min-psnr are
    /// relative to the original scene [default: no limit].
    #[arg(long, value_name = "N", value_parser = whole::<usize>(1..=u64::MAX), conflicts_with_all = ["keep_all", "keep_order", "tol", "guess"])]
    pub(crate) max_gaussians: Option<usize>,
    /// Remove and merge more Gaussians, and fit the others to pictures of the scene: positions, shapes, colours and
    /// opacities. At the same quality the file is about a quarter smaller with cameras, and a tenth without.
    /// `quick` and `thorough` are numbers of steps; MINUTES is about the time on one thread, such as 5. A scene without
    /// cameras of more than 262,144 Gaussians is refined in parts [default when the option is given without a value:
    /// quick].
    #[arg(long, value_name = "quick|thorough|MINUTES", num_args = 0..=1, default_missing_value = "quick", conflicts_with_all = ["keep_all", "keep_order", "tol", "guess"])]
    pub(crate) refine: Option<Refine>,
    /// Largest error of each Gaussian's SH vector, above 0, such as 0.05: the L2 norm of the difference, not squared.
    /// The encoder verifies the bound for every Gaussian. Without --layout the layout is f16, which keeps all other
    /// values exactly. With --layout packed all other values are quantised
    /// [default: 0.1 with exact geometry, otherwise none].
    #[arg(long, value_name = "T", value_parser = real::<f64>("0.1"))]
    pub(crate) tol: Option<f64>,
    /// Largest number of nonzeros in the code of one Gaussian. With this option --tol is not guaranteed. The report
    /// counts the Gaussians whose error is larger than --tol [default: no cap].
    #[arg(long, value_name = "K", value_parser = whole::<u8>(0..=255), help_heading = EXACT)]
    pub(crate) max_nonzeros: Option<u8>,
    /// Number of atoms of the dictionary, 1 to 1024
    /// [default: packed files have the number that makes the file smallest; others have twice the dimension of the SH
    /// vector, which is 90 at SH degree 3].
    #[arg(long, value_name = "M", value_parser = whole::<usize>(0..=u64::MAX))]
    pub(crate) atoms: Option<usize>,
    /// Pursuit that chooses the atoms of each Gaussian: `ols` needs fewer atoms, `omp` is the pursuit of the paper
    /// [default: ols].
    #[arg(long, value_name = "omp|ols", help_heading = EXACT)]
    pub(crate) pursuit: Option<Pursuit>,
    /// Layout of the file. `packed` quantises and entropy-codes everything. `f16`, `f32` and `paper` keep the geometry
    /// exactly. `f16` and `f32` store the values of codes in 16 or 32 bits. `paper` stores codes as the paper counts
    /// them: 32-bit pointers, indices and values [default: packed, or f16 if --tol or an option for exact geometry is
    /// given].
    #[arg(long, value_name = "packed|f32|f16|paper")]
    pub(crate) layout: Option<Layout>,
    /// File of a dictionary to use instead of learning one: a dictionary file or a .lexi.
    #[arg(long, value_name = "FILE", conflicts_with = "atoms", help_heading = EXACT)]
    pub(crate) dictionary: Option<PathBuf>,
    /// File to write the dictionary to, for use with other scenes.
    #[arg(long, value_name = "FILE", help_heading = EXACT)]
    pub(crate) save_dictionary: Option<PathBuf>,
    /// Largest number of Gaussians from which the dictionary is learned [default: 65536].
    #[arg(long, value_name = "N", value_parser = whole::<usize>(0..=u64::MAX), help_heading = EXACT)]
    pub(crate) sample: Option<usize>,
    /// Seed of the random choice of Gaussians from which the dictionary is learned.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = whole::<u64>(0..=u64::MAX))]
    pub(crate) seed: u64,
    /// Leave out Gaussians with NaN or infinite values. Without this option a file with such values is refused. Sizes
    /// of zero (scales of -inf) and infinite opacities are always read.
    #[arg(long)]
    pub(crate) drop_invalid: bool,
    /// Leave out properties that 3DGS does not define. Without this option they are kept without loss, and one column
    /// of floats can take half of a packed file.
    #[arg(long)]
    pub(crate) drop_extras: bool,
    /// Estimate the effect of each Gaussian on the pictures from its own values, without drawing the scene. This is
    /// several times faster and makes larger files of the same quality. --preset is then the only target.
    #[arg(long, conflicts_with_all = ["psnr", "min_psnr", "size", "ratio", "cameras", "views"])]
    pub(crate) guess: bool,
    /// Approximate memory for packing a whole scene, such as 500MB. A scene that needs more is packed in parts, and
    /// each part is drawn on its own. So is a scene of more than 786,432 Gaussians without cameras, or of more than
    /// 262,144 with --refine. A scene in parts has only the targets --preset and --psnr. Packing in parts takes up to
    /// 1.5 GiB, however small BYTES is. Files of the other layouts do not depend on this option.
    #[arg(long, default_value = "4GiB", value_name = "BYTES", value_parser = size)]
    pub(crate) memory: u64,
    /// Device that draws the scene: `cpu`, `gpu`, `auto` (a GPU if there is one that is not emulated in software,
    /// otherwise the CPU) or a number from `lexisplat devices`. With `cpu` the same input gives the same file on every
    /// machine. A GPU is faster. The file then records the name of the GPU.
    #[arg(long, default_value = "cpu", value_name = "auto|cpu|gpu|N")]
    pub(crate) device: Device,
    /// Print the details too: bytes and bits of each attribute of the file, statistics of the codes, and seconds of each
    /// step.
    #[arg(long)]
    pub(crate) all: bool,
}

impl Compress {
    /// Returns the options that only layouts with exact geometry have, and for each whether it is given.
    fn exact_only(&self) -> [(&'static str, bool); 5] {
        [
            ("--max-nonzeros", self.max_nonzeros.is_some()),
            ("--pursuit", self.pursuit.is_some()),
            ("--dictionary", self.dictionary.is_some()),
            ("--save-dictionary", self.save_dictionary.is_some()),
            ("--sample", self.sample.is_some()),
        ]
    }

    /// Returns the options that only packed files have, and for each whether it is given.
    fn packed_only(&self) -> [(&'static str, bool); 13] {
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
            ("--lod", self.lod),
            ("--keep-all", self.keep_all),
            ("--max-gaussians", self.max_gaussians.is_some()),
            ("--refine", self.refine.is_some()),
        ]
    }

    /// Returns whether a search for cameras beside the scene is allowed: one input, and none of --cameras, --no-cameras
    /// and --views.
    pub(crate) fn looks_beside(&self) -> bool {
        let other = self.cameras.is_some() || self.no_cameras || self.views.is_some();
        !other && self.inputs.len() == 1
    }

    /// Returns the layout that is given, or the layout that the other options need.
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
    /// The PLY file; `-` writes to standard output [default: the input's name with extension .ply].
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) part: Part,
}
