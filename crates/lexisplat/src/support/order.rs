//! The order of things.

use std::cmp::Ordering;

/// The numbers below `n`, sorted by `compare`. Those that compare equal stay in order.
///
/// It is not generic: what is sorted once a file shares this code, which matters in WebAssembly.
pub(crate) fn order(n: usize, compare: &mut dyn FnMut(usize, usize) -> Ordering) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_unstable_by(|&a, &b| compare(a, b).then(a.cmp(&b)));
    order
}
