//! Several outputs that a program can end at once, and the list of their unfinished files.

use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tempfile::TempPath;

/// Outputs that can be ended together. A program that is ended by a signal then leaves no half-written file.
///
/// [`Output::within`](super::Output::within) puts an output into a group. Clones are the same group.
///
/// [`stop`](Self::stop) takes a lock, so it must not be called in a signal handler. Call it in a thread that
/// waits for signals.
#[derive(Debug, Clone, Default)]
pub struct OutputGroup(Arc<Mutex<State>>);

/// The state of the outputs of a group.
#[derive(Debug, Default)]
pub(super) struct State {
    stopped: bool,
    /// Temporary files that have a name.
    pub(super) names: Vec<PathBuf>,
    /// Number of outputs that are whole.
    pub(super) finished: usize,
}

impl OutputGroup {
    fn state(&self) -> MutexGuard<'_, State> {
        // A thread that panicked left the state consistent: every change is a single step.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes all unfinished files of the group. No output of the group can be finished afterwards.
    ///
    /// Returns the number of outputs that were finished before. They stay. If the number is at least `expected`, nothing is
    /// left to stop, and the function does nothing and returns `None`.
    #[must_use]
    pub fn stop(&self, expected: usize) -> Option<usize> {
        let mut state = self.state();
        if state.finished >= expected {
            return None;
        }
        state.stopped = true;
        for name in state.names.drain(..) {
            // The process is about to end, so a file that cannot be removed must not stop it.
            let _ = std::fs::remove_file(name);
        }
        Some(state.finished)
    }

    /// Returns whether [`stop`](Self::stop) has stopped the group.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.state().stopped
    }

    /// Does `work` unless the group was stopped. [`stop`](Self::stop) waits for `work`, which should be short.
    pub(super) fn unless_stopped<T>(&self, work: impl FnOnce(&mut State) -> io::Result<T>) -> io::Result<T> {
        let mut state = self.state();
        if state.stopped {
            return Err(io::Error::other("the program was stopped"));
        }
        work(&mut state)
    }

    /// Counts an output that was written in place, without a temporary file.
    pub(super) fn count(&self) -> io::Result<()> {
        self.unless_stopped(|state| {
            state.finished += 1;
            Ok(())
        })
    }

    /// Removes a temporary file.
    pub(super) fn remove(&self, path: TempPath) {
        let mut state = self.state();
        state.names.retain(|name| *name != *path);
        drop(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stopping_removes_what_is_unfinished_and_lets_nothing_be_finished() {
        let folder = tempfile::tempdir().unwrap();
        let group = OutputGroup::default();
        let names = ["a", "b", "gone"].map(|name| folder.path().join(name));
        names[..2].iter().for_each(|path| std::fs::write(path, "half").unwrap());
        group.state().names.extend(names);
        group.count().unwrap();
        group.count().unwrap();
        assert_eq!(group.clone().stop(3), Some(2));
        assert!(group.is_stopped() && !OutputGroup::default().is_stopped());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        assert!(group.unless_stopped(|_| -> io::Result<()> { panic!("not to be done") }).is_err());
    }

    #[test]
    fn what_is_all_finished_cannot_be_stopped() {
        let group = OutputGroup::default();
        group.count().unwrap();
        group.count().unwrap();
        assert_eq!(group.stop(2), None);
        assert!(group.count().is_ok());
    }
}
