//! Sorting by depth: once per picture, so that every tile's list comes out sorted.

use super::project::{Splat, Visible};
use super::tiles::Rect;

/// Bits of a key sorted in one pass; three passes cover 32.
const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Splats and their tiles, nearest first; at equal depth, in order of index.
pub(super) fn by_depth(visible: Vec<Vec<Visible>>) -> (Vec<Splat>, Vec<Rect>) {
    let visible: Vec<Visible> = visible.concat();
    let order = sorted(visible.iter().map(|v| v.depth));
    let splats = order.iter().map(|&i| visible[i as usize].splat).collect();
    let rects = order.iter().map(|&i| visible[i as usize].rect).collect();
    (splats, rects)
}

/// Indices of the same splats' Gaussians, in the same order.
pub(super) fn gaussians_by_depth(visible: &[Vec<Visible>]) -> Vec<u32> {
    let visible: Vec<&Visible> = visible.iter().flatten().collect();
    sorted(visible.iter().map(|v| v.depth)).into_iter().map(|k| visible[k as usize].gaussian).collect()
}

/// Indices of `keys` in ascending order of key, ties in order of index: a stable radix sort.
///
/// There are at most 2^32 keys.
fn sorted(keys: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut pairs: Vec<(u32, u32)> = keys.zip(0..).collect();
    let mut other = vec![(0, 0); pairs.len()];
    for shift in (0..u32::BITS).step_by(DIGIT_BITS as usize) {
        let digit = |key: u32| (key >> shift) as usize % DIGITS;
        let mut starts = vec![0_usize; DIGITS];
        for &(key, _) in &pairs {
            starts[digit(key)] += 1;
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += std::mem::replace(start, sum);
        }
        for &(key, i) in &pairs {
            let at = &mut starts[digit(key)];
            other[*at] = (key, i);
            *at += 1;
        }
        std::mem::swap(&mut pairs, &mut other);
    }
    pairs.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorts_stably() {
        let mut state = 1_u32;
        let keys: Vec<u32> = (0..5000)
            .map(|i| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // Few distinct keys in one half, so that ties happen.
                if i % 2 == 0 { state } else { state >> 28 }
            })
            .collect();
        let mut expected: Vec<u32> = (0..5000).collect();
        expected.sort_by_key(|&i| keys[i as usize]);
        assert_eq!(sorted(keys.iter().copied()), expected);
        assert!(sorted(std::iter::empty()).is_empty());
    }
}
