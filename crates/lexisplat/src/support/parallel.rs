//! Loops over chunks whose results do not depend on the number of threads.
//!
//! The caller fixes the chunk borders, results come back in order, and nothing is summed across chunks. Without
//! the `parallel` feature the same loops run on the calling thread. The [`Simd`](crate::simd::Simd) of the calling
//! thread holds on all threads of a loop.

use std::ops::Range;

/// Number of Gaussians that one task handles: enough to hide the cost of a task, few enough to balance the threads.
pub(crate) const GAUSSIANS_PER_TASK: usize = 2048;
/// Number of Gaussians that are read or coded at once. It bounds the values that are in memory twice.
pub(crate) const AT_ONCE: usize = 32 * GAUSSIANS_PER_TASK;

/// Calls `f` with consecutive ranges of at most `chunk` numbers that cover `0..len`, and returns the results in order.
pub(crate) fn map_chunks<T: Send>(len: usize, chunk: usize, f: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    map_vec((0..len).step_by(chunk).collect(), |start| f(start..len.min(start.saturating_add(chunk))))
}

/// Calls `f(chunk number, chunk)` for consecutive chunks of at most `chunk` of `values`.
pub(crate) fn for_each_chunk_mut<T: Send>(
    values: &mut [T],
    chunk: usize,
    f: impl Fn(usize, &mut [T]) + Sync,
) {
    map_vec(values.chunks_mut(chunk).enumerate().collect(), |(c, piece)| f(c, piece));
}

/// Calls `f` with each of `items`, and returns the results in order.
pub(crate) fn map_vec<T: Send, R: Send>(items: Vec<T>, f: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        let simd = crate::simd::Simd::current();
        items.into_par_iter().map(|item| simd.scope(|| f(item))).collect()
    }
    #[cfg(not(feature = "parallel"))]
    {
        items.into_iter().map(f).collect()
    }
}
