//! The axes of base colours, as a turn of four integers.

use crate::support::maths::Vec3;

/// Largest absolute value of an integer of a turn.
const MOST: f64 = i16::MAX as f64;

/// Returns the turn nearest to orthonormal `axes`: a quaternion w, x, y, z of any length. The third axis may be reversed,
/// since a turn has right-handed axes.
pub(in crate::packed) fn turn_of(axes: &[Vec3; 3]) -> [i16; 4] {
    let mut m = axes.map(|axis| axis.map(f64::from));
    let [a, b, _] = m;
    m[2] = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    // Four times the squares of the quaternion's numbers. The others are computed from the largest one, for precision.
    let squares = [
        1.0 + m[0][0] + m[1][1] + m[2][2],
        1.0 + m[0][0] - m[1][1] - m[2][2],
        1.0 - m[0][0] + m[1][1] - m[2][2],
        1.0 - m[0][0] - m[1][1] + m[2][2],
    ];
    let sum = |a: usize, b: usize| m[a][b] + m[b][a];
    let difference = |a: usize, b: usize| m[b][a] - m[a][b];
    let largest = (0..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let q = match largest {
        0 => [squares[0], difference(1, 2), difference(2, 0), difference(0, 1)],
        1 => [difference(1, 2), squares[1], sum(0, 1), sum(0, 2)],
        2 => [difference(2, 0), sum(0, 1), squares[2], sum(1, 2)],
        _ => [difference(0, 1), sum(0, 2), sum(1, 2), squares[3]],
    };
    let scale = MOST / q.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
    let turn = q.map(|x| libm::rint(x * scale).clamp(-MOST, MOST) as i16);
    if turn == [0; 4] { [i16::MAX, 0, 0, 0] } else { turn }
}

/// Returns the axes of a turn; `None` for a turn of zeros. All numbers are whole before the one division.
pub(in crate::packed) fn axes_of(turn: [i16; 4]) -> Option<[Vec3; 3]> {
    let [w, x, y, z] = turn.map(f64::from);
    let length = w * w + x * x + y * y + z * z;
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
    let row = |numbers: [f64; 3]| numbers.map(|number| (number / length) as f32);
    (length > 0.0).then(|| {
        [
            row([w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)]),
            row([2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)]),
            row([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z]),
        ]
    })
}

/// Rounds axes to those that a file holds.
pub(in crate::packed) fn rounded(axes: &[Vec3; 3]) -> [Vec3; 3] {
    axes_of(turn_of(axes)).unwrap_or(*axes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    #[test]
    fn axes_come_back_but_for_the_sign_of_the_third() {
        let mut rng = SplitMix64::new(7);
        let mut number = || rng.next() as f64 / u64::MAX as f64 * 2.0 - 1.0;
        for _ in 0..200 {
            let turn = [number(), number(), number(), number()].map(|x| (x * MOST) as i16);
            let axes = axes_of(turn).unwrap();
            let again = turn_of(&axes);
            assert_eq!(turn_of(&axes_of(again).unwrap()), again, "{turn:?}");
            for (a, b) in axes.as_flattened().iter().zip(rounded(&axes).as_flattened()) {
                assert!((a - b).abs() < 1e-4, "{turn:?} {a} {b}");
            }
            let mut mirrored = axes;
            mirrored[2] = mirrored[2].map(|x| -x);
            assert_eq!(turn_of(&mirrored), again);
        }
        assert_eq!(axes_of([0; 4]), None);
    }
}
