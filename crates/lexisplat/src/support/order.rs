//! The sorting of lists that are sorted once for each file.

use std::cmp::Ordering;

/// Returns the numbers below `n`, sorted by `compare`. Numbers that compare equal stay in order.
///
/// The function merges runs. It is not generic, and its code is much smaller than the sorts of the standard library, which
/// are compiled anew for every type. In WebAssembly, this size matters more than the time that sorting takes here.
pub(crate) fn order(n: usize, compare: &mut dyn FnMut(usize, usize) -> Ordering) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    let mut merged = Vec::with_capacity(n);
    let mut run = 1;
    while run < n {
        for pair in order.chunks(2 * run) {
            let (mut first, mut second) = pair.split_at(run.min(pair.len()));
            while let (Some((&a, others)), Some((&b, rest))) = (first.split_first(), second.split_first()) {
                if compare(b, a).is_lt() {
                    merged.push(b);
                    second = rest;
                } else {
                    merged.push(a);
                    first = others;
                }
            }
            merged.extend_from_slice(first);
            merged.extend_from_slice(second);
        }
        std::mem::swap(&mut order, &mut merged);
        merged.clear();
        run *= 2;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    #[test]
    fn orders_are_those_of_a_stable_sort() {
        let mut rng = SplitMix64::new(8);
        for n in (0..40_usize).chain([1000]) {
            let keys: Vec<usize> = (0..n).map(|_| rng.below(n.div_ceil(2))).collect();
            let mut sorted: Vec<usize> = (0..n).collect();
            sorted.sort_by_key(|&k| keys[k]);
            assert_eq!(order(n, &mut |a, b| keys[a].cmp(&keys[b])), sorted);
        }
    }
}
