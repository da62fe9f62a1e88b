//! The pictures that a sweep saves.

use std::path::PathBuf;

use lexisplat_compress::{Error, Result};

/// The pictures of one view of a model at one setting, as PNG files of the same size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PictureFiles {
    /// Index of the scene in [`Results::scenes`](super::Results::scenes).
    pub scene: usize,
    /// Label of the [`Setting`](super::Setting).
    pub setting: String,
    /// Name of the view.
    pub view: String,
    /// Picture of the original.
    pub original: PathBuf,
    /// Picture of the compressed model.
    pub compressed: PathBuf,
    /// Difference of both pictures, times [`AMPLIFICATION`](lexisplat_eval::montage::AMPLIFICATION).
    pub difference: PathBuf,
    /// Photo from the same camera, if there is one.
    pub photo: Option<PathBuf>,
}

/// A picture for the page.
pub(crate) struct Part {
    /// Class in the page's style sheet.
    pub(crate) class: &'static str,
    /// Contents of the picture, in words.
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
