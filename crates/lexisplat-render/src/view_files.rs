//! Files from which cameras are read, in a folder or in memory.

use std::collections::BTreeMap;
use std::io::{BufRead, Cursor, Read, Seek};
use std::path::Path;

use crate::error::{Error, Result};

/// Largest JSON file read, in bytes: 40 times the size of the file of the largest scene of Mip-NeRF 360.
pub const MAX_CAMERAS_BYTES: u64 = 16 << 20;

/// The files of a folder with cameras. Names of files in sub-folders have `/` between their parts.
pub trait ViewFiles {
    /// Returns the name of the folder in errors.
    fn name(&self) -> String;

    /// Returns whether there is a file called `file`.
    fn has(&self, file: &str) -> bool;

    /// Opens `file`.
    ///
    /// # Errors
    /// [`lexisplat::Error::Io`] if there is no such file, or it cannot be read.
    fn open(&self, file: &str) -> Result<ViewFile<'_>>;
}

/// A reader of an open file.
pub trait ReadSeek: BufRead + Seek {}

impl<R: BufRead + Seek> ReadSeek for R {}

/// An open file of [`ViewFiles`].
pub struct ViewFile<'a> {
    /// Name of the file in errors.
    pub name: String,
    /// Reader of the bytes, from the first byte on.
    pub reader: Box<dyn ReadSeek + 'a>,
    /// Number of bytes.
    pub len: u64,
}

impl std::fmt::Debug for ViewFile<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ViewFile").field("name", &self.name).field("len", &self.len).finish_non_exhaustive()
    }
}

impl<'a> ViewFile<'a> {
    /// Returns a file called `name` whose bytes are in memory.
    #[must_use]
    pub fn from_bytes(name: String, bytes: &'a [u8]) -> Self {
        Self { name, reader: Box::new(Cursor::new(bytes)), len: bytes.len() as u64 }
    }

    /// Reads all bytes without a byte order mark of UTF-8. Of a file over [`MAX_CAMERAS_BYTES`] only one byte more than
    /// the limit is read.
    pub(crate) fn read_limited(self) -> Result<(String, Vec<u8>)> {
        let mut bytes = Vec::new();
        let read = self.reader.take(MAX_CAMERAS_BYTES + 1).read_to_end(&mut bytes);
        read.map_err(|source| Error::io(&self.name, source))?;
        let mark = bytes.len() - lexisplat::without_byte_order_mark(&bytes).len();
        bytes.drain(..mark);
        Ok((self.name, bytes))
    }
}

/// Returns the name of `file` in the folder called `folder`.
pub(crate) fn within(folder: &str, file: &str) -> String {
    Path::new(folder).join(file).display().to_string()
}

/// Files in memory, by name.
impl ViewFiles for BTreeMap<String, Vec<u8>> {
    fn name(&self) -> String {
        String::new()
    }

    fn has(&self, file: &str) -> bool {
        self.contains_key(file)
    }

    fn open(&self, file: &str) -> Result<ViewFile<'_>> {
        let bytes = self.get(file).ok_or_else(|| Error::io(file, std::io::ErrorKind::NotFound.into()))?;
        Ok(ViewFile::from_bytes(file.to_owned(), bytes))
    }
}

/// Files of a folder on disk. Only regular files inside the folder are opened.
#[cfg(not(target_family = "wasm"))]
impl ViewFiles for Path {
    fn name(&self) -> String {
        self.display().to_string()
    }

    fn has(&self, file: &str) -> bool {
        self.join(file).is_file()
    }

    fn open(&self, file: &str) -> Result<ViewFile<'_>> {
        // A data set may come from anybody, and so may the links in it. The readers check the sizes of files.
        let found = lexisplat::file_inside(self, file, u64::MAX)?;
        let opened = open(&found)?;
        Ok(ViewFile { name: self.join(file).display().to_string(), ..opened })
    }
}

/// Opens the file at `path`.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn open(path: &Path) -> Result<ViewFile<'static>> {
    let io = |source| Error::io(path, source);
    let file = std::fs::File::open(path).map_err(io)?;
    let len = file.metadata().map_err(io)?.len();
    let reader = Box::new(std::io::BufReader::new(file));
    Ok(ViewFile { name: path.display().to_string(), reader, len })
}
