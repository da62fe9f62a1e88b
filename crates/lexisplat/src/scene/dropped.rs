//! Rows of a file that are left out of a scene.

use std::ops::Range;

use crate::scene::source::check_range;
use crate::scene::splats::Splats;
use crate::support::error::Result;

/// Rows of a file that are left out of a scene, because they have NaN or infinite values. It is for readers of formats.
#[derive(Debug, Clone, Default)]
pub struct DroppedRows(Vec<usize>);

impl DroppedRows {
    /// Creates the list of these rows, which must be ascending.
    #[must_use]
    pub fn new(rows: Vec<usize>) -> Self {
        Self(rows)
    }

    /// Returns the number of rows that are left out.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Returns the row of Gaussian `gaussian`.
    #[must_use]
    pub fn row(&self, gaussian: usize) -> usize {
        // `self.0[j] - j` Gaussians come before row `self.0[j]`.
        let (mut low, mut high) = (0, self.0.len());
        while low < high {
            let middle = low.midpoint(high);
            if self.0[middle] - middle <= gaussian {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        gaussian + low
    }

    /// Returns the rows from that of the first to that of the last of `gaussians`, in a file of `count` rows.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter) if `gaussians` ends after the last Gaussian.
    pub fn rows(&self, gaussians: &Range<usize>, count: usize) -> Result<Range<usize>> {
        check_range(gaussians, count - self.count())?;
        Ok(match gaussians.is_empty() {
            true => 0..0,
            false => self.row(gaussians.start)..self.row(gaussians.end - 1) + 1,
        })
    }

    /// Removes the rows that are left out from `splats`, which has all of `rows`.
    pub fn remove(&self, rows: Range<usize>, splats: &mut Splats) {
        let from = |row: usize| self.0.partition_point(|&dropped| dropped < row);
        let dropped = &self.0[from(rows.start)..from(rows.end)];
        if !dropped.is_empty() {
            let mut keep = vec![true; rows.len()];
            dropped.iter().for_each(|&row| keep[row - rows.start] = false);
            splats.retain(&keep);
        }
    }
}
