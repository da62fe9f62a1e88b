//! A PLY read a part at a time, for scenes larger than memory.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::columns::{Packed, ROWS_PER_TASK};
use super::file::PlyFile;
use super::fill::empty;
use super::found::Found;
use super::layout::REST;
use super::options::ReadOptions;
use super::summary::PlySummary;
use crate::scene::dropped::DroppedRows;
use crate::scene::sh::ShDegree;
use crate::scene::source::{SplatSource, check_range};
use crate::scene::splats::{SceneMeta, Splats};
use crate::support::error::Result;
use crate::support::input::Input;
use crate::support::progress::{Progress, Silent, Stage};

/// Number of rows that are read together when a file is opened.
const SCAN_ROWS: usize = 64 * ROWS_PER_TASK;

/// A PLY whose Gaussians are read a part at a time. Its errors, its omissions and its warnings are those of
/// [`read_bytes`](super::read_bytes), but no array is as long as the scene.
#[derive(Debug)]
pub struct PlySource<'a> {
    file: PlyFile<'a>,
    dropped: DroppedRows,
    /// Whether any Gaussian has a normal.
    normals: bool,
    /// The scene, if it was read when the file was opened and is not taken yet.
    whole: Mutex<Option<Splats>>,
    /// The file, if its pages are given back.
    input: Option<&'a Input>,
}

/// A scene and a description of its file.
#[derive(Debug, Clone, PartialEq)]
pub struct PlyRead {
    /// The scene.
    pub splats: Splats,
    /// Warnings about the file, one sentence each.
    pub warnings: Vec<String>,
    /// Description of the file.
    pub summary: PlySummary,
}

impl<'a> PlySource<'a> {
    /// Reads the PLY in `bytes` once and checks all of its values. Messages call it `name`. Reports
    /// [`Stage::Read`] to `progress`.
    ///
    /// # Errors
    /// As [`read_bytes`](super::read_bytes), and [`crate::Error::Cancelled`].
    pub fn open(
        name: &'a str,
        bytes: &'a [u8],
        options: &ReadOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Ok(Self::look(name, bytes, options, SCAN_ROWS, progress)?.0)
    }

    /// Opens as [`Self::open`] does, and keeps the scene for the first call of [`SplatSource::whole`]. The file is then
    /// read once instead of twice. Use it if the whole scene is held in memory anyway.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_whole(
        name: &'a str,
        bytes: &'a [u8],
        options: &ReadOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (mut source, mut splats) = Self::look(name, bytes, options, usize::MAX, progress)?;
        source.file.check_memory(source.file.count, source.normals)?;
        if source.file.meta.offset.is_some() {
            source.file.fill_positions(0..source.file.count, &mut splats)?;
        }
        source.finish(0..source.file.count, &mut splats)?;
        splats.meta = source.file.meta.clone();
        source.whole = Mutex::new(Some(splats));
        Ok(source)
    }

    /// Reads and checks all values, `at_once` rows at a time. Also returns the last rows that were read, without normals.
    fn look(
        name: &'a str,
        bytes: &'a [u8],
        options: &ReadOptions,
        at_once: usize,
        progress: &dyn Progress,
    ) -> Result<(Self, Splats)> {
        let mut file = PlyFile::open(name, bytes, options)?;
        file.check_memory(file.count.min(at_once), false)?;
        let (mut found, mut splats) = (Found::default(), empty(&file.layout));
        progress.begin(Stage::Read, file.count as u64 * file.layout.row_bytes as u64);
        for start in (0..file.count).step_by(at_once) {
            let range = start..start.saturating_add(at_once).min(file.count);
            found.add(file.fill(range, &mut splats, progress)?);
        }
        progress.end();
        file.report(&found, options)?;
        let Found { bad: dropped, normals, position_facts, .. } = found;
        file.settle(position_facts);
        let dropped = DroppedRows::new(dropped);
        Ok((Self { file, dropped, normals, whole: Mutex::default(), input: None }, splats))
    }

    /// Adds the normals to `splats`, which hold rows `rows`, and leaves the dropped rows out.
    fn finish(&self, rows: Range<usize>, splats: &mut Splats) -> Result<()> {
        if self.normals {
            self.file.fill_normals(rows.clone(), splats)?;
        }
        self.dropped.remove(rows, splats);
        Ok(())
    }

    /// Returns the whole scene and the description of its file.
    ///
    /// # Errors
    /// As [`SplatSource::whole`].
    pub fn into_read(self) -> Result<PlyRead> {
        let splats = self.whole()?.into_owned();
        let PlyFile { warnings, summary, .. } = self.file;
        Ok(PlyRead { splats, warnings, summary })
    }

    /// Gives the pages of `input`, whose bytes were opened, back to the system now and after each part that is read
    /// ([`Input::release_pages`]). A scene that is read a part at a time then takes little resident memory.
    #[must_use]
    pub fn releasing_pages_of(mut self, input: &'a Input) -> Self {
        self.input = Some(input);
        self.release();
        self
    }

    fn release(&self) {
        if let Some(input) = self.input {
            input.release_pages();
        }
    }

    /// Returns the SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.file.layout.degree
    }

    /// Returns the comments and the marks.
    #[must_use]
    pub fn meta(&self) -> &SceneMeta {
        &self.file.meta
    }

    /// Returns the warnings about the file, one sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.file.warnings
    }

    /// Returns the description of the file.
    #[must_use]
    pub fn summary(&self) -> &PlySummary {
        &self.file.summary
    }
}

