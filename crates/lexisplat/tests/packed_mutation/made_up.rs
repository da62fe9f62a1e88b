//! Tables and a dictionary that take few bytes and stand for as much as they can.

/// Sets of contexts, and contexts of each.
const SETS: usize = 61;
const CONTEXTS: usize = 24;
/// Sets of the streams of geometry: as many as levels may be missing, and streams of each.
const GEOMETRY: usize = 3 * STREAMS;
const STREAMS: usize = 16;
/// Most symbols of a table, and bits of that number.
const SYMBOLS: u32 = 256;
const COUNT_BITS: usize = 9;
/// Bits of the first level of a table of one level an octave.
const FIRST_BITS: u32 = 4;
/// Degrees of coefficients, and colours, that have odds of their own.
const DEGREES: usize = 4;
const COLOURS: usize = 3;

/// The chance of a bit to be 0, in 4096ths, and how many bits it has seen.
#[derive(Clone, Copy)]
struct Odds(u32, usize);

impl Default for Odds {
    fn default() -> Self {
        Self(2048, 0)
    }
}

/// Writes bits with odds.
struct Writer {
    bytes: Vec<u8>,
    low: u64,
    range: u64,
}

impl Writer {
    fn new() -> Self {
        Self { bytes: Vec::new(), low: 0, range: (1 << 32) - 1 }
    }

    fn add(&mut self, more: u64) {
        self.low += more;
        if self.low >> 32 == 1 {
            self.low &= (1 << 32) - 1;
            let last = self.bytes.iter().rposition(|&byte| byte < 0xff).unwrap();
            self.bytes[last] += 1;
            self.bytes[last + 1..].fill(0);
        }
    }

    fn shift(&mut self) {
        self.bytes.push(self.low.to_le_bytes()[3]);
        self.low = self.low << 8 & ((1 << 32) - 1);
    }

    fn split(&mut self, zero: u32, bit: bool) {
        let bound = (self.range >> 12) * u64::from(zero);
        if bit {
            self.add(bound);
            self.range -= bound;
        } else {
            self.range = bound;
        }
        while self.range < 1 << 24 {
            self.range <<= 8;
            self.shift();
        }
    }

    fn bit(&mut self, odds: &mut Odds, bit: bool) {
        self.split(odds.0, bit);
        let rate = [1, 2, 3, 4, 4, 5][odds.1.min(5)];
        odds.1 += 1;
        let zero = if bit { odds.0 - (odds.0 >> rate) } else { odds.0 + ((4096 - odds.0) >> rate) };
        odds.0 = zero.clamp(48, 4048);
    }

    fn zeros(&mut self, count: u32) {
        (0..count).for_each(|_| self.split(2048, false));
    }

    fn finish(mut self) -> Vec<u8> {
        let end = |zeros: u32| (self.low + (1 << zeros) - 1) >> zeros << zeros;
        let best = (0..32).rev().map(end).find(|&end| end < self.low + self.range).unwrap();
        self.add(best - self.low);
        (0..4).for_each(|_| self.shift());
        while self.bytes.last() == Some(&0) {
            self.bytes.pop();
        }
        self.bytes
    }
}

/// The kind of the streams of a set.
fn kind(set: usize) -> usize {
    let stream = if set < GEOMETRY { set % STREAMS } else { set - GEOMETRY + STREAMS };
    match stream {
        0 => 3,
        1 | 19..=21 | 25 => 0,
        16..=18 | 22..=24 => 1,
        _ => 2,
    }
}

/// A table for every context of every set, each of the most symbols, of which the last alone occurs.
pub(crate) fn all_tables() -> Vec<u8> {
    let mut out = Writer::new();
    let (mut used, mut same) = ([Odds::default(); 2], [Odds::default(); 2]);
    let (mut many, mut new, mut grain) = (Odds::default(), Odds::default(), [Odds::default(); 2]);
    let mut counts = [[Odds::default(); COUNT_BITS]; 4];
    let mut present = [[Odds::default(); 2]; 4];
    let mut nonzero = [Odds::default(); 4];
    for set in 0..SETS {
        out.bit(&mut used[usize::from(set > 0)], true);
        out.bit(&mut many, true);
        for context in 1..CONTEXTS {
            out.bit(&mut same[usize::from(context > 1)], true);
            out.bit(&mut new, true);
        }
        let kind = kind(set);
        for _ in 0..CONTEXTS {
            for (length, odds) in (1..=COUNT_BITS).zip(&mut counts[kind]) {
                out.bit(odds, length < COUNT_BITS);
            }
            out.zeros(SYMBOLS.trailing_zeros());
            grain.iter_mut().for_each(|odds| out.bit(odds, false));
            for symbol in 0..SYMBOLS {
                let is_first = symbol == 0;
                if symbol + 1 < SYMBOLS {
                    out.bit(&mut present[kind][usize::from(is_first)], false);
                } else {
                    out.bit(&mut nonzero[kind], false);
                }
                out.zeros(if is_first { FIRST_BITS } else { 0 });
            }
        }
    }
    out.finish()
}

/// Learned atoms of degree 4, all of zeros.
pub(crate) fn atoms(count: usize) -> Vec<u8> {
    let mut out = Writer::new();
    let mut odds = [[Odds::default(); COLOURS]; DEGREES];
    for k in (0..count).flat_map(|_| 0..24_usize) {
        odds[((k + 1).isqrt() - 1).min(DEGREES - 1)].iter_mut().for_each(|odds| out.bit(odds, false));
    }
    out.finish()
}
