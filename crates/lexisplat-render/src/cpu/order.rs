//! Sorts splats by depth, once for each picture, so that the list of every tile is sorted too.

use std::ops::Range;

use crate::parallel::*;

use super::splat::PixelRect;
use super::visible::Visible;

/// Number of passes of the sort. Each pass sorts by one digit.
const PASSES: u32 = 3;
/// Largest number of values of a digit: three digits cover 32 bits.
const MAX_DIGITS: usize = 1 << u32::BITS.div_ceil(PASSES);
/// Number of splats whose pixels one task collects.
const RECTS_PER_TASK: usize = 1 << 14;

/// Splats in the order of depth, the nearest first. Splats of equal depth are in the order of index.
#[derive(Debug, Default)]
pub(super) struct Order {
    /// (depth, slot) of each splat.
    pub(super) keys: Vec<(u32, u32)>,
    /// Second buffer of the sort; afterwards the pixels that each splat may touch.
    spare: Vec<(u32, u32)>,
}

impl Order {
    /// Sorts `keys`, which are those of the splats of `visible`.
    pub(super) fn sort(&mut self, visible: &Visible) {
        sort(&mut self.keys, &mut self.spare);
        let tasks = self.spare.par_chunks_mut(RECTS_PER_TASK).zip(self.keys.par_chunks(RECTS_PER_TASK));
        tasks.for_each(|(rects, keys)| {
            for (rect, &(_, slot)) in rects.iter_mut().zip(keys) {
                *rect = visible.rect(slot).to_words();
            }
        });
    }

    /// Returns the slots of the splats at ranks `range.start` to before `range.end`, and the pixels that they may touch.
    pub(super) fn splats(&self, range: Range<usize>) -> impl Iterator<Item = (u32, PixelRect)> {
        let slots = self.keys[range.clone()].iter().map(|key| key.1);
        slots.zip(self.spare[range].iter().map(|words| PixelRect::from_words(*words)))
    }
}

/// Sorts (key, index) pairs in ascending order of key by a stable radix sort: pairs of equal keys keep their order.
fn sort(pairs: &mut Vec<(u32, u32)>, spare: &mut Vec<(u32, u32)>) {
    let (least, most) = pairs.iter().fold((u32::MAX, 0), |(a, b), &(key, _)| (a.min(key), b.max(key)));
    // The depths of a scene differ in few of their high bits. With the smallest possible digits the memory that is
    // written to stays in the cache.
    let digit_bits = (u32::BITS - most.saturating_sub(least).leading_zeros()).div_ceil(PASSES).max(1);
    let digits = 1 << digit_bits;
    let digit = |pass: u32, key: u32| ((key - least) >> (pass * digit_bits)) as usize % digits;
    let mut starts = vec![[0_u32; MAX_DIGITS]; PASSES as usize];
    for &(key, _) in pairs.iter() {
        for (pass, starts) in (0..).zip(&mut starts) {
            starts[digit(pass, key)] += 1;
        }
    }
    spare.reserve_exact(pairs.capacity().saturating_sub(spare.len()));
    spare.resize(pairs.len(), (0, 0));
    for (pass, starts) in (0..).zip(&mut starts) {
        let mut sum = 0;
        for start in starts.iter_mut().take(digits) {
            sum += std::mem::replace(start, sum);
        }
        for &pair in pairs.iter() {
            let at = &mut starts[digit(pass, pair.0)];
            spare[*at as usize] = pair;
            *at += 1;
        }
        std::mem::swap(pairs, spare);
    }
}

#[cfg(test)]
impl Order {
    /// Returns an order of `slots` as they are, which may touch the pixels `rects`.
    pub(super) fn of(slots: Vec<u32>, rects: &[PixelRect]) -> Self {
        let keys = slots.into_iter().map(|slot| (0, slot)).collect();
        Self { keys, spare: rects.iter().map(|rect| rect.to_words()).collect() }
    }
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
        // All bits differ; only the lowest; only some in between; none.
        for mask in [u32::MAX, 0x7f, 0x1_ff00, 0] {
            let mut pairs: Vec<(u32, u32)> = keys.iter().map(|key| key & mask | !mask).zip(0..).collect();
            let mut expected = pairs.clone();
            expected.sort_by_key(|pair| pair.0);
            sort(&mut pairs, &mut Vec::new());
            assert_eq!(pairs, expected);
        }
        sort(&mut Vec::new(), &mut Vec::new());
    }
}
