//! The state of a lane of rANS: 32 bits, which words of 16 bits leave and enter.

/// Least state between symbols. An encoder starts each lane with it, and a decoder ends with it.
pub(in crate::packed) const LEAST: u32 = 1 << 16;
/// Largest number of raw bits that pass through a state at once.
pub(in crate::packed) const MOST_BITS: u32 = 16;

/// The interval of a state's low bits that stands for a symbol.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::packed) struct Interval {
    pub(in crate::packed) start: u32,
    pub(in crate::packed) share: u32,
}

/// The state of a lane, and the words that left it. The coder is a stack: the last symbol that is encoded is the first to be
/// decoded.
#[derive(Debug)]
pub(in crate::packed) struct Stack {
    state: u32,
    words: Vec<u16>,
}

impl Stack {
    pub(in crate::packed) fn new() -> Self {
        Self { state: LEAST, words: Vec::new() }
    }

    /// Moves a word out of the state if it is not below `limit`.
    fn make_room(&mut self, limit: u64) {
        if u64::from(self.state) >= limit {
            self.words.push((self.state & 0xffff) as u16);
            self.state >>= 16;
        }
    }

    /// Encodes a symbol whose probability has `precision` bits.
    pub(in crate::packed) fn symbol(&mut self, Interval { start, share }: Interval, precision: u32) {
        self.make_room(u64::from(share) << (u32::BITS - precision));
        self.state = ((self.state / share) << precision) + start + self.state % share;
    }

    /// Encodes `count` raw bits.
    pub(in crate::packed) fn raw(&mut self, count: u32, bits: u32) {
        self.make_room(1 << (u32::BITS - count));
        self.state = self.state << count | bits;
    }

    /// Returns the words in the order in which they are read. The first two are the state.
    pub(in crate::packed) fn finish(mut self) -> Vec<u16> {
        self.words.push((self.state & 0xffff) as u16);
        self.words.push((self.state >> 16) as u16);
        self.words.reverse();
        self.words
    }
}
