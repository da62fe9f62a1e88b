//! Bytes that are made before the file they belong to can be written: kept in memory or in a temporary file.
//!
//! Temporary files have no name where the system allows that, so nothing is left however the process ends.

use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::support::error::{Error, Result};

/// Bytes of the write buffer, and of what is copied at a time.
const BUFFER: usize = 1 << 18;

/// Where spilled bytes are kept.
#[derive(Debug, Clone, Copy)]
pub(crate) enum SpillTo<'a> {
    Memory,
    /// A temporary file in this folder.
    Folder(&'a Path),
}

/// A temporary file, and its folder for errors.
#[derive(Debug)]
pub(crate) struct TemporaryFile {
    file: File,
    folder: PathBuf,
}

impl TemporaryFile {
    pub(crate) fn new(folder: &Path) -> Result<Self> {
        let file = tempfile::tempfile_in(folder).map_err(|e| Error::temporary_file(folder, e))?;
        Ok(Self { file, folder: folder.to_owned() })
    }

    /// Appends `bytes`, and returns where they start.
    pub(crate) fn append(&mut self, bytes: &[u8]) -> Result<u64> {
        let append = |file: &mut File| {
            let start = file.seek(SeekFrom::End(0))?;
            file.write_all(bytes)?;
            Ok(start)
        };
        append(&mut self.file).map_err(|e| Error::temporary_file(&self.folder, e))
    }

    /// Fills `bytes` from `start` on.
    pub(crate) fn read_at(&mut self, start: u64, bytes: &mut [u8]) -> Result<()> {
        let read = self.file.seek(SeekFrom::Start(start)).and_then(|_| self.file.read_exact(bytes));
        read.map_err(|e| Error::temporary_file(&self.folder, e))
    }
}

/// Bytes being spilled, and their checksum.
#[derive(Debug)]
pub(crate) struct Spill {
    kept: Kept<BufWriter<File>>,
    checksum: crc32fast::Hasher,
    len: u64,
}

#[derive(Debug)]
enum Kept<F> {
    Memory(Vec<u8>),
    File { file: F, folder: PathBuf },
}

impl Spill {
    /// An empty one.
    pub(crate) fn new(to: SpillTo<'_>) -> Result<Self> {
        let kept = match to {
            SpillTo::Memory => Kept::Memory(Vec::new()),
            SpillTo::Folder(folder) => {
                let TemporaryFile { file, folder } = TemporaryFile::new(folder)?;
                Kept::File { file: BufWriter::with_capacity(BUFFER, file), folder }
            }
        };
        Ok(Self { kept, checksum: crc32fast::Hasher::new(), len: 0 })
    }

    /// Appends `values` as they lie in memory.
    pub(crate) fn push<T: bytemuck::NoUninit>(&mut self, values: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        self.checksum.update(bytes);
        self.len += bytes.len() as u64;
        match &mut self.kept {
            Kept::Memory(kept) => {
                kept.extend_from_slice(bytes);
                Ok(())
            }
            Kept::File { file, folder } => {
                file.write_all(bytes).map_err(|e| Error::temporary_file(folder, e))
            }
        }
    }

    /// All of it, to be read from the start.
    pub(crate) fn finish(self) -> Result<Spilled> {
        let kept = match self.kept {
            Kept::Memory(bytes) => Kept::Memory(bytes),
            Kept::File { file, folder } => {
                let io = |e| Error::temporary_file(&folder, e);
                let mut file = file.into_inner().map_err(|e| io(e.into_error()))?;
                file.rewind().map_err(io)?;
                Kept::File { file, folder }
            }
        };
        Ok(Spilled { kept, taken: 0, checksum: self.checksum.finalize(), len: self.len })
    }
}

/// Bytes that were spilled.
#[derive(Debug)]
pub(crate) struct Spilled {
    kept: Kept<File>,
    /// Bytes of memory that were taken.
    taken: usize,
    /// CRC-32.
    pub(crate) checksum: u32,
    pub(crate) len: u64,
}

impl Spilled {
    /// The next `count` values.
    pub(crate) fn take<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
        &mut self,
        count: usize,
    ) -> Result<Vec<T>> {
        let mut values = vec![T::zeroed(); count];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        match &mut self.kept {
            Kept::Memory(kept) => {
                let mut rest = &kept[self.taken.min(kept.len())..];
                rest.read_exact(bytes).map_err(|e| Error::io("memory", e))?;
                self.taken += bytes.len();
            }
            Kept::File { file, folder } => {
                file.read_exact(bytes).map_err(|e| Error::temporary_file(folder, e))?;
            }
        }
        Ok(values)
    }

    /// All bytes.
    pub(crate) fn into_bytes(mut self) -> Result<Vec<u8>> {
        match self.kept {
            Kept::Memory(bytes) => Ok(bytes),
            Kept::File { .. } => {
                let len = usize::try_from(self.len).unwrap_or(usize::MAX);
                self.take(len)
            }
        }
    }

    /// Copies them to `writer`.
    pub(crate) fn copy_to(self, writer: &mut dyn Write) -> std::io::Result<()> {
        let (mut file, folder) = match self.kept {
            Kept::Memory(bytes) => return writer.write_all(&bytes),
            Kept::File { file, folder } => (file, folder),
        };
        let mut block = vec![0; BUFFER];
        loop {
            let read = file.read(&mut block);
            match read.map_err(|e| std::io::Error::other(Error::temporary_file(&folder, e)))? {
                0 => return Ok(()),
                read => writer.write_all(&block[..read])?,
            }
        }
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
                values.chunks(777).for_each(|part| spill.push(part).unwrap());
                spill.finish().unwrap()
            };
            assert_eq!(spilled().checksum, crc32fast::hash(expected));
            assert_eq!(spilled().len, expected.len() as u64);
            let mut found = Vec::new();
            spilled().copy_to(&mut found).unwrap();
            assert!(found == expected && spilled().into_bytes().unwrap() == expected);
            let mut parts = spilled();
            assert_eq!(parts.take::<u32>(3).unwrap(), [0, 1, 2]);
            assert_eq!(parts.take::<u32>(values.len() - 3).unwrap(), values[3..]);
            assert!(parts.take::<u8>(1).is_err());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let error = Spill::new(SpillTo::Folder(Path::new("/no/such/folder"))).unwrap_err().to_string();
        assert!(error.contains("/no/such/folder"), "{error}");
    }
}
