//! Changes of the directions of axes.
//!
//! A trainer's PLY has x right, y down, z forward (RDF); SPZ and glTF have y up and z back (RUB). Half a turn about x
//! leads from one to the other. In general each axis keeps its sign or changes it. If one or three axes change their
//! signs, the scene is mirrored.

use lexisplat::sh::MAX_COEFFICIENTS;

/// The factors 1 or -1 on the three axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Flip([f32; 3]);

impl Flip {
    /// The change between RDF and RUB.
    pub(crate) const HALF_TURN: Self = Self([1.0, -1.0, -1.0]);

    /// Returns the change of the axes whose entry is true.
    pub(crate) fn of(changes: [bool; 3]) -> Self {
        Self(changes.map(|change| if change { -1.0 } else { 1.0 }))
    }

    /// Returns a position along the changed axes.
    pub(crate) fn position(self, position: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|k| self.0[k] * position[k])
    }

    /// Returns the factors on the components (x, y, z) of a quaternion. Each is the product of the factors on the two other
    /// axes, which span the plane of rotation.
    pub(crate) fn turns(self) -> [f32; 3] {
        let [x, y, z] = self.0;
        [y * z, x * z, x * y]
    }

    /// Returns a rotation (w, x, y, z) of the same ellipsoid along the changed axes.
    pub(crate) fn rotation(self, [w, x, y, z]: [f32; 4]) -> [f32; 4] {
        let [a, b, c] = self.turns();
        [w, a * x, b * y, c * z]
    }

    /// Returns the factors on SH-rest, in the order of one channel.
    ///
    /// Function m of degree l is the real part of (x + i y)^m times a polynomial of z for m >= 0, and the imaginary part
    /// of (x + i y)^|m| times a polynomial of z for m < 0. When x, y or z changes its sign, the function changes its sign
    /// if it is odd in that coordinate. When all three change, the function changes its sign if l is odd.
    pub(crate) fn rest(self) -> [f32; MAX_COEFFICIENTS - 1] {
        let mut signs = [1.0; MAX_COEFFICIENTS - 1];
        let (mut l, mut k) = (1_i32, 0);
        while k < signs.len() {
            for m in -l..=l {
                let odd_x = if m < 0 { -m - 1 } else { m };
                let odd = [odd_x, i32::from(m < 0), l - m.abs()];
                for (axis, odd) in self.0.iter().zip(odd) {
                    signs[k] *= if odd % 2 == 1 { *axis } else { 1.0 };
                }
                k += 1;
            }
            l += 1;
        }
        signs
    }
}

#[cfg(test)]
mod tests {
    use lexisplat::ShDegree;
    use lexisplat::sh::rest_basis;

    use super::*;

    fn all() -> impl Iterator<Item = Flip> {
        (0..8).map(|k| Flip::of([k & 1 != 0, k & 2 != 0, k & 4 != 0]))
    }

    #[test]
    fn factors_of_sh_are_those_of_the_basis() {
        let degree = ShDegree::new(4).unwrap();
        for flip in all() {
            for direction in [[0.6, 0.0, 0.8], [0.36, 0.48, 0.8], [-0.48, 0.64, -0.6]] {
                let [plain, turned] = [direction, flip.position(direction)].map(|d| rest_basis(degree, d));
                let signs = flip.rest();
                assert!((0..plain.len()).all(|k| (plain[k] * signs[k] - turned[k]).abs() < 1e-6), "{flip:?}");
            }
        }
        assert_eq!(Flip::of([false, true, true]), Flip::HALF_TURN);
    }

    #[expect(clippy::cast_possible_truncation, reason = "values are in single precision")]
    /// The axis of an ellipsoid along x, turned and flipped, is that of the flipped rotation, or its opposite.
    #[test]
    fn flipped_rotations_are_those_of_flipped_ellipsoids() {
        let q = [0.5, 0.1, -0.7, 0.5_f64];
        for flip in all() {
            for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                let expected = flip.position(crate::quaternion::turned(q, axis).map(|v| v as f32));
                let flipped = flip.rotation(q.map(|v| v as f32)).map(f64::from);
                let found = crate::quaternion::turned(flipped, axis).map(|v| v as f32);
                let along: f32 = (0..3).map(|k| expected[k] * found[k]).sum();
                assert!((along.abs() - 1.0).abs() < 1e-5, "{flip:?} {along}");
            }
        }
    }
}