impl SplatSource for PlySource<'_> {
    /// Returns the number of Gaussians, without those left out.
    fn len(&self) -> usize {
        self.file.count - self.dropped.count()
    }

    fn empty(&self) -> Splats {
        Splats { meta: self.file.meta.clone(), ..empty(&self.file.layout) }
    }

    fn has_normals(&self) -> bool {
        self.normals
    }

    fn row_bytes(&self) -> u64 {
        self.file.summary.row_bytes
    }

    fn source_bytes(&self) -> u64 {
        self.file.summary.file_bytes
    }

    fn warnings(&self) -> &[String] {
        &self.file.warnings
    }

    fn read(&self, range: Range<usize>, splats: &mut Splats) -> Result<()> {
        let rows = self.dropped.rows(&range, self.file.count)?;
        self.file.check_memory(rows.len(), self.normals)?;
        self.file.fill(rows.clone(), splats, &Silent)?;
        self.finish(rows, splats)?;
        self.release();
        Ok(())
    }

    fn whole(&self) -> Result<Cow<'_, Splats>> {
        let kept = self.whole.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(splats) = kept {
            return Ok(Cow::Owned(splats));
        }
        let mut splats = self.empty();
        self.read(0..self.len(), &mut splats)?;
        Ok(Cow::Owned(splats))
    }

    fn read_rest(&self, gaussians: &[usize], out: &mut Vec<f32>) -> Result<()> {
        let dim = self.degree().rest();
        let start = out.len();
        out.resize(start + gaussians.len() * dim, 0.0);
        let out = &mut out[start..];
        if let Some(&last) = gaussians.iter().max() {
            check_range(&(last..last.saturating_add(1)), self.len())?;
        }
        // Neighbours in the file are read together, because a line of text is searched for from the last known line on.
        let mut order: Vec<(usize, usize)> =
            gaussians.iter().enumerate().map(|(k, &gaussian)| (self.dropped.row(gaussian), k)).collect();
        order.sort_unstable();
        let row_bytes = self.file.layout.row_bytes;
        for group in order.chunk_by(|a, b| a.0 / ROWS_PER_TASK == b.0 / ROWS_PER_TASK) {
            let (Some(&(first, _)), Some(&(last, _))) = (group.first(), group.last()) else { continue };
            let (bytes, big) = self.file.rows.packed(first..last + 1)?;
            for &(row, k) in group {
                let bytes = &bytes[(row - first) * row_bytes..][..row_bytes];
                let out = &mut out[k * dim..(k + 1) * dim];
                self.file.layout.groups[REST].read(Packed { bytes, row_bytes, big }, out);
            }
        }
        self.release();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::ply::{read_bytes, write};

    /// The first `whole` returns the scene that was read when the file was opened. The second reads the file.
    #[test]
    fn a_file_opened_whole_gives_the_same_as_one_read_in_parts() {
        let count = 2 * ROWS_PER_TASK + 7;
        let mut splats = crate::support::testing::scene(count, 3);
        splats.geometry.normals = vec![[0.0; 3]; count];
        splats.geometry.normals[count - 1] = [0.0, 1.0, 0.0];
        for bad in [0, ROWS_PER_TASK, count - 2] {
            splats.geometry.scales[bad][1] = f32::NAN;
        }
        splats.geometry.opacities[5] = f32::INFINITY;
        let mut bytes = Vec::new();
        write(&mut bytes, &splats).unwrap();
        let refused = PlySource::open_whole("t", &bytes, &ReadOptions::default(), &Silent).unwrap_err();
        let in_parts = PlySource::open("t", &bytes, &ReadOptions::default(), &Silent).unwrap_err();
        assert_eq!(refused.to_string(), in_parts.to_string());
        let options = ReadOptions::default().with_drop_invalid(true);
        let expected = read_bytes("t", &bytes, &options).unwrap();
        assert_eq!(expected.splats.len(), count - 3);
        let opened = PlySource::open_whole("t", &bytes, &options, &Silent).unwrap();
        let in_parts = PlySource::open("t", &bytes, &options, &Silent).unwrap();
        assert_eq!((opened.warnings(), opened.summary()), (in_parts.warnings(), in_parts.summary()));
        assert_eq!((opened.warnings(), opened.len()), (&*expected.warnings, expected.splats.len()));
        for source in [&opened, &opened, &in_parts] {
            assert_eq!(*source.whole().unwrap(), expected.splats);
        }
    }

    #[test]
    fn opening_a_file_whole_can_be_cancelled() {
        struct Cancelled;
        impl Progress for Cancelled {
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        let mut bytes = Vec::new();
        write(&mut bytes, &crate::support::testing::scene(3, 3)).unwrap();
        for open in [PlySource::open, PlySource::open_whole] {
            let error = open("t", &bytes, &ReadOptions::default(), &Cancelled).unwrap_err();
            assert!(matches!(error, crate::Error::Cancelled), "{error}");
        }
    }
}
