//! The codes of compressed.ply: values of 32 bits, relative to the bounds of a chunk (splat-transform,
//! `compressed-chunk.ts` and `decompress-ply.ts`).

use crate::settle::settled;

/// Smallest and largest value of a chunk, along each axis or of each colour channel.
pub(super) type Bounds = [[f32; 3]; 2];

/// Number of bits of each of three values in 32 bits. The first value has the highest bits.
const BITS: [u32; 3] = [11, 10, 11];
/// Number of bits of a component of a rotation.
const TURN_BITS: u32 = 10;
/// Half of the range of these components, divided by the square root of 2. The range is from -1 / sqrt 2 to 1 / sqrt 2.
const TURN_HALF: f64 = 0.5;

/// Returns the largest number of `bits` bits.
fn most(bits: u32) -> f64 {
    f64::from((1_u32 << bits) - 1)
}

/// Returns `share`, from 0 to 1, as a number of `bits` bits.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited")]
pub(super) fn to_bits(share: f64, bits: u32) -> u32 {
    (share * most(bits) + 0.5).floor().clamp(0.0, most(bits)) as u32
}

/// Returns the value at `share` between `low` and `high`.
#[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
fn between(low: f32, high: f32, share: f64) -> f32 {
    (f64::from(low) * (1.0 - share) + f64::from(high) * share) as f32
}

/// Returns the code of `value` between `low` and `high`, in `bits` bits. The decoded value has the same code again.
pub(super) fn to_code(value: f32, low: f32, high: f32, bits: u32) -> u32 {
    let once = |value: f32| {
        let range = f64::from(high) - f64::from(low);
        if range > 0.0 { to_bits((f64::from(value) - f64::from(low)) / range, bits) } else { 0 }
    };
    settled(once(value), |code| once(of_code(code, low, high, bits)))
}

/// Returns the value of a code of `bits` bits, between `low` and `high`.
pub(super) fn of_code(code: u32, low: f32, high: f32, bits: u32) -> f32 {
    between(low, high, f64::from(code) / most(bits))
}

/// Returns the three values of a code of 32 bits.
pub(super) fn three(code: u32, [low, high]: &Bounds) -> [f32; 3] {
    let codes = [code >> 21, code >> 11 & 0x3ff, code & 0x7ff];
    [0, 1, 2].map(|k| of_code(codes[k], low[k], high[k], BITS[k]))
}

/// Returns the code of three values, in 32 bits.
pub(super) fn to_three(values: [f32; 3], [low, high]: &Bounds) -> u32 {
    let [a, b, c] = [0, 1, 2].map(|k| to_code(values[k], low[k], high[k], BITS[k]));
    a << 21 | b << 11 | c
}

/// Returns the rotation (w, x, y, z) of a code. The code has 2 bits for the index of the largest component in this order,
/// and 10 bits for each of the others.
#[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
pub(super) fn rotation(code: u32) -> [f32; 4] {
    let largest = (code >> 30) as usize;
    let mut components = [0.0_f64; 4];
    let (mut left, mut squares) = (code, 0.0);
    for k in (0..4).rev().filter(|k| *k != largest) {
        let share = f64::from(left & ((1 << TURN_BITS) - 1)) / most(TURN_BITS);
        components[k] = (share - TURN_HALF) * std::f64::consts::SQRT_2;
        squares += components[k] * components[k];
        left >>= TURN_BITS;
    }
    components[largest] = (1.0 - squares).max(0.0).sqrt();
    components.map(|v| v as f32)
}

/// Returns the code of a rotation (w, x, y, z). The decoded rotation has the same code again.
pub(super) fn to_rotation(turn: [f32; 4]) -> u32 {
    settled(once(turn), |code| once(rotation(code)))
}

fn once(turn: [f32; 4]) -> u32 {
    let wide = turn.map(f64::from);
    let length = wide.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut components = if length > 0.0 { wide.map(|v| v / length) } else { [1.0, 0.0, 0.0, 0.0] };
    let mut largest = 0;
    for k in 1..4 {
        if components[k].abs() > components[largest].abs() {
            largest = k;
        }
    }
    if components[largest] < 0.0 {
        components = components.map(|v| -v);
    }
    let mut code = u32::try_from(largest).unwrap_or(0);
    for k in (0..4).filter(|k| *k != largest) {
        let share = components[k] * std::f64::consts::FRAC_1_SQRT_2 + TURN_HALF;
        code = code << TURN_BITS | to_bits(share, TURN_BITS);
    }
    code
}

#[cfg(test)]
mod tests {
    use lexisplat_testing::Random;

    use super::*;

    #[test]
    fn codes_come_back() {
        let mut random = Random::new(5);
        for k in 0..40_000 {
            let low: [f32; 3] = std::array::from_fn(|_| random.within(-1000.0, 1000.0));
            let size = 10.0_f32.powi(k % 9 - 6);
            let high = low.map(|v| v + size * random.unit());
            let bounds = [low, high];
            let value = [0, 1, 2].map(|k| random.within(low[k], high[k].max(low[k])));
            let code = to_three(value, &bounds);
            assert_eq!(to_three(three(code, &bounds), &bounds), code, "{value:?} {bounds:?}");
            // The ends are exact.
            assert_eq!((three(0, &bounds), three(u32::MAX, &bounds)), (low, high));
            let turn = std::array::from_fn(|_| random.signed());
            let code = to_rotation(turn);
            let read = rotation(code);
            assert_eq!(to_rotation(read), code, "{turn:?}");
            let dot = |a: [f32; 4], b: [f32; 4]| -> f32 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
            let cosine = dot(turn, read) / (dot(turn, turn) * dot(read, read)).sqrt();
            assert!(cosine.abs() > 1.0 - 4e-6, "{turn:?} {read:?}");
        }
    }

    #[test]
    fn equal_components_settle() {
        let levels = [0.0, 0.5, -0.5, 0.7069, 0.7075, -0.499, 0.501, 1.0];
        for k in 0..4096_usize {
            let code = to_rotation(std::array::from_fn(|j| levels[k >> (3 * j) & 7]));
            assert_eq!(to_rotation(rotation(code)), code, "{k}");
        }
    }
}
