//! A small seeded generator, so that the same seed gives the same sample on every platform for ever.

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

    /// The numbers below `count` in random order, drawn one by one (Fisher and Yates).
    pub(crate) fn shuffled(mut self, count: usize) -> impl Iterator<Item = usize> {
        let mut order: Vec<usize> = (0..count).collect();
        (0..count).map(move |i| {
            order.swap(i, i + self.below(count - i));
            order[i]
        })
    }
}
