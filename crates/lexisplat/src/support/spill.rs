//! Bytes that are made before their file can be written. They are kept in memory or in a temporary file.
//!
//! Temporary files have no name where the system allows that, so no file is left however the process ends.

use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::SpooledTempFile;

use crate::support::crc32;
use crate::support::error::{Error, Result};

/// Number of bytes of the write buffer, and of a block that is copied at a time.
const BUFFER: usize = 1 << 18;

/// The storage of spilled bytes.
#[derive(Debug, Clone, Copy)]
pub(crate) enum SpillTo<'a> {
    Memory,
    /// A temporary file in this folder.
    Folder(&'a Path),
}

/// Bytes in memory or in a temporary file.
#[derive(Debug)]
pub(crate) struct Temporary {
    file: SpooledTempFile,
    /// The folder of the file, or `memory`.
    name: PathBuf,
}

impl Temporary {
    pub(crate) fn new(to: SpillTo<'_>) -> Result<Self> {
        let (mut file, name) = match to {
            SpillTo::Memory => {
                return Ok(Self { file: SpooledTempFile::new(usize::MAX), name: "memory".into() });
            }
            SpillTo::Folder(folder) => (SpooledTempFile::new_in(0, folder), folder.to_owned()),
        };
        file.roll().map_err(|e| Error::temporary_file(&name, e))?;
        Ok(Self { file, name })
    }

    /// Appends `bytes`, and returns the position at which they start.
    pub(crate) fn append(&mut self, bytes: &[u8]) -> Result<u64> {
        let start = self.file.seek(SeekFrom::End(0));
        let start = start.and_then(|start| self.file.write_all(bytes).map(|()| start));
        start.map_err(|e| Error::temporary_file(&self.name, e))
    }

    /// Fills `bytes` with the bytes from position `start` on.
    pub(crate) fn read_at(&mut self, start: u64, bytes: &mut [u8]) -> Result<()> {
        let read = self.file.seek(SeekFrom::Start(start)).and_then(|_| self.file.read_exact(bytes));
        read.map_err(|e| Error::temporary_file(&self.name, e))
    }
}

/// Bytes being spilled, and their checksum.
#[derive(Debug)]
pub(crate) struct Spill {
    file: BufWriter<SpooledTempFile>,
    name: PathBuf,
    checksum: crc32::Hasher,
}

impl Spill {
    /// Creates a spill without bytes.
    pub(crate) fn new(to: SpillTo<'_>) -> Result<Self> {
        let Temporary { file, name } = Temporary::new(to)?;
        let file = BufWriter::with_capacity(BUFFER, file);
        Ok(Self { file, name, checksum: crc32::Hasher::new() })
    }

    /// Appends `values` as they lie in memory.
    pub(crate) fn push<T: bytemuck::NoUninit>(&mut self, values: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        self.checksum.update(bytes);
        self.file.write_all(bytes).map_err(|e| Error::temporary_file(&self.name, e))
    }

    /// Returns all spilled bytes, to be read from the start.
    pub(crate) fn finish(self) -> Result<Spilled> {
        let Self { file, name, checksum } = self;
        let file = file.into_inner().map_err(|e| e.into_error());
        let file = file
            .and_then(|mut file| file.rewind().map(|()| file))
            .map_err(|e| Error::temporary_file(&name, e))?;
        Ok(Spilled { file: Temporary { file, name }, checksum: checksum.finalize() })
    }
}

/// Bytes that were spilled.
#[derive(Debug)]
pub(crate) struct Spilled {
    file: Temporary,
    /// CRC-32 of all bytes.
    pub(crate) checksum: u32,
}

impl Spilled {
    /// Returns the next `count` values.
    pub(crate) fn take<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
        &mut self,
        count: usize,
    ) -> Result<Vec<T>> {
        let mut values = vec![T::zeroed(); count];
        let read = self.file.file.read_exact(bytemuck::cast_slice_mut(&mut values));
        read.map_err(|e| Error::temporary_file(&self.file.name, e))?;
        Ok(values)
    }

    /// Copies the bytes that were not taken to `writer`.
    pub(crate) fn copy_to(self, writer: &mut dyn Write) -> io::Result<()> {
        let Temporary { mut file, name } = self.file;
        let mut block = vec![0; BUFFER];
        loop {
            let read =
                file.read(&mut block).map_err(|e| io::Error::other(Error::temporary_file(&name, e)))?;
            if read == 0 {
                return Ok(());
            }
            writer.write_all(&block[..read])?;
        }
    }
}

/// Spilled bytes that are read piece by piece, in the order of a list of pieces.
#[derive(Debug)]
pub(crate) struct Woven {
    spilled: Spilled,
    /// Start and length of each piece.
    pieces: Vec<(u64, usize)>,
}

impl Woven {
    pub(crate) fn new(spilled: Spilled, pieces: Vec<(u64, usize)>) -> Self {
        Self { spilled, pieces }
    }

    /// Returns the number of bytes of all pieces.
    pub(crate) fn len(&self) -> usize {
        self.pieces.iter().map(|piece| piece.1).sum()
    }

    /// Returns the bytes of all pieces.
    pub(crate) fn into_bytes(self) -> Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(self.len());
        for piece in self.into_pieces() {
            bytes.extend(piece?);
        }
        Ok(bytes)
    }

    /// Copies the bytes of all pieces to `writer`.
    pub(crate) fn copy_to(self, writer: &mut dyn Write) -> io::Result<()> {
        for piece in self.into_pieces() {
            writer.write_all(&piece.map_err(io::Error::other)?)?;
        }
        Ok(())
    }

    fn into_pieces(self) -> impl Iterator<Item = Result<Vec<u8>>> {
        let Self { mut spilled, pieces } = self;
        pieces.into_iter().map(move |(start, length)| {
            let file = &mut spilled.file;
            file.file.seek(SeekFrom::Start(start)).map_err(|e| Error::temporary_file(&file.name, e))?;
            spilled.take(length)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_and_no_file_stays() {
        let folder = tempfile::tempdir().unwrap();
        let values: Vec<u32> = (0..200_000).collect();
        let expected: &[u8] = bytemuck::cast_slice(&values);
        for to in [SpillTo::Memory, SpillTo::Folder(folder.path())] {
            let spilled = || {
                let mut spill = Spill::new(to).unwrap();
                values.chunks(777).for_each(|block| spill.push(block).unwrap());
                spill.finish().unwrap()
            };
            assert_eq!(spilled().checksum, crc32fast::hash(expected));
            let mut found = Vec::new();
            spilled().copy_to(&mut found).unwrap();
            assert!(found == expected);
            let mut taken = spilled();
            assert_eq!(taken.take::<u32>(3).unwrap(), [0, 1, 2]);
            assert_eq!(taken.take::<u32>(values.len() - 3).unwrap(), values[3..]);
            assert!(taken.take::<u8>(1).is_err());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let error = Spill::new(SpillTo::Folder(Path::new("/no/such/folder"))).unwrap_err().to_string();
        assert!(error.contains("/no/such/folder"), "{error}");
    }
}
