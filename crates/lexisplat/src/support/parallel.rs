//! Loops over chunks whose results do not depend on the number of threads.
//!
//! Chunk borders are fixed by the caller, results come back in order, and no reduction happens across
//! chunks in here. Without the `parallel` feature the same loops run on the calling thread.

use std::ops::Range;

/// Gaussians in one unit of work: large enough to hide the hand-over, small enough to balance.
pub(crate) const CHUNK: usize = 2048;

/// `f` over consecutive ranges of at most `chunk` that cover `0..len`; results in order.
pub(crate) fn map_chunks<T: Send>(len: usize, chunk: usize, f: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let range = |c: usize| c * chunk..((c + 1) * chunk).min(len);
    let count = len.div_ceil(chunk);
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        (0..count).into_par_iter().map(|c| f(range(c))).collect()
    }
    #[cfg(not(feature = "parallel"))]
    {
        (0..count).map(|c| f(range(c))).collect()
    }
}

/// `f(chunk number, chunk)` over consecutive pieces of `values`.
pub(crate) fn for_each_chunk_mut<T: Send>(
    values: &mut [T],
    chunk: usize,
    f: impl Fn(usize, &mut [T]) + Sync,
) {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        values.par_chunks_mut(chunk).enumerate().for_each(|(c, piece)| f(c, piece));
    }
    #[cfg(not(feature = "parallel"))]
    {
        values.chunks_mut(chunk).enumerate().for_each(|(c, piece)| f(c, piece));
    }
}

/// `f` over `items`, which are consumed; results in order.
pub(crate) fn map_vec<T: Send, R: Send>(items: Vec<T>, f: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.into_par_iter().map(f).collect()
    }
    #[cfg(not(feature = "parallel"))]
    {
        items.into_iter().map(f).collect()
    }
}
