//! A PLY read a part at a time, for scenes larger than memory.

use std::ops::Range;

use super::columns::Packed;
use super::file::PlyFile;
use super::fill::{Bad, empty, fill, fill_normals};
use super::read::ReadOptions;
use super::rows::ROWS_PER_TASK;
use super::summary::PlySummary;
use crate::scene::sh::ShDegree;
use crate::scene::source::{SplatSource, check_range};
use crate::scene::splats::{SceneMeta, Splats};
use crate::support::error::Result;
use crate::support::progress::{Progress, Stage};

/// Rows read together when a file is opened.
const SCAN_ROWS: usize = 64 * ROWS_PER_TASK;

/// A PLY whose Gaussians are read a part at a time. It refuses, leaves out and warns of the same as
/// [`read_bytes`](super::read_bytes), but no array is as long as the scene.
#[derive(Debug)]
pub struct PlySource<'a> {
    source: PlyFile<'a>,
    /// Rows left out, ascending.
    dropped: Vec<usize>,
    /// Whether any Gaussian has a normal.
    normals: bool,
}

impl<'a> PlySource<'a> {
    /// Reads the PLY in `bytes` once to find out what is in it; messages call it `name`. Reports
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
        let mut source = PlyFile::open(name, bytes, options)?;
        let (mut bad, mut normals, mut sure) = (Vec::<Bad>::new(), false, 0);
        source.check_memory(source.count.min(SCAN_ROWS), false)?;
        let mut scratch = empty(&source.layout);
        progress.begin(Stage::Read, source.count as u64 * source.layout.row_bytes as u64);
        for start in (0..source.count).step_by(SCAN_ROWS) {
            progress.check()?;
            let range = start..(start + SCAN_ROWS).min(source.count);
            progress.advance(range.len() as u64 * source.layout.row_bytes as u64);
            let found = fill(&source.rows, &source.layout, name, range, &mut scratch)?;
            bad.extend(found.bad);
            normals |= found.normals;
            sure += found.sure;
        }
        progress.end();
        source.report(&bad, sure, options)?;
        let dropped = bad.into_iter().flat_map(|b| b.rows).collect();
        Ok(Self { source, dropped, normals })
    }

    /// SH degree.
    #[must_use]
    pub fn degree(&self) -> ShDegree {
        self.source.layout.degree
    }

    /// Comments and marks.
    #[must_use]
    pub fn meta(&self) -> &SceneMeta {
        &self.source.meta
    }

    /// Oddities that did not prevent reading, one plain sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.source.warnings
    }

    /// What the file was like.
    #[must_use]
    pub fn summary(&self) -> &PlySummary {
        &self.source.summary
    }

    /// The row of Gaussian `gaussian`.
    fn row(&self, gaussian: usize) -> usize {
        // `dropped[j] - j` Gaussians come before the dropped row number j.
        let (mut low, mut high) = (0, self.dropped.len());
        while low < high {
            let middle = low.midpoint(high);
            if self.dropped[middle] - middle <= gaussian {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        gaussian + low
    }
}

impl SplatSource for PlySource<'_> {
    /// Number of Gaussians, without those left out.
    fn len(&self) -> usize {
        self.source.count - self.dropped.len()
    }

    fn empty(&self) -> Splats {
        Splats { meta: self.source.meta.clone(), ..empty(&self.source.layout) }
    }

    fn has_normals(&self) -> bool {
        self.normals
    }

    fn row_bytes(&self) -> u64 {
        self.source.summary.row_bytes
    }

    fn source_bytes(&self) -> u64 {
        self.source.summary.file_bytes
    }

    fn warnings(&self) -> &[String] {
        &self.source.warnings
    }

    fn read(&self, range: Range<usize>, splats: &mut Splats) -> Result<()> {
        check_range(&range, self.len())?;
        let rows = match range.end.checked_sub(1) {
            Some(last) if last >= range.start => self.row(range.start)..self.row(last) + 1,
            _ => 0..0,
        };
        self.source.check_memory(rows.len(), self.normals)?;
        fill(&self.source.rows, &self.source.layout, self.source.name, rows.clone(), splats)?;
        if self.normals {
            fill_normals(&self.source.rows, &self.source.layout, rows.clone(), splats)?;
        }
        if rows.len() > range.len() {
            let first = self.dropped.partition_point(|&row| row < rows.start);
            let mut keep = vec![true; rows.len()];
            for &row in self.dropped[first..].iter().take_while(|&&row| row < rows.end) {
                keep[row - rows.start] = false;
            }
            splats.retain(&keep);
        }
        Ok(())
    }

    fn read_rest(&self, gaussians: &[usize], out: &mut Vec<f32>) -> Result<()> {
        let dim = self.degree().rest();
        let start = out.len();
        out.resize(start + gaussians.len() * dim, 0.0);
        let out = &mut out[start..];
        if let Some(&last) = gaussians.iter().max() {
            check_range(&(last..last.saturating_add(1)), self.len())?;
        }
        // Neighbours in the file are read together: a line of text is found from the last known one on.
        let mut order: Vec<(usize, usize)> =
            gaussians.iter().enumerate().map(|(k, &gaussian)| (self.row(gaussian), k)).collect();
        order.sort_unstable();
        let row_bytes = self.source.layout.row_bytes;
        for group in order.chunk_by(|a, b| a.0 / ROWS_PER_TASK == b.0 / ROWS_PER_TASK) {
            let (Some(&(first, _)), Some(&(last, _))) = (group.first(), group.last()) else { continue };
            let (bytes, big) = self.source.rows.packed(first..last + 1)?;
            for &(row, k) in group {
                let bytes = &bytes[(row - first) * row_bytes..][..row_bytes];
                let out = &mut out[k * dim..(k + 1) * dim];
                self.source.layout.rest.read(Packed { bytes, row_bytes, big }, out);
            }
        }
        Ok(())
    }
}
