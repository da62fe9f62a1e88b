//! Sorts splats by depth. That happens once for each picture, so that every tile's list comes out sorted.

use super::splat::PixelRect;
use super::visible::Visible;

/// Bits of a key sorted in one pass; three passes cover 32.
const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;
const PASSES: usize = u32::BITS.div_ceil(DIGIT_BITS) as usize;

/// Splats in the order of depth, the nearest first; those of equal depth are in order of index.
#[derive(Debug, Default)]
pub(super) struct Order {
    /// (depth, slot) of each.
    pub(super) splats: Vec<(u32, u32)>,
    /// The pixels that each may touch, side by side, since the lists of tiles read nothing else.
    pub(super) rects: Vec<PixelRect>,
    spare: Vec<(u32, u32)>,
}

impl Order {
    /// Sorts `visible`, in place of the splats of the picture before.
    pub(super) fn sort(&mut self, visible: &Visible) {
        self.splats.clear();
        // Gaussians are counted in u32.
        let slot = |slot: usize| u32::try_from(slot).unwrap_or(u32::MAX);
        self.splats.extend(visible.occupied().map(|k| (visible.slots[k].depth, slot(k))));
        sort(&mut self.splats, &mut self.spare);
        self.rects.clear();
        self.rects.extend(self.splats.iter().map(|&(_, slot)| visible.slots[slot as usize].pixels));
    }
}

/// Sorts (key, index) in ascending order of key. A stable radix sort: ties stay in order.
fn sort(pairs: &mut Vec<(u32, u32)>, spare: &mut Vec<(u32, u32)>) {
    let digit = |pass: usize, key: u32| (key >> (pass as u32 * DIGIT_BITS)) as usize % DIGITS;
    let mut starts = vec![[0_usize; DIGITS]; PASSES];
    for &(key, _) in pairs.iter() {
        for (pass, starts) in starts.iter_mut().enumerate() {
            starts[digit(pass, key)] += 1;
        }
    }
    spare.resize(pairs.len(), (0, 0));
    for (pass, starts) in starts.iter_mut().enumerate() {
        if starts.contains(&pairs.len()) {
            continue;
        }
        let mut sum = 0;
        for start in starts.iter_mut() {
            sum += std::mem::replace(start, sum);
        }
        for &pair in pairs.iter() {
            let at = &mut starts[digit(pass, pair.0)];
            spare[*at] = pair;
            *at += 1;
        }
        std::mem::swap(pairs, spare);
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
        // All digits differ; only the lowest do.
        for mask in [u32::MAX, 0x7ff] {
            let mut pairs: Vec<(u32, u32)> = keys.iter().map(|key| key & mask).zip(0..).collect();
            let mut expected = pairs.clone();
            expected.sort_by_key(|pair| pair.0);
            sort(&mut pairs, &mut Vec::new());
            assert_eq!(pairs, expected);
        }
        sort(&mut Vec::new(), &mut Vec::new());
    }
}
