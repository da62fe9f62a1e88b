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

static ALL: Mutex<All> = Mutex::new(All { stopped: false, names: Vec::new(), finished: 0 });

fn all() -> MutexGuard<'static, All> {
    // The list is right after every step of a panicked thread.
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does `work`, which [`stop`] waits for, unless all was stopped before. It should be short.
pub(super) fn unless_stopped<T>(work: impl FnOnce(&mut All) -> io::Result<T>) -> io::Result<T> {
    let mut all = all();
    if all.stopped {
        return Err(io::Error::other("the program was stopped"));
    }
    work(&mut all)
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
    let mut all = all();
    if all.finished >= expected {
        return None;
    }
    all.stopped = true;
    for name in all.names.drain(..) {
        // What cannot be removed is one that was not made.
        let _ = std::fs::remove_file(name);
    }
    Some(all.finished)
}
