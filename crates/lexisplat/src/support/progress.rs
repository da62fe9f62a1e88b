//! How long work tells its caller where it stands.

/// Receives progress from long work. All methods may be called from worker threads.
pub trait Progress: Sync {
    /// A stage starts that will do `total` units of work.
    fn begin(&self, stage: Stage, total: u64) {
        let _ = (stage, total);
    }
    /// `units` more are done.
    fn advance(&self, units: u64) {
        let _ = units;
    }
    /// The stage is over.
    fn end(&self) {}
}

/// A stage of work, with its unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Reading a file, in bytes.
    Read,
    /// Learning the dictionary, in rounds.
    Learn,
    /// Drawing parts of the scene to see what shows, in Gaussians.
    Look,
    /// Coding, in Gaussians.
    Code,
    /// Writing a file, in bytes.
    Write,
}

/// Ignores all progress.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {}
