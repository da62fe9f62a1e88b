//! Scenes of any format from files, told apart by content.

use std::path::Path;

use lexisplat::lexi::LexiReader;
use lexisplat::packed::{Packed, PackedHead};
use lexisplat::ply::{PlyRead, ReadOptions};
use lexisplat::{Error, FileKind, FormatError, Input, Model, Offset, Result, Silent, Splats};
use lexisplat_formats::{Kind, Opened, Siblings, scene_path};
use lexisplat_render::Scene;

/// A scene of another format than PLY and .lexi.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherRead {
    /// The format.
    pub kind: Kind,
    /// The scene.
    pub splats: Splats,
    /// Oddities that did not prevent reading, one plain sentence each.
    pub warnings: Vec<String>,
}

/// A scene of any format.
#[derive(Debug)]
pub enum Loaded {
    /// A PLY.
    Ply(Box<PlyRead>),
    /// A scene of another format with dense SH.
    Other(Box<OtherRead>),
    /// A .lexi, and before it was decoded if it is a packed one.
    Lexi(Box<Model>, Option<Box<Packed>>),
}

/// Where a scene is.
#[derive(Debug, Clone, Copy)]
pub struct Whereabouts {
    offset: Option<Offset>,
    /// The mean of the positions, relative to the offset.
    middle: [f64; 3],
}

impl Whereabouts {
    /// Where `scene` is.
    #[must_use]
    pub fn of(scene: &Scene<'_>) -> Self {
        let positions = &scene.geometry().positions;
        let mut middle = [0.0; 3];
        for position in positions {
            (0..3).for_each(|k| middle[k] += f64::from(position[k]));
        }
        let count = positions.len().max(1) as f64;
        Self { offset: scene.meta().offset, middle: middle.map(|sum| sum / count) }
    }

    /// Whether the scene, which has no offset, is nearer to the origin than to `offset`.
    fn is_beside(&self, offset: Offset) -> bool {
        let far = |to: [f64; 3]| (0..3).map(|k| (self.middle[k] - to[k]).abs()).sum::<f64>();
        far([0.0; 3]) < far(offset.get())
    }
}

/// Moves the positions of `splats`, or only says that they are relative to `offset`.
fn aligned(splats: &mut Splats, moves: bool, offset: Option<Offset>) {
    if moves {
        splats.rebase(offset);
    } else {
        splats.meta.offset = offset;
    }
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
    /// Reads a scene of any format, which the bytes tell. Of the options only the limits concern a .lexi.
    ///
    /// # Errors
    /// What [`Input::open_within`] and [`lexisplat_formats::open`] say.
    pub fn read(path: &Path, options: &ReadOptions) -> Result<Self> {
        let path = &*scene_path(path);
        // Once, for a pipe gives its bytes once.
        let bytes = Input::open_within(path, &options.limits)?;
        Self::read_files(&path.display().to_string(), &bytes, Siblings::of(path), options)
    }

    /// [`Self::read`] of a file in memory, called `name` in errors.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Self> {
        Self::read_files(name, bytes, Siblings::NONE, options)
    }

    /// [`Self::read_bytes`] of a scene that may have several files; it takes the others from `siblings`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_files(
        name: &str,
        bytes: &[u8],
        siblings: Siblings<'_>,
        options: &ReadOptions,
    ) -> Result<Self> {
        let mut file_bytes = bytes.len() as u64;
        let loaded = match lexisplat_formats::open(name, bytes, siblings, options, true, &Silent)? {
            Opened::Ply(source) => Loaded::Ply(Box::new(source.into_read()?)),
            Opened::Lexi(reader) => Loaded::lexi(&reader)?,
            opened => {
                let (kind, source) = (opened.kind(), opened.source());
                file_bytes = source.source_bytes();
                let (splats, warnings) = (source.whole()?.into_owned(), source.warnings().to_vec());
                Loaded::Other(Box::new(OtherRead { kind, splats, warnings }))
            }
        };
        Ok(Self { loaded, name: name.to_owned(), bytes: file_bytes })
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

    /// Makes positions relative to what those of another scene are relative to, so that both can be drawn from the same
    /// cameras. Positions of a file that cannot keep an offset are taken as relative to that of the other scene, if the
    /// Gaussians are nearer to the origin than to the offset.
    pub fn align(&mut self, with: &Whereabouts) {
        let own = Whereabouts::of(&self.scene());
        let (moves, offset) = match (own.offset, with.offset) {
            (Some(offset), None) => (!with.is_beside(offset), None),
            (None, Some(offset)) => (!own.is_beside(offset), Some(offset)),
            (_, offset) => (true, offset),
        };
        match &mut self.loaded {
            Loaded::Ply(read) => aligned(&mut read.splats, moves, offset),
            Loaded::Other(read) => aligned(&mut read.splats, moves, offset),
            Loaded::Lexi(model, _) if moves => model.rebase(offset),
            Loaded::Lexi(..) => {}
        }
    }

    /// The scene, to draw.
    #[must_use]
    pub fn scene(&self) -> Scene<'_> {
        match &self.loaded {
            Loaded::Ply(read) => Scene::from(&read.splats),
            Loaded::Other(read) => Scene::from(&read.splats),
            Loaded::Lexi(model, _) => Scene::from(&**model),
        }
    }

    /// The scene with dense SH, if the file is no .lexi.
    #[must_use]
    pub fn splats(&self) -> Option<&Splats> {
        match &self.loaded {
            Loaded::Ply(read) => Some(&read.splats),
            Loaded::Other(read) => Some(&read.splats),
            Loaded::Lexi(..) => None,
        }
    }

    /// [`Self::splats`], taken out.
    ///
    /// # Errors
    /// [`lexisplat::Error::Format`] for a .lexi.
    pub fn into_splats(self) -> Result<Splats> {
        match self.loaded {
            Loaded::Ply(read) => Ok(read.splats),
            Loaded::Other(read) => Ok(read.splats),
            Loaded::Lexi(..) => {
                let problem = FormatError::OtherKind { found: FileKind::Lexi, expected: FileKind::Ply };
                Err(Error::format(self.name, problem))
            }
        }
    }

    /// The format.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match &self.loaded {
            Loaded::Ply(_) => Kind::Ply,
            Loaded::Other(read) => read.kind,
            Loaded::Lexi(..) => Kind::Lexi,
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
            Loaded::Other(read) => &read.warnings,
            Loaded::Lexi(..) => &[],
        }
    }
}
