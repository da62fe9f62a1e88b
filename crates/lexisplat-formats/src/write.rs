//! Writes a scene in any of the formats that can be written.

use lexisplat::{Error, Progress, Result, Sink, Splats, ply};

use crate::kind::Kind;
use crate::lost::Lost;
use crate::write_options::WriteOptions;
use crate::{compressed_ply, gltf, sog, splat, spz};

/// Writes `splats` in the format `kind`. Returns the number of bytes, and the properties of the scene that the file
/// lacks.
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
