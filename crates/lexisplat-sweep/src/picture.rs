//! The pictures that a sweep saves.

use std::path::PathBuf;

use lexisplat_compress::{Error, Result};

/// One view of a model at one setting, as PNG files of one size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PictureFiles {
    /// Index of the scene in [`Results::scenes`](super::Results::scenes).
    pub scene: usize,
    /// The label of its [`Setting`](super::Setting).
    pub setting: String,
    /// The view's name.
    pub view: String,
    /// The original.
    pub original: PathBuf,
    /// The compressed.
    pub compressed: PathBuf,
    /// Their difference, [`AMPLIFICATION`](lexisplat_eval::montage::AMPLIFICATION) times as bright.
    pub difference: PathBuf,
    /// The photo from the same camera, if there is one.
    pub photo: Option<PathBuf>,
}

/// A picture for the page.
pub(crate) struct Part {
    /// The class in the page's style sheet.
    pub(crate) class: &'static str,
    /// What it shows.
    pub(crate) what: &'static str,
    pub(crate) png: Vec<u8>,
}

impl PictureFiles {
    /// Reads the files.
    pub(super) fn read(&self) -> Result<Vec<Part>> {
        let files = [
            ("before", "original", Some(&self.original)),
            ("photo", "photo", self.photo.as_ref()),
            ("after", "compressed", Some(&self.compressed)),
            ("difference", "amplified difference", Some(&self.difference)),
        ];
        let read = |(class, what, path): (_, _, Option<&PathBuf>)| {
            let path = path?;
            let png = std::fs::read(path).map_err(|e| Error::io(path, e));
            Some(png.map(|png| Part { class, what, png }))
        };
        files.into_iter().filter_map(read).collect()
    }
}
