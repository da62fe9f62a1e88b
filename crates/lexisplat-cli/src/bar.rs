//! The bar of the command on a terminal.

use std::sync::{Mutex, MutexGuard, PoisonError};

use indicatif::ProgressBar;

/// The bar of the command. It must never be locked while the work in [`crate::progress`] is locked, because the thread that
/// draws the bar locks them in the other order.
static BAR: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Locks `mutex`. After a panic of a thread that held the lock, at worst a wrong line is on the screen.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes `bar` the bar of the command.
pub(crate) fn set(bar: ProgressBar) {
    *lock(&BAR) = Some(bar);
}

/// Removes the bar from the screen for good.
pub(crate) fn clear() {
    if let Some(bar) = lock(&BAR).take() {
        bar.finish_and_clear();
    }
}

/// Calls `print` while the bar is off the screen.
pub(crate) fn without_bar<T>(print: impl FnOnce() -> T) -> T {
    let bar = lock(&BAR).clone();
    match bar {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}
