//! Tables and a dictionary that take few bytes and stand for as much as they can.

/// Sets of contexts, and contexts of each.
const SETS: usize = 61;
const CONTEXTS: usize = 24;
/// Most symbols of a table, and bits of that number.
const SYMBOLS: u32 = 256;
const COUNT_BITS: usize = 9;
/// Bits of the first level of a table.
const FIRST_BITS: u32 = 5;
/// Degrees of coefficients, and colours, that have a bit model of their own.
const DEGREES: usize = 4;
const COLOURS: usize = 3;

/// The chance of a bit to be 0, in 4096ths, and how many bits it has seen.
#[derive(Clone, Copy)]
struct BitModel(u32, usize);

impl Default for BitModel {
    fn default() -> Self {
        Self(2048, 0)
    }
}

/// Writes adaptive bits: two words of state, and the words that the states before put down.
struct Writer {
    /// The chance of 0 and the bit, first to last.
    steps: Vec<(u32, bool)>,
}

impl Writer {
    fn new() -> Self {
        Self { steps: Vec::new() }
    }

    fn bit(&mut self, model: &mut BitModel, bit: bool) {
        self.steps.push((model.0, bit));
        let rate = [1, 2, 3, 4, 4, 5][model.1.min(5)];
        model.1 += 1;
        let zero = if bit { model.0 - (model.0 >> rate) } else { model.0 + ((4096 - model.0) >> rate) };
        model.0 = zero.clamp(48, 4048);
    }

    fn zeros(&mut self, count: u32) {
        (0..count).for_each(|_| self.steps.push((2048, false)));
    }

    fn finish(self) -> Vec<u8> {
        let (mut state, mut words) = (1_u64 << 16, Vec::new());
        for (zero, bit) in self.steps.into_iter().rev() {
            let (start, share) = if bit { (zero, 4096 - zero) } else { (0, zero) };
            if state >= u64::from(share) << 20 {
                words.push(state % (1 << 16));
                state >>= 16;
            }
            let share = u64::from(share);
            state = state / share * 4096 + u64::from(start) + state % share;
        }
        words.extend([state % (1 << 16), state >> 16]);
        words.iter().rev().flat_map(|word| u16::try_from(*word).unwrap().to_le_bytes()).collect()
    }
}

/// A table for every context of every set, each of the most symbols, of which the last alone occurs.
pub(crate) fn all_tables() -> Vec<u8> {
    let mut out = Writer::new();
    let (mut used, mut same) = ([BitModel::default(); 2], [BitModel::default(); 2]);
    let (mut many, mut new, mut nonzero) = (BitModel::default(), BitModel::default(), BitModel::default());
    let mut counts = [BitModel::default(); COUNT_BITS];
    let mut present = [BitModel::default(); 2];
    for set in 0..SETS {
        out.bit(&mut used[usize::from(set > 0)], true);
        out.bit(&mut many, true);
        for context in 1..CONTEXTS {
            out.bit(&mut same[usize::from(context > 1)], true);
            out.bit(&mut new, true);
        }
        for _ in 0..CONTEXTS {
            for (length, model) in (1..=COUNT_BITS).zip(&mut counts) {
                out.bit(model, length < COUNT_BITS);
            }
            out.zeros(SYMBOLS.trailing_zeros());
            for symbol in 0..SYMBOLS {
                let is_first = symbol == 0;
                if symbol + 1 < SYMBOLS {
                    out.bit(&mut present[usize::from(is_first)], false);
                } else {
                    out.bit(&mut nonzero, false);
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
    let mut models = [[BitModel::default(); COLOURS]; DEGREES];
    for k in (0..count).flat_map(|_| 0..24_usize) {
        models[((k + 1).isqrt() - 1).min(DEGREES - 1)].iter_mut().for_each(|model| out.bit(model, false));
    }
    out.finish()
}
