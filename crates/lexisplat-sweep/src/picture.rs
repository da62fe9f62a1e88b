//! The pictures that a sweep saves.

use std::path::PathBuf;

use lexisplat_compress::{Error, Result};

/// One view of a model at one setting: PNG pictures of one size, given as `T`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture<T> {
    /// Index of the scene in [`Results::scenes`](super::Results::scenes).
    pub scene: usize,
    /// The label of its [`Setting`](super::Setting).
    pub setting: String,
    /// The view's name.
    pub view: String,
    /// The original.
    pub original: T,
    /// The compressed.
    pub compressed: T,
    /// Their difference, [`AMPLIFICATION`](lexisplat_eval::montage::AMPLIFICATION) times as bright.
    pub difference: T,
    /// The photo from the same camera, if there is one.
    pub photo: Option<T>,
}

/// Pictures as the paths of files.
pub type PictureFiles = Picture<PathBuf>;
/// Pictures as the bytes of files.
pub(crate) type SweepPicture = Picture<Vec<u8>>;

impl PictureFiles {
    /// Reads the files.
    pub(super) fn read(&self) -> Result<SweepPicture> {
        let read = |path: &PathBuf| std::fs::read(path).map_err(|e| Error::io(path, e));
        Ok(Picture {
            scene: self.scene,
            setting: self.setting.clone(),
            view: self.view.clone(),
            original: read(&self.original)?,
            compressed: read(&self.compressed)?,
            difference: read(&self.difference)?,
            photo: self.photo.as_ref().map(read).transpose()?,
        })
    }
}
