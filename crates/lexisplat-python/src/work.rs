//! Long work without the GIL, with progress and Ctrl-C.
//!
//! The work runs on a thread of its own. The calling thread waits. After each [`POLL`] it checks for signals and passes
//! reports on, because Python handles signals only on its main thread.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use lexisplat::{Progress, Stage};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::errors::{Result, raise};

/// Time between two checks for signals and reports. It is short for a person and long for the work.
pub(crate) const POLL: Duration = Duration::from_millis(50);

/// A report: the stage, the number of units done, and the number of all units, or 0 if that is not known.
type Report = (&'static str, u64, u64);

/// State shared by the work and the thread that waits for it.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    state: Mutex<State>,
    finished: Condvar,
    /// Number of units done in the current stage.
    done: AtomicU64,
    cancelled: AtomicBool,
}

#[derive(Debug, Default)]
struct State {
    /// The stages that began and did not end: each within the one before, with the units that were done when the next began.
    stages: Vec<Report>,
    /// Reports of stages that began or ended and were not passed on yet. The number of units done in the current stage is
    /// not among them.
    reports: Vec<Report>,
    is_over: bool,
}

impl Watch {
    fn state(&self) -> MutexGuard<'_, State> {
        // A panic of the work is passed on when its thread is joined.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the end of the work, at most [`POLL`]. Returns whether the work is over.
    fn wait(&self) -> bool {
        let state = self.state();
        let waited = self.finished.wait_timeout_while(state, POLL, |state| !state.is_over);
        waited.unwrap_or_else(PoisonError::into_inner).0.is_over
    }

    fn reports(&self) -> Vec<Report> {
        let mut state = self.state();
        let mut reports = std::mem::take(&mut state.reports);
        let current =
            state.stages.last().map(|&(name, _, total)| (name, self.done.load(Ordering::Relaxed), total));
        reports.extend(current.filter(|&(_, done, _)| done > 0));
        reports
    }
}

/// Tells the waiting thread on drop that the work is over, also after a panic.
struct Over<'a>(&'a Watch);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.state().is_over = true;
        self.0.finished.notify_all();
    }
}

impl Progress for Watch {
    fn begin(&self, stage: Stage, total: u64) {
        let name = match stage {
            Stage::Read => "read",
            Stage::Learn => "learn",
            Stage::Look => "look",
            Stage::Refine => "refine",
            Stage::Draw => "draw",
            Stage::Code => "code",
            Stage::Write => "write",
            _ => "work",
        };
        let mut state = self.state();
        let done = self.done.swap(0, Ordering::Relaxed);
        if let Some(around) = state.stages.last_mut() {
            around.1 = done;
        }
        state.stages.push((name, 0, total));
        state.reports.push((name, 0, total));
    }

    fn advance(&self, units: u64) {
        self.done.fetch_add(units, Ordering::Relaxed);
    }

    fn end(&self) {
        let mut state = self.state();
        if let Some((name, _, total)) = state.stages.pop() {
            let around = state.stages.last().map_or(0, |around| around.1);
            let done = self.done.swap(around, Ordering::Relaxed);
            state.reports.push((name, done, total));
        }
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// Id of the process that first did work here; 0 before any work.
static PROCESS: AtomicU32 = AtomicU32::new(0);

/// Returns an error in a process that was forked from a process that has done work. The threads of the pool do not
/// survive a fork, and the work would wait for them forever.
pub(crate) fn check_process() -> PyResult<()> {
    let own = std::process::id();
    match PROCESS.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(first) if first != own => Err(PyRuntimeError::new_err(
            "lexisplat was used before this process was forked: start processes by spawn (multiprocessing.get_context(\"spawn\"))",
        )),
        _ => Ok(()),
    }
}

/// Calls `work` without the GIL. `progress` is called with the stage, units done and all units; it may be `None`. If a
/// signal handler or `progress` raises an exception, the work ends and the exception is raised.
pub(crate) fn without_gil<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<T> + Send,
) -> PyResult<T> {
    check_process()?;
    let watch = Watch::default();
    let mut failure = None;
    let outcome = std::thread::scope(|scope| {
        let worker = scope.spawn(|| {
            let _over = Over(&watch);
            work(&watch)
        });
        loop {
            let is_over = py.detach(|| watch.wait());
            let told = py.check_signals().and_then(|()| match progress.filter(|_| failure.is_none()) {
                Some(call) => watch.reports().into_iter().try_for_each(|report| call.call1(report).map(drop)),
                None => Ok(()),
            });
            if let Err(error) = told {
                watch.cancelled.store(true, Ordering::Relaxed);
                failure.get_or_insert(error);
            }
            if is_over {
                break;
            }
        }
        py.detach(|| worker.join())
    });
    let outcome = outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    match failure {
        Some(error) => Err(error),
        None => outcome.map_err(|error| raise(py, &error)),
    }
}
