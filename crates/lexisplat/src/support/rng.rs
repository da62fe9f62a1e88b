//! A small seeded generator that never changes: the same seed gives the same sample on every platform.

use std::collections::HashMap;

/// `SplitMix64` (Steele, Lea, Flood, OOPSLA 2014). It has full period, and any seed is good.
#[derive(Debug, Clone)]
pub(crate) struct SplitMix64(u64);

impl SplitMix64 {
    /// Makes a generator from `seed`.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns the next 64 bits.
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number below `bound`, which must not be 0. Its bias is at most `bound / 2^64`, which does not matter
    /// here.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        let wide = u128::from(self.next()) * bound as u128;
        #[expect(clippy::cast_possible_truncation, reason = "the high half is below `bound`, a usize")]
        let result = (wide >> 64) as usize;
        result
    }

    /// Returns the numbers below `count` in random order, drawn one by one (Fisher and Yates). Memory grows with
    /// the numbers drawn; a `count` of at most [`DENSE`] takes memory for all numbers at once.
    pub(crate) fn shuffled(mut self, count: usize) -> impl Iterator<Item = usize> {
        let mut shuffle = Shuffle::new(count);
        (0..count).map(move |i| shuffle.draw(i, i + self.below(count - i)))
    }
}

/// Longest list that is always stored whole.
const DENSE: usize = 1 << 20;
/// A map with one entry for this many entries of the list takes about as much memory as the whole list.
const SPARSE_SHARE: usize = 16;

/// A list that is shuffled as by Fisher and Yates. At first, entry `i` is the number `i`.
enum Shuffle {
    Whole(Vec<usize>),
    /// The entries that differ from their index, by index; and the length of the list.
    Changed(HashMap<usize, usize>, usize),
}

impl Shuffle {
    fn new(count: usize) -> Self {
        if count <= DENSE { Self::Whole((0..count).collect()) } else { Self::Changed(HashMap::new(), count) }
    }

    /// Swaps entries `i` and `from`, and returns the new entry `i`. Indices must be drawn in ascending order with
    /// `from >= i`, because entry `i` is not kept.
    fn draw(&mut self, i: usize, from: usize) -> usize {
        match self {
            Self::Whole(list) => {
                list.swap(i, from);
                list[i]
            }
            Self::Changed(changed, count) => {
                let first = changed.remove(&i).unwrap_or(i);
                if from == i {
                    return first;
                }
                let drawn = changed.insert(from, first).unwrap_or(from);
                if changed.len() > *count / SPARSE_SHARE {
                    let mut list: Vec<usize> = (0..*count).collect();
                    changed.iter().for_each(|(&index, &number)| list[index] = number);
                    *self = Self::Whole(list);
                }
                drawn
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the first `drawn` numbers of the shuffle with the whole list in memory.
    fn naive(seed: u64, count: usize, drawn: usize) -> Vec<usize> {
        let mut random = SplitMix64::new(seed);
        let mut list: Vec<usize> = (0..count).collect();
        for i in 0..drawn {
            list.swap(i, i + random.below(count - i));
        }
        list.truncate(drawn);
        list
    }

    #[test]
    fn shuffling_does_not_depend_on_how_the_list_is_stored() {
        for count in [0, 1, 2, 1000, DENSE, DENSE + 1] {
            for drawn in [0, count / 1000, count] {
                let found: Vec<usize> = SplitMix64::new(7).shuffled(count).take(drawn).collect();
                assert!(found == naive(7, count, drawn), "{drawn} of {count}");
            }
        }
    }
}
