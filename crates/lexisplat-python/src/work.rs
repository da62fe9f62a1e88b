//! Long work without the GIL, with progress and Ctrl-C.
//!
//! The work runs on a thread of its own. The thread that called waits, and every [`POLL`] it looks for signals and
//! passes reports on, because Python handles signals on its main thread alone.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use lexisplat::{Progress, Stage};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::errors::{Result, raise};

/// Time between two looks at signals and reports: short for a person, long for the work.
pub(crate) const POLL: Duration = Duration::from_millis(50);

/// A report: the stage, units done, and units in all or 0 if that is not known.
type Report = (&'static str, u64, u64);

/// What the work and the thread that waits for it share.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    state: Mutex<State>,
    finished: Condvar,
    done: AtomicU64,
    cancelled: AtomicBool,
}

#[derive(Debug, Default)]
struct State {
    stage: Option<(&'static str, u64)>,
    /// Reports that were not passed on yet, but for how far the stage is.
    reports: Vec<Report>,
    is_over: bool,
}

impl Watch {
    fn state(&self) -> MutexGuard<'_, State> {
        // A panic of the work is passed on when its thread is joined.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the end of the work, at most [`POLL`]. Returns whether it is over.
    fn wait(&self) -> bool {
        let state = self.state();
        let waited = self.finished.wait_timeout_while(state, POLL, |state| !state.is_over);
        waited.unwrap_or_else(PoisonError::into_inner).0.is_over
    }

    fn reports(&self) -> Vec<Report> {
        let mut state = self.state();
        let mut reports = std::mem::take(&mut state.reports);
        let current = state.stage.map(|(name, total)| (name, self.done.load(Ordering::Relaxed), total));
        reports.extend(current.filter(|&(_, done, _)| done > 0));
        reports
    }
}

/// Tells the thread that waits that the work is over, also if it panicked.
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
            Stage::Draw => "draw",
            Stage::Code => "code",
            Stage::Write => "write",
            _ => "work",
        };
        let mut state = self.state();
        self.done.store(0, Ordering::Relaxed);
        state.stage = Some((name, total));
        state.reports.push((name, 0, total));
    }

    fn advance(&self, units: u64) {
        self.done.fetch_add(units, Ordering::Relaxed);
    }

    fn end(&self) {
        let mut state = self.state();
        if let Some((name, total)) = state.stage.take() {
            state.reports.push((name, self.done.load(Ordering::Relaxed), total));
        }
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// The process that first did work here; 0 before there was one.
static PROCESS: AtomicU32 = AtomicU32::new(0);

/// Refuses to work in a process that was forked from one that worked: threads of the pool do not survive a fork, and would
/// be waited for without end.
pub(crate) fn check_process() -> PyResult<()> {
    let own = std::process::id();
    match PROCESS.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(first) if first != own => Err(PyRuntimeError::new_err(
            "lexisplat was used before this process was forked: start processes by spawn (multiprocessing.get_context(\"spawn\"))",
        )),
        _ => Ok(()),
    }
}

/// Does `work` without the GIL. `progress` is called with the stage, units done and units in all, or is `None`. A signal
/// handler or a `progress` that raises ends the work, and what it raised is raised.
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
