//! The options of `convert`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use lexisplat::ShDegree;
use lexisplat_formats::{Edits, Kind, WriteOptions};

use super::values::{numbers, real, whole};

/// Heading of the options that change the scene.
const CHANGES: &str = "Changes, made in this order";
/// Heading of the options that only some formats have.
const FORMATS: &str = "Options of formats";

/// Convert scenes between formats. Several scenes become one.
///
/// Reads and writes PLY, .lexi, SPZ, SOG, compressed.ply, .splat and glb, and reads .ksplat and .gltf. What a file is, its
/// content tells. What a format cannot hold is printed. A .lexi is made as by `lexisplat compress` without options, which
/// reads all of these formats itself. docs/FORMATS.md tells each format's axes and precision.
#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// One or more scenes, and the file to write last.
    #[arg(required = true, num_args = 2.., value_names = ["IN", "OUT"])]
    pub(crate) files: Vec<PathBuf>,
    /// The format to write [default: that of the output's extension].
    #[arg(long, value_name = "FORMAT", value_parser = format())]
    pub(crate) to: Option<Kind>,
    /// Also draw both and print the PSNR of what was written against what was read, over views that are looked for.
    #[arg(long)]
    pub(crate) psnr: bool,
    /// Leave out Gaussians with NaN or infinite values. Without this option such a file is refused. Sizes of zero (scales of
    /// -inf) and infinite opacities are always read.
    #[arg(long)]
    pub(crate) drop_invalid: bool,
    /// Leave out properties that 3DGS does not define.
    #[arg(long)]
    pub(crate) drop_extras: bool,
    /// Cut off SH above this degree, 0 to 4.
    #[arg(long, value_name = "N", value_parser = whole::<u8>(0..=4), help_heading = CHANGES)]
    pub(crate) degree: Option<u8>,
    /// Leave out Gaussians whose centres are outside of this box: its lower corner, then its upper one.
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = numbers::<6>, allow_hyphen_values = true, help_heading = CHANGES)]
    pub(crate) crop_box: Option<[f64; 6]>,
    /// Leave out Gaussians whose centres are outside of this sphere: its centre, then its radius.
    #[arg(long, value_name = "X,Y,Z,R", value_parser = numbers::<4>, allow_hyphen_values = true, help_heading = CHANGES)]
    pub(crate) crop_sphere: Option<[f64; 4]>,
    /// Scale the scene by this factor, above 0.
    #[arg(long, value_name = "FACTOR", value_parser = real::<f64>("0.5"), help_heading = CHANGES)]
    pub(crate) scale: Option<f64>,
    /// Rotate the scene about the axes x, then y, then z of a PLY, through the origin, by these angles in degrees. SH
    /// rotate too.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, help_heading = CHANGES)]
    pub(crate) rotate: Option<[f64; 3]>,
    /// Move the scene. This is done in double precision: what single precision cannot hold stays an offset of the scene,
    /// and an offset goes away with its opposite.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, help_heading = CHANGES)]
    pub(crate) translate: Option<[f64; 3]>,
    /// Version of SPZ: 2, 3 or 4 [default: 4].
    #[arg(long, value_name = "N", value_parser = whole::<u8>(2..=4), help_heading = FORMATS)]
    pub(crate) spz_version: Option<u8>,
    /// Most entries of SOG's palette of SH, 0 to 65536; 0 leaves SH out. There are no more than the largest power of two
    /// that is no larger than the number of Gaussians [default: 65536].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0..=65_536), help_heading = FORMATS)]
    pub(crate) sog_palette: Option<u32>,
    /// Bits of SPZ's SH coefficients of degree 1, and of higher degrees, 1 to 8 each. 8,8 is what SPZ can hold at most
    /// [default: 5,4, as SPZ's own library].
    #[arg(long, value_name = "N,N", value_parser = sh_bits, help_heading = FORMATS)]
    pub(crate) sh_bits: Option<[u8; 2]>,
    /// Write the splats of a glb as an SPZ, as Cesium takes them, and not as floats. The extension of glTF for it is a
    /// draft.
    #[arg(long, help_heading = FORMATS)]
    pub(crate) glb_spz: bool,
}

impl Convert {
    /// The changes of the scene.
    pub(crate) fn edits(&self) -> Result<Edits, lexisplat::Error> {
        let mut edits = Edits::default();
        edits.degree = self.degree.map(ShDegree::new).transpose()?;
        edits.crop_box = self.crop_box.map(|[a, b, c, x, y, z]| [[a, b, c], [x, y, z]]);
        edits.crop_sphere = self.crop_sphere.map(|[x, y, z, r]| ([x, y, z], r));
        edits.scale = self.scale;
        edits.rotate = self.rotate;
        edits.translate = self.translate;
        Ok(edits)
    }

    /// How to write.
    pub(crate) fn write_options(&self) -> WriteOptions {
        let mut options = WriteOptions::default();
        options.spz_version = self.spz_version.unwrap_or(options.spz_version);
        options.sog_palette = self.sog_palette.unwrap_or(options.sog_palette);
        options.sh_bits = self.sh_bits.unwrap_or(options.sh_bits);
        options.glb_spz = self.glb_spz;
        options
    }
}

/// Returns the parser of a format that can be written, which also lists the names in the help.
fn format() -> impl TypedValueParser<Value = Kind> {
    let names = Kind::WRITTEN.into_iter().chain([Kind::Lexi]).map(Kind::extension);
    PossibleValuesParser::new(names)
        .map(|name| Kind::ALL.into_iter().find(|kind| kind.extension() == name).unwrap_or(Kind::Ply))
}

/// Parses two numbers of bits.
fn sh_bits(text: &str) -> Result<[u8; 2], String> {
    let bits: Vec<u8> = text.split(',').filter_map(|part| part.trim().parse::<u8>().ok()).collect();
    match <[u8; 2]>::try_from(bits) {
        Ok(bits) if bits.iter().all(|b| (1..=8).contains(b)) && text.split(',').count() == 2 => Ok(bits),
        _ => Err("expected two numbers from 1 to 8, such as 8,8".to_owned()),
    }
}
