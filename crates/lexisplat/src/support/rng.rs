//! A small seeded generator, so that the same seed gives the same sample on every platform for ever.

use std::collections::HashMap;

/// `SplitMix64` (Steele, Lea, Flood, OOPSLA 2014): full period, any seed is good.
#[derive(Debug, Clone)]
pub(crate) struct SplitMix64(u64);

impl SplitMix64 {
    /// A generator for `seed`.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `bound`, which must not be 0. The bias of at most `bound / 2^64` is of no matter here.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        let wide = u128::from(self.next()) * bound as u128;
        #[expect(clippy::cast_possible_truncation, reason = "the high half is below `bound`, a usize")]
        let result = (wide >> 64) as usize;
        result
    }

    /// The numbers below `count` in random order, drawn one by one (Fisher and Yates). Takes memory for the
    /// numbers drawn, or for a small `count` for all.
    pub(crate) fn shuffled(mut self, count: usize) -> impl Iterator<Item = usize> {
        let mut places = Places::new(count);
        (0..count).map(move |i| places.take(i, i + self.below(count - i)))
    }
}

/// Of more numbers than this only those are kept that are not in their own place.
const DENSE: usize = 1 << 20;
/// So many numbers out of place, as a share of all, take as much memory as all in a list.
const SPARSE_SHARE: usize = 16;

/// The list that Fisher and Yates shuffle.
enum Places {
    All(Vec<usize>),
    /// Numbers that are not in their own place, by place; of `usize` places in all.
    Moved(HashMap<usize, usize>, usize),
}

impl Places {
    fn new(count: usize) -> Self {
        if count <= DENSE { Self::All((0..count).collect()) } else { Self::Moved(HashMap::new(), count) }
    }

    /// Takes the number at `from`, and puts that at `i` there, which is not above it and not asked for again.
    fn take(&mut self, i: usize, from: usize) -> usize {
        match self {
            Self::All(list) => {
                list.swap(i, from);
                list[i]
            }
            Self::Moved(moved, count) => {
                let last = moved.remove(&i).unwrap_or(i);
                if from == i {
                    return last;
                }
                let taken = moved.insert(from, last).unwrap_or(from);
                if moved.len() > *count / SPARSE_SHARE {
                    let mut list: Vec<usize> = (0..*count).collect();
                    moved.iter().for_each(|(&place, &number)| list[place] = number);
                    *self = Self::All(list);
                }
                taken
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The shuffle with the whole list in memory.
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
    fn shuffling_does_not_depend_on_how_the_list_is_kept() {
        for count in [0, 1, 2, 1000, DENSE, DENSE + 1] {
            for drawn in [0, count / 1000, count] {
                let found: Vec<usize> = SplitMix64::new(7).shuffled(count).take(drawn).collect();
                assert!(found == naive(7, count, drawn), "{drawn} of {count}");
            }
        }
    }
}
