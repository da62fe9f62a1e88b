//! Waits for the GPU: callbacks as futures, and the loop by which a thread blocks on a future.

#[cfg(not(target_family = "wasm"))]
use crate::error::Result;

/// Returns a callback, and a future that gives the value with which the callback was called.
#[cfg(feature = "gpu")]
pub(crate) fn answer<T: Send + 'static>() -> (impl FnOnce(T) + Send + 'static, impl Future<Output = T>) {
    use std::sync::{Arc, Mutex, PoisonError};
    use std::task::{Poll, Waker};

    let given = Arc::new(Mutex::new((None, None::<Waker>)));
    let slot = Arc::clone(&given);
    let give = move |value| {
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        slot.0 = Some(value);
        if let Some(waker) = slot.1.take() {
            waker.wake();
        }
    };
    let wait = std::future::poll_fn(move |context| {
        let mut given = given.lock().unwrap_or_else(PoisonError::into_inner);
        match given.0.take() {
            Some(value) => Poll::Ready(value),
            None => {
                given.1 = Some(context.waker().clone());
                Poll::Pending
            }
        }
    });
    (give, wait)
}

/// Runs `future` to its end on this thread, and calls `poll` whenever the future is not ready. `poll` waits
/// until the GPU has done all its work and called its callbacks.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn block_on<T>(
    mut poll: impl FnMut() -> Result<()>,
    future: impl Future<Output = Result<T>>,
) -> Result<T> {
    let mut future = std::pin::pin!(future);
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    loop {
        if let std::task::Poll::Ready(result) = future.as_mut().poll(&mut context) {
            return result;
        }
        poll()?;
    }
}
