//! Every file of this process that is being written under a name of its own, and how to end them all.
//!
//! One for the whole process, since a signal ends the whole process.

use std::io;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempPath;

/// What is being written.
#[derive(Debug)]
pub(super) struct All {
    stopped: bool,
    /// Temporary files that have a name.
    pub(super) names: Vec<PathBuf>,
    /// Outputs that are whole.
    pub(super) finished: usize,
}

static ALL: Mutex<All> = Mutex::new(All::NONE);

fn all() -> MutexGuard<'static, All> {
    // The list is right after every step of a panicked thread.
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does `work`, which [`stop`] waits for, unless all was stopped before. It should be short.
pub(super) fn unless_stopped<T>(work: impl FnOnce(&mut All) -> io::Result<T>) -> io::Result<T> {
    all().unless_stopped(work)
}

/// Counts an output that has no temporary file.
pub(super) fn count() -> io::Result<()> {
    unless_stopped(|all| {
        all.finished += 1;
        Ok(())
    })
}

/// Removes a temporary file.
pub(super) fn remove(path: TempPath) {
    let mut all = all();
    all.names.retain(|name| *name != *path);
    drop(path);
}

/// Whether [`stop`] was called.
#[must_use]
pub fn is_stopped() -> bool {
    all().stopped
}

/// Removes every unfinished file of this process and lets none be finished any more, for a process that is
/// about to end: call it when a signal says so. Returns how many outputs were finished, which stay; `None`,
/// having done nothing, if these are all `expected` ones, so that nothing is left to stop.
///
/// Not for a signal handler itself, since it takes a lock, but for a thread that waits for signals.
#[must_use]
pub fn stop(expected: usize) -> Option<usize> {
    all().stop(expected)
}

impl All {
    const NONE: Self = Self { stopped: false, names: Vec::new(), finished: 0 };

    fn stop(&mut self, expected: usize) -> Option<usize> {
        if self.finished >= expected {
            return None;
        }
        self.stopped = true;
        for name in self.names.drain(..) {
            // What cannot be removed can be no reason to stay.
            let _ = std::fs::remove_file(name);
        }
        Some(self.finished)
    }

    fn unless_stopped<T>(&mut self, work: impl FnOnce(&mut Self) -> io::Result<T>) -> io::Result<T> {
        if self.stopped {
            return Err(io::Error::other("the program was stopped"));
        }
        work(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stopping_removes_what_is_unfinished_and_lets_nothing_be_finished() {
        let folder = tempfile::tempdir().unwrap();
        let mut all = All::NONE;
        for name in ["a", "b"] {
            let path = folder.path().join(name);
            std::fs::write(&path, "half").unwrap();
            all.names.push(path);
        }
        all.names.push(folder.path().join("gone"));
        all.finished = 2;
        assert!(all.unless_stopped(|_| Ok(())).is_ok());
        assert_eq!(all.stop(3), Some(2));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(all.unless_stopped(|_| -> io::Result<()> { panic!("not to be done") }).is_err());
    }

    #[test]
    fn what_is_all_finished_cannot_be_stopped() {
        let mut all = All::NONE;
        all.finished = 2;
        assert_eq!(all.stop(2), None);
        assert!(all.unless_stopped(|_| Ok(())).is_ok());
    }
}
