//! Scene files of any kind, recognised by their content.

use std::path::Path;

use lexisplat::lexi::{self, Contents};
use lexisplat::packed::Packed;
use lexisplat::ply::{self, PlyRead, ReadOptions};
use lexisplat::{FileKind, Input, Model, Result};
use lexisplat_render::Scene;

/// A scene as its file holds it.
#[derive(Debug)]
pub enum Loaded {
    /// A PLY.
    Ply(Box<PlyRead>),
    /// The model in a .lexi file, and the packed scene it was decoded from if the file is packed.
    Lexi(Box<Model>, Option<Box<Packed>>),
}

impl Loaded {
    fn lexi(contents: Contents, name: &str) -> Result<Self> {
        Ok(match contents {
            Contents::Packed(packed) => {
                Self::Lexi(Box::new(lexi::unpack(name, &packed)?), Some(Box::new(packed)))
            }
            contents => Self::Lexi(Box::new(contents.into_model(name)?), None),
        })
    }
}

/// A scene file that was read, ready to be drawn.
#[derive(Debug)]
pub struct SceneFile {
    /// The scene.
    pub loaded: Loaded,
    /// Name of the file in messages.
    pub name: String,
    /// Size of the file in bytes.
    pub bytes: u64,
}

impl SceneFile {
    /// Reads a scene file, of the kind that its bytes say. Of the options, a .lexi file uses only the limits.
    ///
    /// # Errors
    /// As [`Input::open_within`], [`ply::read_bytes`] and [`lexi::open_bytes`].
    pub fn read(path: &Path, options: &ReadOptions) -> Result<Self> {
        // The file is read once, because a pipe gives its bytes once.
        let bytes = Input::open_within(path, &options.limits)?;
        Self::read_bytes(&path.display().to_string(), &bytes, options)
    }

    /// Reads a scene file in memory, as [`Self::read`] does. Errors call it `name`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Self> {
        let loaded = if FileKind::of(name, bytes) == FileKind::Lexi {
            Loaded::lexi(lexi::open_bytes(name, bytes, &options.limits)?, name)?
        } else {
            Loaded::Ply(Box::new(ply::read_bytes(name, bytes, options)?))
        };
        Ok(Self { loaded, name: name.to_owned(), bytes: bytes.len() as u64 })
    }

    /// Returns the scene to draw.
    #[must_use]
    pub fn scene(&self) -> Scene<'_> {
        match &self.loaded {
            Loaded::Ply(read) => Scene::from(&read.splats),
            Loaded::Lexi(model, _) => Scene::from(&**model),
        }
    }

    /// Returns what is odd about the file, one sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        match &self.loaded {
            Loaded::Ply(read) => &read.warnings,
            Loaded::Lexi(..) => &[],
        }
    }
}
