//! Positions in 16 bits and rotations in 8 bits, as in splat-transform (`write-sog.ts`, `read-sog.ts`).

/// Number of values of a byte.
pub(super) const LEVELS: usize = 256;
/// Largest code of a position.
pub(super) const MOST_CODE: f64 = 65_535.0;
/// Largest byte.
const MOST_BYTE: f64 = 255.0;
/// Value of the fourth byte of a rotation whose largest component is w. The values for x, y and z follow.
pub(super) const FIRST_MODE: u8 = 252;
/// Indices of the three other components for each largest component, of (w, x, y, z).
const OTHERS: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

/// Returns the value at `share` between `low` and `high`.
pub(super) fn lerp(low: f64, high: f64, share: f64) -> f64 {
    low + (high - low) * share
}

/// Returns a coordinate as a logarithm with the sign of the coordinate: `ln(|value| + 1)`.
pub(super) fn to_log(value: f64) -> f64 {
    libm::log(value.abs() + 1.0).copysign(value)
}

/// Returns the coordinate of `code` between `ends`, which are logarithms.
#[expect(clippy::cast_possible_truncation, reason = "positions are in single precision")]
pub(super) fn position(code: u16, [low, high]: [f64; 2]) -> f32 {
    // An empty span is taken as 1, as in splat-transform.
    let span = if high == low { 1.0 } else { high - low };
    let log = low + span * (f64::from(code) / MOST_CODE);
    (libm::exp(log.abs()) - 1.0).copysign(log) as f32
}

/// Returns the code of `value` between `ends`, which are logarithms, rounded to the nearest.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 16 bits")]
pub(super) fn to_position(value: f32, [low, high]: [f64; 2]) -> u16 {
    if high > low {
        let share = (to_log(value.into()) - low) / (high - low);
        (share * MOST_CODE).round().clamp(0.0, MOST_CODE) as u16
    } else {
        0
    }
}

/// Returns the rotation (w, x, y, z) of a pixel. If the last byte is not a mode, there is no rotation: (1, 0, 0, 0).
#[expect(clippy::cast_possible_truncation, reason = "rotations are in single precision")]
pub(super) fn rotation([a, b, c, mode]: [u8; 4]) -> [f32; 4] {
    let Some(largest) = mode.checked_sub(FIRST_MODE).map(usize::from) else {
        return [1.0, 0.0, 0.0, 0.0];
    };
    let components = [a, b, c].map(|v| (f64::from(v) / MOST_BYTE * 2.0 - 1.0) / std::f64::consts::SQRT_2);
    let rest = 1.0 - components.iter().map(|v| v * v).sum::<f64>();
    let mut turn = [rest.max(0.0).sqrt() as f32; 4];
    for (at, component) in OTHERS[largest].into_iter().zip(components) {
        turn[at] = component as f32;
    }
    turn
}

/// Returns the pixel of a rotation of any length.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 8 bits")]
pub(super) fn to_rotation(turn: [f32; 4]) -> [u8; 4] {
    let turn = turn.map(f64::from);
    let length = turn.iter().map(|v| v * v).sum::<f64>().sqrt();
    let turn = if length > 0.0 && length.is_finite() { turn } else { [1.0, 0.0, 0.0, 0.0] };
    let length = if length > 0.0 && length.is_finite() { length } else { 1.0 };
    let largest = (1..4).fold(0, |best, k| if turn[k].abs() > turn[best].abs() { k } else { best });
    let factor = std::f64::consts::SQRT_2.copysign(turn[largest]) / length;
    let byte = |k: usize| (MOST_BYTE * (turn[k] * factor * 0.5 + 0.5)).round().clamp(0.0, MOST_BYTE) as u8;
    let [a, b, c] = OTHERS[largest].map(byte);
    [a, b, c, FIRST_MODE + largest.to_le_bytes()[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_positions_come_back() {
        for ends in [[-2.5, 3.25], [0.0, 1e-3], [-8.0, -7.0], [1.5, 1.5]] {
            for code in (0..=u16::MAX).step_by(97).chain([u16::MAX]) {
                let found = to_position(position(code, ends), ends);
                assert!(found == code || ends[0] == ends[1], "{code} {found} {ends:?}");
            }
        }
        // By hand: log(e^1) is 1, in the middle of 0 and 2.
        let value = position(32_768, [0.0, 2.0]);
        assert!((f64::from(value) - (std::f64::consts::E - 1.0)).abs() < 1e-4, "{value}");
        assert!(position(0, [-1.0, 1.0]) == -position(u16::MAX, [-1.0, 1.0]));
    }

    #[test]
    fn rotations_are_near() {
        let mut random = lexisplat_testing::Random::new(3);
        for _ in 0..2000 {
            let turn: [f32; 4] = std::array::from_fn(|_| random.unit() * 4.0 - 2.0);
            let code = to_rotation(turn);
            let found = rotation(code);
            let length: f32 = turn.iter().map(|v| v * v).sum::<f32>().sqrt();
            let dot: f32 = turn.iter().zip(found).map(|(a, b)| a / length * b).sum();
            assert!(dot.abs() > 0.9999, "{turn:?} {found:?}");
            // Where two components are nearly the largest, rounding may swap them.
            let again = rotation(to_rotation(found));
            let dot: f32 = again.iter().zip(found).map(|(a, b)| a * b).sum();
            assert!(dot.abs() > 0.9999, "{turn:?} {found:?} {again:?}");
        }
        assert_eq!(to_rotation([0.0; 4]), to_rotation([2.0, 0.0, 0.0, 0.0]));
        assert_eq!(rotation([1, 2, 3, FIRST_MODE - 1]), [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(to_rotation([0.0, 0.0, -3.0, 0.0])[3], 254);
    }
}
