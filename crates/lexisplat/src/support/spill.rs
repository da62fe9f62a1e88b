//! Bytes that are made before the file they belong to can be written: kept in temporary files.
//!
//! The files have no name where the system allows that, so nothing is left however the process ends.

use std::fs::File;
use std::io::{BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

use crate::support::error::{Error, Result};

/// Bytes of the write buffer, and of what is copied at a time.
const BUFFER: usize = 1 << 18;

/// A temporary file in `folder`.
pub(crate) fn temporary(folder: &Path) -> Result<File> {
    tempfile::tempfile_in(folder).map_err(|e| Error::temporary_file(folder, e))
}

/// Bytes being set aside, and their checksum.
#[derive(Debug)]
pub(crate) struct Spill {
    file: BufWriter<File>,
    folder: PathBuf,
    checksum: crc32fast::Hasher,
}

impl Spill {
    /// An empty one in `folder`.
    pub(crate) fn new(folder: &Path) -> Result<Self> {
        let file = BufWriter::with_capacity(BUFFER, temporary(folder)?);
        Ok(Self { file, folder: folder.to_owned(), checksum: crc32fast::Hasher::new() })
    }

    /// Appends `values` as they lie in memory.
    pub(crate) fn push<T: bytemuck::NoUninit>(&mut self, values: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        self.checksum.update(bytes);
        self.file.write_all(bytes).map_err(|e| Error::temporary_file(&self.folder, e))
    }

    /// All of it, to be read from the start.
    pub(crate) fn finish(self) -> Result<Spilled> {
        let Self { file, folder, checksum } = self;
        let io = |e| Error::temporary_file(&folder, e);
        let mut file = file.into_inner().map_err(|e| io(e.into_error()))?;
        file.rewind().map_err(io)?;
        Ok(Spilled { file, folder, checksum: checksum.finalize() })
    }
}

/// Bytes set aside.
#[derive(Debug)]
pub(crate) struct Spilled {
    file: File,
    folder: PathBuf,
    /// CRC-32.
    pub(crate) checksum: u32,
}

impl Spilled {
    /// The next `count` values.
    pub(crate) fn take<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
        &mut self,
        count: usize,
    ) -> Result<Vec<T>> {
        let mut values = vec![T::zeroed(); count];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        self.file.read_exact(bytes).map_err(|e| Error::temporary_file(&self.folder, e))?;
        Ok(values)
    }

    /// Copies them to `writer`.
    pub(crate) fn copy_to(mut self, writer: &mut dyn Write) -> std::io::Result<()> {
        let mut block = vec![0; BUFFER];
        loop {
            let read = self.file.read(&mut block)?;
            if read == 0 {
                return Ok(());
            }
            writer.write_all(&block[..read])?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_and_no_file_stays() {
        let folder = tempfile::tempdir().unwrap();
        let mut spill = Spill::new(folder.path()).unwrap();
        let values: Vec<u32> = (0..200_000).collect();
        for part in values.chunks(777) {
            spill.push(part).unwrap();
        }
        let spilled = spill.finish().unwrap();
        let expected: &[u8] = bytemuck::cast_slice(&values);
        assert_eq!(spilled.checksum, crc32fast::hash(expected));
        let mut found = Vec::new();
        spilled.copy_to(&mut found).unwrap();
        assert!(found == expected);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let error = Spill::new(Path::new("/no/such/folder")).unwrap_err().to_string();
        assert!(error.contains("/no/such/folder"), "{error}");
    }
}
