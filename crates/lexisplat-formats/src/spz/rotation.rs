//! Rotations in 32 and in 24 bits.
//!
//! Rounding may change which component is the largest. The encoders therefore encode the decoded rotation again until the
//! code does not change. A rotation that is read and written again then has the same bits.

use crate::settle::settled;

/// Number of bits of a component's magnitude.
const BITS: u32 = 9;
const MASK: u32 = (1 << BITS) - 1;
/// Largest magnitude of a component that is not the largest.
const LARGEST: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Half of the range of 8 bits, for components from -1 to 1.
const HALF: f32 = 127.5;

#[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
/// Returns a rotation (w, x, y, z) scaled to length 1, as (x, y, z, w). A rotation of length 0 becomes no rotation.
fn unit([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    let wide = [x, y, z, w].map(f64::from);
    let length = wide.iter().map(|v| v * v).sum::<f64>().sqrt();
    if length > 0.0 { wide.map(|v| (v / length) as f32) } else { [0.0, 0.0, 0.0, 1.0] }
}

/// Returns the rotation (w, x, y, z) of 32 bits: 2 bits for the index of the largest component among (x, y, z, w), then
/// sign and magnitude of the others (`packQuaternionSmallestThree`).
pub(super) fn smallest_three(code: u32) -> [f32; 4] {
    let largest = (code >> (3 * (BITS + 1))) as usize;
    let mut components = [0.0; 4];
    let (mut left, mut squares) = (code, 0.0);
    for k in (0..4).rev().filter(|k| *k != largest) {
        let size = LARGEST * (left & MASK) as f32 / MASK as f32;
        components[k] = if left >> BITS & 1 == 1 { -size } else { size };
        squares += size * size;
        left >>= BITS + 1;
    }
    components[largest] = (1.0_f32 - squares).max(0.0).sqrt();
    let [x, y, z, w] = components;
    [w, x, y, z]
}

/// Returns the nearest code of a rotation (w, x, y, z). The decoded rotation has the same code again.
pub(super) fn to_smallest_three(rotation: [f32; 4]) -> u32 {
    settled(once(rotation), |code| once(smallest_three(code)))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a magnitude of 9 bits")]
fn once(rotation: [f32; 4]) -> u32 {
    let components = unit(rotation);
    let mut largest = 0;
    for k in 1..4 {
        if components[k].abs() > components[largest].abs() {
            largest = k;
        }
    }
    let negate = components[largest] < 0.0;
    let mut code = largest as u32;
    for k in (0..4).filter(|k| *k != largest) {
        let size = (components[k].abs() / LARGEST * MASK as f32).round().min(MASK as f32) as u32;
        // A component of 0 has no negative sign.
        let negative = size > 0 && (components[k] < 0.0) != negate;
        code = code << (BITS + 1) | u32::from(negative) << BITS | size;
    }
    code
}

/// Returns the rotation (w, x, y, z) of 24 bits: x, y and z. The component w is not negative and follows from them
/// (`unpackQuaternionFirstThree`).
pub(super) fn first_three(code: [u8; 3]) -> [f32; 4] {
    let [x, y, z] = code.map(|v| f32::from(v) / HALF - 1.0);
    [(1.0 - (x * x + y * y + z * z)).max(0.0).sqrt(), x, y, z]
}

/// Returns the nearest code of a rotation (w, x, y, z). The decoded rotation has the same code again.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 8 bits")]
pub(super) fn to_first_three(rotation: [f32; 4]) -> [u8; 3] {
    let once = |rotation: [f32; 4]| {
        let [x, y, z, w] = unit(rotation);
        let sign = if w < 0.0 { -HALF } else { HALF };
        [x, y, z].map(|v| (v * sign + HALF).round().clamp(0.0, 2.0 * HALF) as u8)
    };
    settled(once(rotation), |code| once(first_three(code)))
}

#[cfg(test)]
mod tests {
    use lexisplat_testing::Random;

    use super::*;

    fn cosine(a: [f32; 4], b: [f32; 4]) -> f64 {
        let dot = |a: [f32; 4], b: [f32; 4]| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(b)).sum()
        };
        (dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()).abs()
    }

    /// Random rotations, and those of equal and nearly equal components, where the largest is a matter of rounding.
    fn rotations() -> Vec<[f32; 4]> {
        let mut random = Random::new(7);
        let mut all: Vec<[f32; 4]> = (0..20_000).map(|_| std::array::from_fn(|_| random.signed())).collect();
        let levels = [0.0, 0.5, 0.499, 0.501, 0.7069, -0.7075, -0.5, 1.0];
        for k in 0..4096_usize {
            let jitter = [0; 4].map(|_: i32| 0.002 * random.signed());
            all.push(std::array::from_fn(|j| levels[k >> (3 * j) & 7] + jitter[j]));
            all.push(std::array::from_fn(|j| levels[k >> (3 * j) & 7]));
        }
        all
    }

    #[test]
    fn codes_are_near_and_come_back() {
        for rotation in rotations() {
            let code = to_smallest_three(rotation);
            let read = smallest_three(code);
            assert_eq!(to_smallest_three(read), code, "{rotation:?}");
            let code = to_first_three(rotation);
            let coarse = first_three(code);
            assert_eq!(to_first_three(coarse), code, "{rotation:?}");
            if rotation.iter().any(|v| *v != 0.0) {
                assert!(cosine(rotation, read) > 1.0 - 4e-6, "{rotation:?} {read:?}");
                // w is what is left, which may be little.
                assert!(cosine(rotation, coarse) > 0.99, "{rotation:?} {coarse:?}");
            }
        }
    }

    #[test]
    fn any_code_is_a_rotation() {
        let mut random = Random::new(1);
        for _ in 0..20_000 {
            let bits = random.bits();
            let [a, b, c, ..] = bits.to_le_bytes();
            let whole = u32::from_le_bytes([a, b, c, bits.to_le_bytes()[3]]);
            assert!(smallest_three(whole).iter().chain(&first_three([a, b, c])).all(|v| v.is_finite()));
        }
    }
}
