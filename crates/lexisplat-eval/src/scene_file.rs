//! Scenes of either kind from files, told apart by content.

use std::path::Path;

use lexisplat::lexi::LexiReader;
use lexisplat::packed::{Packed, PackedHead};
use lexisplat::ply::{self, PlyRead, ReadOptions};
use lexisplat::{FileKind, Input, Model, Result};
use lexisplat_render::Scene;

/// A scene of either kind.
#[derive(Debug)]
pub enum Loaded {
    /// A PLY.
    Ply(Box<PlyRead>),
    /// A .lexi, and before it was decoded if it is a packed one.
    Lexi(Box<Model>, Option<Box<Packed>>),
}

impl Loaded {
    fn lexi(reader: &LexiReader<'_>) -> Result<Self> {
        Ok(match reader.packed()? {
            Some(packed) => Self::Lexi(Box::new(packed.unpack()?), Some(Box::new(packed))),
            None => Self::Lexi(Box::new(reader.model()?), None),
        })
    }
}

/// A scene, its name and its size.
#[derive(Debug)]
pub struct SceneFile {
    /// The scene.
    pub loaded: Loaded,
    /// The file's name as the user gave it, or what stands for it.
    pub name: String,
    /// Size of the file in bytes.
    pub bytes: u64,
}

impl SceneFile {
    /// Reads a PLY or a .lexi, whichever the bytes say it is. Of the options only the limits concern a .lexi.
    ///
    /// # Errors
    /// What [`Input::open_within`], [`ply::read_bytes`] and [`LexiReader::open`] say.
    pub fn read(path: &Path, options: &ReadOptions) -> Result<Self> {
        // Once, for a pipe gives its bytes once.
        let bytes = Input::open_within(path, &options.limits)?;
        Self::read_bytes(&path.display().to_string(), &bytes, options)
    }

    /// [`Self::read`] of a file in memory, called `name` in errors.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Self> {
        let loaded = if FileKind::of(name, bytes) == FileKind::Lexi {
            Loaded::lexi(&LexiReader::open(name, bytes, &options.limits)?)?
        } else {
            Loaded::Ply(Box::new(ply::read_bytes(name, bytes, options)?))
        };
        Ok(Self { loaded, name: name.to_owned(), bytes: bytes.len() as u64 })
    }

    /// The scene that is there of a .lexi file called `name`, of `bytes` bytes in all, with what `reader` was told to leave
    /// out.
    ///
    /// # Errors
    /// What [`LexiReader::model`] says.
    pub fn of_lexi(reader: &LexiReader<'_>, name: &str, bytes: u64) -> Result<Self> {
        let loaded = Loaded::Lexi(Box::new(reader.model()?), None);
        Ok(Self { loaded, name: name.to_owned(), bytes })
    }

    /// The scene, to draw.
    #[must_use]
    pub fn scene(&self) -> Scene<'_> {
        match &self.loaded {
            Loaded::Ply(read) => Scene::from(&read.splats),
            Loaded::Lexi(model, _) => Scene::from(&**model),
        }
    }

    /// What a packed file says of itself.
    #[must_use]
    pub fn packed_head(&self) -> Option<&PackedHead> {
        match &self.loaded {
            Loaded::Lexi(_, Some(packed)) => Some(packed.head()),
            _ => None,
        }
    }

    /// What is odd about the file.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        match &self.loaded {
            Loaded::Ply(read) => &read.warnings,
            Loaded::Lexi(..) => &[],
        }
    }
}
