//! Ends the program when Ctrl-C or another signal asks for it. It removes unfinished outputs, prints one line, and ends
//! by that signal.

use std::sync::{Mutex, PoisonError};

use crate::bar;
use crate::files::outputs;
use crate::terminal::note;

/// The outputs that a command is writing. The line that is printed after a signal depends on them.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Work {
    /// No output.
    Nothing,
    /// This number of files. Once all of them are whole, the program ignores the signal and ends by itself. `usize::MAX`
    /// means that the signal is never ignored.
    Files(usize),
    /// Files from which a second run of the same command continues.
    Resumable,
    /// Standard output.
    Stream,
}

static WORK: Mutex<Work> = Mutex::new(Work::Nothing);

/// Sets the outputs that the command writes from now on.
pub(crate) fn while_writing(work: Work) {
    *WORK.lock().unwrap_or_else(PoisonError::into_inner) = work;
}

/// Blocks if a signal is ending the program, so that only the signal's thread prints and chooses the exit code.
pub(crate) fn wait_if_stopped() {
    while outputs().is_stopped() {
        std::thread::park();
    }
}

/// Removes unfinished outputs and prints a line. Returns `false` if all outputs are whole already.
#[cfg_attr(not(any(unix, windows)), expect(dead_code, reason = "there are no signals"))]
fn stopped_by(name: &str) -> bool {
    let work = *WORK.lock().unwrap_or_else(PoisonError::into_inner);
    let expected = match work {
        Work::Files(count) => count,
        _ => usize::MAX,
    };
    let Some(finished) = outputs().stop(expected) else { return false };
    let outcome = match (work, finished) {
        (Work::Nothing, _) => String::new(),
        (Work::Stream, _) => "; standard output is incomplete".to_owned(),
        (Work::Resumable, _) => "; run the same command again to continue".to_owned(),
        (Work::Files(_), 0) => "; no output was written".to_owned(),
        (Work::Files(_), 1) => "; 1 output is complete, no other was written".to_owned(),
        (Work::Files(_), n) => format!("; {n} outputs are complete, no other was written"),
    };
    bar::clear();
    note(&format!("error: stopped by {name}{outcome}"));
    true
}

#[cfg(unix)]
pub(crate) use self::unix::listen;

#[cfg(unix)]
mod unix {
    use std::ffi::c_int;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::{flag, iterator::Signals, low_level};

    /// Number that a shell adds to the number of a signal to make an exit code (POSIX).
    const SHELL: c_int = 128;

    /// Starts to watch for signals. If this fails, signals end the program at once, which is the default.
    ///
    /// SIGHUP stays ignored if it was ignored at the start, because `nohup` asks for that. SIGINT does not stay ignored:
    /// shells ignore it for the background jobs of a script, and such a job would outlive its script.
    pub(crate) fn listen() {
        let mut signals = vec![SIGINT, SIGTERM];
        if !is_ignored(SIGHUP) {
            signals.push(SIGHUP);
        }
        // With a handler, writing a file over the limit of `ulimit -f` fails like writing to a full disk.
        let _ = flag::register(SIGXFSZ, Arc::default());
        let _ = watch(&signals);
    }

    fn watch(signals: &[c_int]) -> std::io::Result<()> {
        // The second signal ends the program at once. The handler that ends it is registered before the handler that sets
        // the flag, so that the first signal does not find the flag set.
        let once = Arc::new(AtomicBool::new(false));
        // The watcher is registered first. Otherwise a signal in between would only set the flag.
        let mut watched = Signals::new(signals)?;
        for &signal in signals {
            flag::register_conditional_default(signal, Arc::clone(&once))?;
            flag::register(signal, Arc::clone(&once))?;
        }
        std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
            for signal in watched.forever() {
                if super::stopped_by(name(signal)) {
                    end(signal);
                }
            }
        })?;
        Ok(())
    }

    fn name(signal: c_int) -> &'static str {
        match signal {
            SIGINT => "SIGINT",
            SIGTERM => "SIGTERM",
            _ => "SIGHUP",
        }
    }

    /// Ends the program by the default action of the signal, so that the caller sees the signal. A shell then also ends
    /// the loop in which the program ran.
    fn end(signal: c_int) {
        // The kernel does not end the first process of a container by a signal.
        if std::process::id() != 1 {
            let _ = low_level::emulate_default_handler(signal);
        }
        low_level::exit(SHELL + signal);
    }

    /// Returns whether `signal` was ignored when the program started; `false` if there is no `/proc`.
    fn is_ignored(signal: c_int) -> bool {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
        mask >> (signal - 1) & 1 == 1
    }
}

/// Exit code after Ctrl-C, the same as on Unix.
#[cfg(windows)]
const INTERRUPTED: i32 = 130;

/// Starts to watch for Ctrl-C.
#[cfg(windows)]
pub(crate) fn listen() {
    let _ = ctrlc::set_handler(|| {
        if stopped_by("Ctrl-C") {
            std::process::exit(INTERRUPTED);
        }
    });
}

#[cfg(not(any(unix, windows)))]
pub(crate) fn listen() {}
