//! Scenes of any format from files. The format is recognised by content.

use std::path::Path;

use lexisplat::lexi::LexiReader;
use lexisplat::packed::{Packed, PackedHead};
use lexisplat::ply::{PlyRead, ReadOptions};
use lexisplat::{Error, FileKind, FormatError, Input, Model, Offset, Result, Silent, Splats};
use lexisplat_formats::{Kind, Opened, Siblings, scene_path};
use lexisplat_render::Scene;

/// A scene of another format than PLY or .lexi.
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
    /// A scene with dense SH of another format.
    Other(Box<OtherRead>),
    /// The decoded model of a .lexi, and for a packed .lexi also its packed form.
    Lexi(Box<Model>, Option<Box<Packed>>),
}

/// The location of a scene: its offset, and the mean of its positions.
#[derive(Debug, Clone, Copy)]
pub struct Whereabouts {
    offset: Option<Offset>,
    /// Mean of the positions, relative to the offset.
    middle: [f64; 3],
}

impl Whereabouts {
    /// Returns the location of `scene`.
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

    /// Returns whether the scene, which has no offset, is nearer to the origin than to `offset`.
    fn is_beside(&self, offset: Offset) -> bool {
        let far = |to: [f64; 3]| (0..3).map(|k| (self.middle[k] - to[k]).abs()).sum::<f64>();
        far([0.0; 3]) < far(offset.get())
    }
}

/// Changes the offset of `splats` to `offset`. If `moves` is set, the positions are changed so that the scene stays in
/// place. Otherwise they are only marked as relative to `offset`.
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

/// A scene with its name and size.
#[derive(Debug)]
pub struct SceneFile {
    /// The scene.
    pub loaded: Loaded,
    /// Name of the file as given by the user, or a name that stands for it.
    pub name: String,
    /// Size of the file in bytes.
    pub bytes: u64,
}

impl SceneFile {
    /// Reads a scene of any format, which is recognised by content. Of the options only the limits apply to a .lexi.
    ///
    /// # Errors
    /// As [`Input::open_within`] and [`lexisplat_formats::open`].
    pub fn read(path: &Path, options: &ReadOptions) -> Result<Self> {
        let path = &*scene_path(path);
        // The file is opened once, because a pipe gives its bytes only once.
        let bytes = Input::open_within(path, &options.limits)?;
        Self::read_files(&path.display().to_string(), &bytes, Siblings::of(path), options)
    }

    /// Reads a file in memory like [`Self::read`]. Errors call it `name`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Self> {
        Self::read_files(name, bytes, Siblings::NONE, options)
    }

    /// Reads a file in memory like [`Self::read_bytes`]. The other files of a scene of several files come from
    /// `siblings`.
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

    /// Returns the scene of an open .lexi file called `name`, whose whole size is `bytes` bytes. Parts that `reader` was
    /// told to leave out are missing.
    ///
    /// # Errors
    /// As [`LexiReader::model`].
    pub fn of_lexi(reader: &LexiReader<'_>, name: &str, bytes: u64) -> Result<Self> {
        let loaded = Loaded::Lexi(Box::new(reader.model()?), None);
        Ok(Self { loaded, name: name.to_owned(), bytes })
    }

    /// Changes the offset of the scene to that of another scene, so that both can be drawn from the same cameras.
    /// Positions of a file that cannot hold an offset are taken as relative to the offset of the other scene, if the
    /// Gaussians are nearer to the origin than to this offset.
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

    /// Returns the scene for drawing.
    #[must_use]
    pub fn scene(&self) -> Scene<'_> {
        match &self.loaded {
            Loaded::Ply(read) => Scene::from(&read.splats),
            Loaded::Other(read) => Scene::from(&read.splats),
            Loaded::Lexi(model, _) => Scene::from(&**model),
        }
    }

    /// Returns the scene with dense SH; `None` for a .lexi.
    #[must_use]
    pub fn splats(&self) -> Option<&Splats> {
        match &self.loaded {
            Loaded::Ply(read) => Some(&read.splats),
            Loaded::Other(read) => Some(&read.splats),
            Loaded::Lexi(..) => None,
        }
    }

    /// Returns the scene with dense SH, like [`Self::splats`], by value.
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

    /// Returns the format.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match &self.loaded {
            Loaded::Ply(_) => Kind::Ply,
            Loaded::Other(read) => read.kind,
            Loaded::Lexi(..) => Kind::Lexi,
        }
    }

    /// Returns the header of a packed file; `None` for other files.
    #[must_use]
    pub fn packed_head(&self) -> Option<&PackedHead> {
        match &self.loaded {
            Loaded::Lexi(_, Some(packed)) => Some(packed.head()),
            _ => None,
        }
    }

    /// Returns the oddities of the file, one sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        match &self.loaded {
            Loaded::Ply(read) => &read.warnings,
            Loaded::Other(read) => &read.warnings,
            Loaded::Lexi(..) => &[],
        }
    }
}
