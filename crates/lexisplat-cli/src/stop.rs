//! Ctrl-C and its like: remove what is unfinished, say so in a line, end by the signal.

use std::sync::{Mutex, PoisonError};

use crate::files::{note, outputs};
use crate::progress;

/// What a command writes, which says what a signal finds.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Work {
    /// Nothing.
    Nothing,
    /// So many files; when all are whole a signal comes too late. `usize::MAX` if it never does.
    Files(usize),
    /// Files that a second run goes on from.
    Resumable,
    /// Standard output.
    Stream,
}

static WORK: Mutex<Work> = Mutex::new(Work::Nothing);

/// Says what the command writes from here on.
pub(crate) fn while_writing(work: Work) {
    *WORK.lock().unwrap_or_else(PoisonError::into_inner) = work;
}

/// Keeps the program from saying how it ended, and from ending first, if a signal is ending it.
pub(crate) fn wait_if_stopped() {
    while outputs().is_stopped() {
        std::thread::park();
    }
}

/// Ends what is being written and says so. `false` if nothing is left to end.
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
        (Work::Stream, _) => "; what went to standard output is not whole".to_owned(),
        (Work::Resumable, _) => "; the same command goes on from here".to_owned(),
        (Work::Files(_), 0) => "; no output was written".to_owned(),
        (Work::Files(_), 1) => "; 1 output is whole, no other was written".to_owned(),
        (Work::Files(_), n) => format!("; {n} outputs are whole, no other was written"),
    };
    progress::clear();
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

    /// What a shell adds to a signal's number to make an exit code.
    const SHELL: c_int = 128;

    /// Begins to watch for signals. Where that cannot be done they end the program as ever.
    ///
    /// A hang-up stays ignored if it is, since `nohup` means that. An interrupt does not, although shells
    /// start what scripts put in the background so: it would not end with its script.
    pub(crate) fn listen() {
        let mut signals = vec![SIGINT, SIGTERM];
        if !is_ignored(SIGHUP) {
            signals.push(SIGHUP);
        }
        // With any handler, a file over the limit of `ulimit -f` is an error like a full disk.
        let _ = flag::register(SIGXFSZ, Arc::default());
        let _ = watch(&signals);
    }

    fn watch(signals: &[c_int]) -> std::io::Result<()> {
        // The second signal ends the program at once. The order matters: the first must not find the flag set.
        let once = Arc::new(AtomicBool::new(false));
        for &signal in signals {
            flag::register_conditional_default(signal, Arc::clone(&once))?;
            flag::register(signal, Arc::clone(&once))?;
        }
        let mut signals = Signals::new(signals)?;
        std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
            for signal in signals.forever() {
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

    /// Ends as the signal would have, so that the caller sees it: a loop of a shell ends too.
    fn end(signal: c_int) {
        // The system spares the first process of a container what a signal does.
        if std::process::id() != 1 {
            let _ = low_level::emulate_default_handler(signal);
        }
        low_level::exit(SHELL + signal);
    }

    /// Whether `signal` was ignored when the program began: as far as `/proc` tells.
    fn is_ignored(signal: c_int) -> bool {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
        mask >> (signal - 1) & 1 == 1
    }
}

/// Exit code after Ctrl-C: as on Unix.
#[cfg(windows)]
const INTERRUPTED: i32 = 130;

/// Begins to watch for Ctrl-C.
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
