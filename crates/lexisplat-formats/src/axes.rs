//! Half a turn about x, which leads from the axes of a trainer's PLY (y down, z forward) to those of SPZ and glTF (y up,
//! z back), and back.
//!
//! Both are right-handed. y and z change their signs; so do the quaternion's, and the SH functions that are odd in y and z
//! together.

use lexisplat::sh::MAX_COEFFICIENTS;

/// Turns a position.
pub(crate) fn turn_position([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, -y, -z]
}

/// Turns a rotation (w, x, y, z): the same ellipsoid seen along turned axes.
pub(crate) fn turn_rotation([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    [w, x, -y, -z]
}

/// The signs of the SH functions without DC, in order, when y and z change theirs.
pub(crate) const TURN_REST: [f32; MAX_COEFFICIENTS - 1] = turn_signs();

/// Function m of a degree l is even or odd in y as m is not negative or negative. Together with z its sign is that of
/// (-1)^l, which all three axes give, times that of x alone: (-1)^m for m of 0 and more, (-1)^(m+1) for others.
const fn turn_signs() -> [f32; MAX_COEFFICIENTS - 1] {
    let mut signs = [1.0; MAX_COEFFICIENTS - 1];
    let (mut l, mut k) = (1, 0);
    while k < signs.len() {
        let mut m = -l;
        while m <= l {
            let x_odd = if m < 0 { (m + 1) % 2 != 0 } else { m % 2 != 0 };
            if (l % 2 != 0) != x_odd {
                signs[k] = -1.0;
            }
            m += 1;
            k += 1;
        }
        l += 1;
    }
    signs
}

#[cfg(test)]
mod tests {
    use lexisplat::ShDegree;
    use lexisplat::sh::rest_basis;

    use super::*;

    #[test]
    fn signs_are_those_of_the_basis() {
        let degree = ShDegree::new(4).unwrap();
        for direction in [[0.6, 0.0, 0.8], [0.36, 0.48, 0.8], [-0.48, 0.64, -0.6]] {
            let [plain, turned] = [direction, turn_position(direction)].map(|d| rest_basis(degree, d));
            for k in 0..plain.len() {
                assert!((plain[k] * TURN_REST[k] - turned[k]).abs() < 1e-6, "{k}");
            }
        }
    }

    /// Rotating a vector and turning it is turning it and rotating by the turned quaternion.
    #[test]
    fn turned_rotations_rotate_turned_vectors() {
        let rotate = |[w, x, y, z]: [f32; 4], v: [f32; 3]| {
            let cross = |a: [f32; 3], b: [f32; 3]| {
                [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
            };
            let u = [x, y, z];
            let (once, twice) = (cross(u, v), cross(u, cross(u, v)));
            [0, 1, 2].map(|k| v[k] + 2.0 * (w * once[k] + twice[k]))
        };
        let (q, v) = ([0.5, 0.1, -0.7, 0.5], [1.0, -2.0, 3.0]);
        let [a, b] = [turn_position(rotate(q, v)), rotate(turn_rotation(q), turn_position(v))];
        for k in 0..3 {
            assert!((a[k] - b[k]).abs() < 1e-5);
        }
    }
}
