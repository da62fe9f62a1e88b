//! Counts that are taken while coding, and the report that is made of them.

use serde::{Deserialize, Serialize};

use crate::packed::StreamBits;
use crate::sparse::learn::Learned;
use crate::sparse::model::Record;

/// A report of compressing, to an exact layout or to a packed scene.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct CompressReport {
    /// A report of learning; `None` with a given dictionary and for packed scenes.
    pub learned: Option<Learned>,
    /// Mean number of nonzeros of a Gaussian. An escape counts as a full vector.
    pub mean_nonzeros: f64,
    /// Number of Gaussians by their number of nonzeros, from 0 to the dimension. Escapes are not counted.
    pub nonzero_histogram: Vec<u64>,
    /// Number of Gaussians whose SH-rest is stored exactly.
    pub escapes: u64,
    /// Seconds spent learning (0 where there is no clock, as in a browser).
    pub learn_seconds: f64,
    /// Seconds spent coding and verifying; for packed scenes, seconds spent on everything but learning.
    pub code_seconds: f64,
    /// Number of bits of each stream of a packed scene; empty for exact layouts.
    pub stream_bits: Vec<StreamBits>,
}

impl CompressReport {
    /// Returns the paper's ratio: SH-rest coefficients over mean nonzeros. `None` if the mean is 0.
    #[must_use]
    pub fn coefficient_ratio(&self) -> Option<f64> {
        let dim = self.nonzero_histogram.len().saturating_sub(1);
        (self.mean_nonzeros > 0.0).then(|| dim as f64 / self.mean_nonzeros)
    }
}

/// Counts that are taken while coding.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Tally {
    /// Number of Gaussians by their number of nonzeros. Escapes are not counted.
    pub(crate) histogram: Vec<u64>,
    pub(crate) escapes: u64,
    nonzeros: u64,
    max_error: f64,
    squared_error: f64,
    over_tolerance: u64,
}

impl Tally {
    /// Creates empty counts for vectors of length `dim`.
    pub(crate) fn new(dim: usize) -> Self {
        Self { histogram: vec![0; dim + 1], ..Self::default() }
    }

    /// Counts a code with `nonzeros` nonzeros and the error `error`. `tolerance` is the error that it should not exceed.
    pub(crate) fn code(&mut self, nonzeros: usize, error: f64, tolerance: Option<f64>) {
        self.histogram[nonzeros] += 1;
        self.nonzeros += nonzeros as u64;
        self.max_error = self.max_error.max(error);
        self.squared_error += error * error;
        self.over_tolerance += u64::from(tolerance.is_some_and(|t| error > t));
    }

    /// Adds the counts of further Gaussians.
    pub(crate) fn add(&mut self, more: &Self) {
        self.histogram.iter_mut().zip(&more.histogram).for_each(|(a, b)| *a += b);
        self.escapes += more.escapes;
        self.nonzeros += more.nonzeros;
        self.max_error = self.max_error.max(more.max_error);
        self.squared_error += more.squared_error;
        self.over_tolerance += more.over_tolerance;
    }

    /// Returns `record` with the errors, and the report of `gaussians` Gaussians without times.
    pub(crate) fn into_report(self, record: Record, gaussians: usize) -> (Record, CompressReport) {
        let count = gaussians.max(1) as f64;
        let dim = self.histogram.len() as u64 - 1;
        let record = Record {
            max_residual: self.max_error,
            rms_residual: (self.squared_error / count).sqrt(),
            over_tolerance: self.over_tolerance,
            ..record
        };
        let report = CompressReport {
            learned: None,
            mean_nonzeros: (self.nonzeros + self.escapes * dim) as f64 / count,
            nonzero_histogram: self.histogram,
            escapes: self.escapes,
            learn_seconds: 0.0,
            code_seconds: 0.0,
            stream_bits: Vec::new(),
        };
        (record, report)
    }
}
