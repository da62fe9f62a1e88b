//! Opens a scene of any format.

use lexisplat::lexi::LexiReader;
use lexisplat::ply::{PlySource, ReadOptions};
use lexisplat::{Error, FileKind, Input, Progress, Result, SplatSource, without_byte_order_mark};

use crate::kind::Kind;
use crate::siblings::Siblings;
use crate::sog::Sizes;
use crate::source::FormatSource;
use crate::unknown::unknown;
use crate::{compressed_ply, gltf, ksplat, sog, splat, spz};

/// Reason why a file without Gaussians is not written in another form.
const NONE_LEFT: &str = "no Gaussian is left of it, so there is nothing to write";

/// An open scene of any format.
#[derive(Debug)]
#[non_exhaustive]
pub enum Opened<'a> {
    /// A PLY.
    Ply(Box<PlySource<'a>>),
    /// A .lexi.
    Lexi(Box<LexiReader<'a>>),
    /// A scene of another format.
    Other(Kind, Box<FormatSource<'a>>),
}

impl<'a> Opened<'a> {
    /// Gives the pages of `input`, whose bytes were opened, back to the system now and after each part of a PLY that is read
    /// ([`PlySource::releasing_pages_of`]).
    #[must_use]
    pub fn releasing_pages_of(self, input: &'a Input) -> Self {
        match self {
            Self::Ply(source) => Self::Ply(Box::new(source.releasing_pages_of(input))),
            other => other,
        }
    }
}

impl Opened<'_> {
    /// Returns the format.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Ply(_) => Kind::Ply,
            Self::Lexi(_) => Kind::Lexi,
            Self::Other(kind, _) => *kind,
        }
    }

    /// Returns the scene for reading.
    #[must_use]
    pub fn source(&self) -> &dyn SplatSource {
        match self {
            Self::Ply(source) => &**source,
            Self::Lexi(source) => &**source,
            Self::Other(_, source) => &**source,
        }
    }

    /// Returns the scene for writing in another form. Messages call its file `name`.
    ///
    /// # Errors
    /// [`Error::Format`] if the scene has no Gaussians, or all were left out.
    pub fn some(&self, name: &str) -> Result<&dyn SplatSource> {
        let source = self.source();
        match source.is_empty() {
            true => Err(Error::malformed(name, NONE_LEFT)),
            false => Ok(source),
        }
    }
}

/// Opens the scene in `bytes`. The format is recognised by content. Messages call the file `name`. The other files of a
/// scene of several files come from `siblings`. `whole` tells that the whole scene will be held in memory anyway
/// ([`PlySource::open_whole`]). Reports [`Stage::Read`](lexisplat::Stage::Read) to `progress`.
///
/// # Errors
/// [`Error::Format`] for bytes of no known format, and errors of the reader of the format.
pub fn open<'a>(
    name: &'a str,
    bytes: &'a [u8],
    siblings: Siblings<'a>,
    options: &ReadOptions,
    whole: bool,
    progress: &dyn Progress,
) -> Result<Opened<'a>> {
    let kind = Kind::of(name, bytes);
    let mut sizes = Sizes::of(bytes.len());
    let bytes = match kind {
        // Their first row may begin with the bytes of the mark.
        Some(Kind::Splat | Kind::Ksplat) => bytes,
        _ => without_byte_order_mark(bytes),
    };
    let file = match kind {
        // The PLY reader refuses other files with an error that names their format.
        None | Some(Kind::Ply) => {
            if kind.is_none() && FileKind::of(name, bytes) == FileKind::Unknown {
                return Err(Error::malformed(name, unknown(bytes)));
            }
            let open = if whole { PlySource::open_whole } else { PlySource::open };
            return Ok(Opened::Ply(Box::new(open(name, bytes, options, progress)?)));
        }
        Some(Kind::Lexi) => {
            return Ok(Opened::Lexi(Box::new(LexiReader::open(name, bytes, &options.limits)?)));
        }
        Some(Kind::Spz) => spz::read(name, bytes, options)?,
        Some(Kind::Sog) => {
            let (file, all) = sog::read(name, bytes, siblings, options)?;
            sizes = all;
            file
        }
        Some(Kind::CompressedPly) => compressed_ply::read(name, bytes, options)?,
        Some(Kind::Splat) => splat::read(name, bytes, options)?,
        Some(Kind::Ksplat) => ksplat::read(name, bytes, options)?,
        Some(Kind::Gltf) => gltf::read(name, bytes, options)?,
    };
    progress.check()?;
    let source = FormatSource::new(name, sizes, file, options)?;
    Ok(Opened::Other(kind.unwrap_or(Kind::Ply), Box::new(source)))
}
