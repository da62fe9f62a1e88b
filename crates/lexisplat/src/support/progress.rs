//! Progress reports of long work, and its cancellation.

use crate::support::error::{Error, Result};

/// Receives progress from long work, and may cancel it. All methods may be called from worker threads.
pub trait Progress: Sync {
    /// Is told that a stage starts. The stage has `total` units of work, or an unknown number if `total` is 0. A stage that starts
    /// before the end of another is a part of it, and is the current stage until it ends.
    fn begin(&self, stage: Stage, total: u64) {
        let _ = (stage, total);
    }

    /// Is told that `units` more units of the current stage are done.
    fn advance(&self, units: u64) {
        let _ = units;
    }

    /// Is told the quality that the current stage has reached so far, as the PSNR of pictures in dB.
    fn quality(&self, decibels: f64) {
        let _ = decibels;
    }

    /// Is told that the current stage is over. The stage around it is the current stage again, if there is one.
    fn end(&self) {}

    /// Returns whether the work is to end early. Work that finds `true` returns [`Error::Cancelled`] soon and leaves no
    /// output. The answer must not become `false` again.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// Returns [`Error::Cancelled`] if the work is to end early.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// A stage of work, with its unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Reads a file, in bytes.
    Read,
    /// Learns the dictionary, in rounds.
    Learn,
    /// Measures the sensitivity of a scene part by part, in Gaussians.
    Look,
    /// Draws views, in views.
    Draw,
    /// Codes Gaussians, in Gaussians, or rows of any kind, in rows.
    Code,
    /// Writes a file, in bytes.
    Write,
    /// Scores pictures, in views.
    Score,
    /// Fits Gaussians to pictures, in steps.
    Refine,
}

/// A [`Progress`] that ignores all reports and never cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {}
