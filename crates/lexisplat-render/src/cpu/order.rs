//! Sorts splats by depth. That happens once for each picture, so that every tile's list comes out sorted.

use super::project::{Projected, Visible};

/// Bits of a key sorted in one pass; three passes cover 32.
const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Returns the splats with the nearest first; those of equal depth are in order of index.
pub(super) fn by_depth(visible: Projected) -> Vec<Visible> {
    let mut splats = visible.into_splats();
    let mut order = sorted(splats.iter().map(|v| v.depth).zip(0..).collect());
    // The splats are moved in place, cycle by cycle, since a copy of millions of them would take memory. A place
    // that is done holds its own number.
    for start in 0..order.len() {
        let mut place = start;
        loop {
            let from = order[place] as usize;
            order[place] = u32::try_from(place).unwrap_or(u32::MAX);
            if from == start {
                break;
            }
            splats.swap(place, from);
            place = from;
        }
    }
    splats
}

/// Returns the second of each (key, index) in ascending order of key. A stable radix sort: ties stay in order.
fn sorted(mut pairs: Vec<(u32, u32)>) -> Vec<u32> {
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
        assert_eq!(sorted(keys.iter().copied().zip(0..).collect()), expected);
        assert!(sorted(Vec::new()).is_empty());
    }
}
