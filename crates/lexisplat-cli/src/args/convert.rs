//! The options of `convert`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use lexisplat::ShDegree;
use lexisplat_formats::{Edits, Kind, WriteOptions};

use super::values::{ViewChoice, first_view, numbers, real, whole};

/// Heading of the options that change the scene.
const CHANGES: &str = "Changes, made in this order";
/// Heading of the options that apply to some formats only.
const FORMATS: &str = "Options of formats";

/// Convert a scene to another format. Several scenes are merged into one.
///
/// Reads and writes PLY, .lexi, SPZ, SOG, compressed.ply, .splat and glb, and reads .ksplat and .gltf. The format of an
/// input is told by its content. Properties that the output format cannot hold are left out and listed. A .lexi output is
/// made as by `lexisplat compress` without options; `lexisplat compress` reads all of these formats itself.
/// docs/FORMATS.md describes the axes and the precision of each format. Example: `lexisplat convert a.spz b.ply
/// scene.spz` merges two scenes into scene.spz.
#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// One or more scenes to read, then the file to write.
    #[arg(required = true, num_args = 2.., value_names = ["IN", "OUT"])]
    pub(crate) files: Vec<PathBuf>,
    /// Format of the output [default: the format of its extension].
    #[arg(long, value_name = "FORMAT", value_parser = format())]
    pub(crate) to: Option<Kind>,
    /// View from which viewers show a .lexi first: a link that a viewer copied, its part after `view=`, or `none`. A
    /// .lexi that is converted to a .lexi without changes keeps everything else as it is, and nothing is packed again.
    #[arg(long, value_name = "LINK", value_parser = first_view, allow_hyphen_values = true)]
    pub(crate) view: Option<ViewChoice>,
    /// Also draw the scene with its changes, and the file that was written, and print the PSNR of the file, over 8
    /// views like photographs, which a search finds.
    #[arg(long)]
    pub(crate) psnr: bool,
    /// Leave out Gaussians with NaN or infinite values. Without this option a file with such values is refused. Sizes
    /// of zero (scales of -inf) and infinite opacities are always read.
    #[arg(long)]
    pub(crate) drop_invalid: bool,
    /// Leave out properties that 3DGS does not define.
    #[arg(long)]
    pub(crate) drop_extras: bool,
    /// Highest SH degree to keep, 0 to 4. SH of higher degrees are cut off.
    #[arg(long, value_name = "N", value_parser = whole::<u8>(0..=4), help_heading = CHANGES)]
    pub(crate) degree: Option<u8>,
    /// Keep only Gaussians whose centres are inside this box, given by its lower corner and its upper corner, such as
    /// -1,-1,-1,1,1,1.
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = numbers::<6>, allow_hyphen_values = true, help_heading = CHANGES)]
    pub(crate) crop_box: Option<[f64; 6]>,
    /// Keep only Gaussians whose centres are inside this sphere, given by its centre and its radius, such as 0,0,0,2.5.
    #[arg(long, value_name = "X,Y,Z,R", value_parser = numbers::<4>, allow_hyphen_values = true, help_heading = CHANGES)]
    pub(crate) crop_sphere: Option<[f64; 4]>,
    /// Scale the scene by this factor, above 0, such as 0.5.
    #[arg(long, value_name = "FACTOR", value_parser = real::<f64>("0.5"), help_heading = CHANGES)]
    pub(crate) scale: Option<f64>,
    /// Rotate the scene about the axes x, then y, then z of a PLY, through the origin, by these angles in degrees, such
    /// as 90,0,0. SH are rotated too.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, help_heading = CHANGES)]
    pub(crate) rotate: Option<[f64; 3]>,
    /// Move the scene by this vector, such as 0,0,-1.5. Sums are in double precision. If single precision cannot hold
    /// them, the scene gets an offset. Moving the scene back removes the offset.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, help_heading = CHANGES)]
    pub(crate) translate: Option<[f64; 3]>,
    /// Version of SPZ to write: 2, 3 or 4 [default: 4].
    #[arg(long, value_name = "N", value_parser = whole::<u8>(2..=4), help_heading = FORMATS)]
    pub(crate) spz_version: Option<u8>,
    /// Largest number of entries in SOG's palette of SH, 0 to 65536; 0 leaves SH out. The palette also has no more
    /// entries than the largest power of two that does not exceed the number of Gaussians [default: 65536].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0..=65_536), help_heading = FORMATS)]
    pub(crate) sog_palette: Option<u32>,
    /// Bits of SPZ's SH coefficients: of degree 1, then of the higher degrees, 1 to 8 each. 8,8 is the most that SPZ
    /// can hold [default: 5,4, as in SPZ's own library].
    #[arg(long, value_name = "N,N", value_parser = sh_bits, help_heading = FORMATS)]
    pub(crate) sh_bits: Option<[u8; 2]>,
    /// Write the splats of a glb as an SPZ, as Cesium reads them, instead of as floats. The glTF extension for SPZ is a
    /// draft.
    #[arg(long, help_heading = FORMATS)]
    pub(crate) glb_spz: bool,
}

impl Convert {
    /// Returns the changes of the scene.
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

    /// Returns the options of the writers.
    pub(crate) fn write_options(&self) -> WriteOptions {
        let mut options = WriteOptions::default();
        options.spz_version = self.spz_version.unwrap_or(options.spz_version);
        options.sog_palette = self.sog_palette.unwrap_or(options.sog_palette);
        options.sh_bits = self.sh_bits.unwrap_or(options.sh_bits);
        options.glb_spz = self.glb_spz;
        options
    }
}

/// Returns the parser of a format that can be written. The help lists its names.
fn format() -> impl TypedValueParser<Value = Kind> {
    let names = Kind::WRITTEN.into_iter().chain([Kind::Lexi]).map(Kind::extension);
    PossibleValuesParser::new(names)
        .map(|name| Kind::ALL.into_iter().find(|kind| kind.extension() == name).unwrap_or(Kind::Ply))
}

/// Parses the two numbers of bits of --sh-bits.
fn sh_bits(text: &str) -> Result<[u8; 2], String> {
    let bits: Vec<u8> = text.split(',').filter_map(|part| part.trim().parse::<u8>().ok()).collect();
    match <[u8; 2]>::try_from(bits) {
        Ok(bits) if bits.iter().all(|b| (1..=8).contains(b)) && text.split(',').count() == 2 => Ok(bits),
        _ => Err("expected two numbers from 1 to 8, such as 8,8".to_owned()),
    }
}
