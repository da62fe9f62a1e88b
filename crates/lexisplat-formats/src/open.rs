//! Opens a scene of any format.

use std::path::Path;

use lexisplat::lexi::LexiReader;
use lexisplat::ply::{PlySource, ReadOptions};
use lexisplat::{Error, FileKind, Input, Progress, Result, SplatSource};

use crate::kind::Kind;
use crate::source::FormatSource;
use crate::{compressed_ply, gltf, ksplat, sog, splat, spz};

/// Where a file finds other files that it names. Only the folder form of SOG names any.
#[derive(Debug, Clone, Copy)]
pub struct Siblings<'a>(Option<&'a Path>);

impl<'a> Siblings<'a> {
    /// None: a file that needs others is refused.
    pub const NONE: Self = Self(None);

    /// The files of `folder`, by plain names.
    #[must_use]
    pub fn in_folder(folder: &'a Path) -> Self {
        Self(Some(folder))
    }

    /// The files beside `path`.
    #[must_use]
    pub fn beside(path: &'a Path) -> Self {
        Self(path.parent().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder }))
    }

    /// The bytes of the file called `name`, which `file` asks for.
    pub(crate) fn open(self, file: &str, name: &str, options: &ReadOptions) -> Result<Input> {
        let plain = !name.is_empty()
            && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b))
            && !name.starts_with('.');
        if !plain {
            return Err(Error::malformed(
                file,
                format!("'{}' is no plain name of a file", name.escape_debug()),
            ));
        }
        let Some(folder) = self.0 else {
            return Err(Error::malformed(
                file,
                format!("'{name}' is needed, and there is no folder to find it in"),
            ));
        };
        Input::open_within(&folder.join(name), &options.limits)
    }
}

/// A scene of any format, opened.
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

impl Opened<'_> {
    /// The format.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Ply(_) => Kind::Ply,
            Self::Lexi(_) => Kind::Lexi,
            Self::Other(kind, _) => *kind,
        }
    }

    /// The scene, to read.
    #[must_use]
    pub fn source(&self) -> &dyn SplatSource {
        match self {
            Self::Ply(source) => &**source,
            Self::Lexi(source) => &**source,
            Self::Other(_, source) => &**source,
        }
    }
}

/// Opens the scene in `bytes`, of any format, which its content tells; messages call it `name`. `whole` says that the
/// whole scene will be held anyway ([`PlySource::open_whole`]). Reports [`Stage::Read`](lexisplat::Stage::Read).
///
/// # Errors
/// [`Error::Format`] for bytes of no known format, and what the reader of the format says.
pub fn open<'a>(
    name: &'a str,
    bytes: &'a [u8],
    siblings: Siblings<'_>,
    options: &ReadOptions,
    whole: bool,
    progress: &dyn Progress,
) -> Result<Opened<'a>> {
    let kind = Kind::of(name, bytes);
    let file = match kind {
        None | Some(Kind::Ply) => {
            if kind.is_none() && FileKind::of(name, bytes) == FileKind::Unknown {
                return Err(Error::malformed(name, "the format is not known"));
            }
            let open = if whole { PlySource::open_whole } else { PlySource::open };
            return Ok(Opened::Ply(Box::new(open(name, bytes, options, progress)?)));
        }
        Some(Kind::Lexi) => {
            return Ok(Opened::Lexi(Box::new(LexiReader::open(name, bytes, &options.limits)?)));
        }
        Some(Kind::Spz) => spz::read(name, bytes, options)?,
        Some(Kind::Sog) => sog::read(name, bytes, siblings, options)?,
        Some(Kind::CompressedPly) => compressed_ply::read(name, bytes, options)?,
        Some(Kind::Splat) => splat::read(name, bytes, options)?,
        Some(Kind::Ksplat) => ksplat::read(name, bytes, options)?,
        Some(Kind::Gltf) => gltf::read(name, bytes, options)?,
    };
    progress.check()?;
    let source = FormatSource::new(name, bytes.len() as u64, file, options)?;
    Ok(Opened::Other(kind.unwrap_or(Kind::Ply), Box::new(source)))
}
