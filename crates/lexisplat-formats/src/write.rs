//! Writes a scene in any of the formats that can be written.

use lexisplat::{Error, Offset, Progress, Result, ShDegree, Sink, Splats, ply};
use serde::Serialize;

use crate::kind::Kind;
use crate::{compressed_ply, gltf, sog, splat, spz};

/// Options of writing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// Version of SPZ: 2, 3 or 4. The default is 4.
    pub spz_version: u8,
    /// Number of bits of SPZ's SH coefficients of degree 1, and of the higher degrees, 1 to 8 each. The default is 5 and
    /// 4, as in SPZ's own library.
    pub sh_bits: [u8; 2],
    /// Largest number of entries of SOG's palette of SH, up to 65,536, which is the default; 0 leaves SH out. The palette
    /// also has no more entries than the largest power of two that does not exceed the number of Gaussians.
    pub sog_palette: u32,
    /// Whether the splats of a glb are an SPZ (`KHR_gaussian_splatting_compression_spz_2`, a draft) instead of floats.
    /// The default is false.
    pub glb_spz: bool,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { spz_version: 4, sh_bits: [5, 4], sog_palette: 1 << 16, glb_spz: false }
    }
}

/// The properties of a scene that a written file lacks.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Lost {
    /// SH degrees of the scene and of the file, if the file's is lower.
    pub sh_degree: Option<[u8; 2]>,
    /// Names of extra properties that were left out.
    pub extras: Vec<String>,
    /// Whether normals were left out.
    pub normals: bool,
    /// Whether the mark of anti-aliasing was left out.
    pub antialiased: bool,
    /// Offset that was left out. Positions in the file are relative to it.
    pub offset: Option<Offset>,
    /// Descriptions of how values are rounded, one phrase each; empty if values are exact.
    pub precision: Vec<String>,
    /// Number of values that were out of the format's range. The file has the end of the range instead.
    pub limited: u64,
    /// Descriptions of roundings that are coarse relative to the sizes of Gaussians, one sentence each.
    pub coarse: Vec<String>,
}

impl Lost {
    /// Returns what a file of `degree` without extras and normals lacks of `splats`. `antialiased` tells whether the file
    /// keeps the mark of anti-aliasing.
    pub(crate) fn beside(splats: &Splats, degree: ShDegree, antialiased: bool) -> Self {
        Self {
            sh_degree: (degree < splats.degree).then(|| [splats.degree.get(), degree.get()]),
            extras: splats.geometry.extras.iter().map(|extra| extra.name.clone()).collect(),
            normals: !splats.geometry.normals.is_empty(),
            antialiased: splats.meta.antialiased && !antialiased,
            offset: splats.meta.offset,
            ..Self::default()
        }
    }
}

/// Writes `splats` in the format `kind`. Returns the number of bytes, and what the file lacks of the scene.
///
/// The bytes depend only on the scene and the options.
///
/// # Errors
/// [`Error::Parameter`] for a kind that is not in [`Kind::WRITTEN`] (.lexi has its own writer), for options out of range,
/// for a scene whose arrays differ in length, and for an empty scene; [`Error::Limit`] for a scene too large for the
/// format; [`Error::Cancelled`] if `progress` cancels; errors of the sink.
pub fn write<'a>(
    kind: Kind,
    splats: &Splats,
    options: &WriteOptions,
    sink: impl Into<Sink<'a>>,
    progress: &dyn Progress,
) -> Result<(u64, Lost)> {
    splats.validate()?;
    if splats.is_empty() {
        return Err(Error::parameter("scene", "no Gaussians", "one or more, or there is nothing to write"));
    }
    let (bytes, lost) = match kind {
        Kind::Ply => return Ok((ply::write(sink, splats)?, Lost::default())),
        Kind::Spz => spz::write(splats, options)?,
        Kind::Sog => sog::write(splats, options, progress)?,
        Kind::CompressedPly => compressed_ply::write(splats),
        Kind::Splat => splat::write(splats),
        Kind::Gltf => gltf::write(splats, options)?,
        Kind::Lexi | Kind::Ksplat => {
            let expected = "ply, spz, sog, compressed.ply, splat or glb";
            return Err(Error::parameter("format", kind.extension(), expected));
        }
    };
    progress.check()?;
    Ok((sink.into().write_bytes(&bytes, progress)?, lost))
}
