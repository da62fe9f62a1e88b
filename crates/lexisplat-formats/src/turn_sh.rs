//! SH coefficients of a rotated scene.
//!
//! The colour of a rotated scene in the rotated direction R d is the colour of the scene in direction d. The coefficients
//! of degree l of the rotated scene are those of the scene times a matrix. Its entries are the integrals of b(R d) b(d)
//! over the sphere, where b are the basis functions of that degree. The integrals are exact sums over few directions.

use lexisplat::ShDegree;
use lexisplat::sh::{MAX_COEFFICIENTS, MAX_DEGREE, rest_basis};

use crate::quaternion::turned;

/// Heights and weights of Gauss-Legendre quadrature with five values, which is exact for polynomials of degree 9.
const HEIGHTS: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
];
/// Number of directions around each height. Sums over them are exact for angular frequencies up to 9. Products of two
/// basis functions have at most 8.
const AROUND: u32 = 10;
/// Number of entries of the matrices of degrees 1 to 4.
const ENTRIES: usize = 9 + 25 + 49 + 81;

/// A rotation of SH-rest.
#[derive(Debug, Clone)]
pub(crate) struct ShRotation {
    /// Matrices of degrees 1 to 4, row by row, one after the other.
    matrices: [f64; ENTRIES],
}

/// Returns the index of the first coefficient of `degree` among SH-rest, and the number of its coefficients.
fn band(degree: usize) -> (usize, usize) {
    (degree * degree - 1, 2 * degree + 1)
}

impl ShRotation {
    /// Returns the rotation by the quaternion (w, x, y, z) `q`, of length 1.
    pub(crate) fn new(q: [f64; 4]) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "directions are in single precision")]
        let basis = |v: [f64; 3]| {
            let degree = ShDegree::new(MAX_DEGREE).unwrap_or(ShDegree::THREE);
            rest_basis(degree, v.map(|v| v as f32)).map(f64::from)
        };
        let mut matrices = [0.0; ENTRIES];
        for (z, weight) in HEIGHTS {
            let flat = (1.0 - z * z).sqrt();
            for k in 0..AROUND {
                let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(k) / f64::from(AROUND));
                let direction = [flat * cos, flat * sin, z];
                let [plain, seen] = [basis(direction), basis(turned(q, direction))];
                let share = weight * std::f64::consts::TAU / f64::from(AROUND);
                add_products(&mut matrices, &plain, &seen, share);
            }
        }
        Self { matrices }
    }

    /// Rotates the SH-rest of one Gaussian: `degree.rest()` values, channel-major.
    pub(crate) fn apply(&self, degree: ShDegree, rest: &mut [f32]) {
        for channel in rest.chunks_exact_mut(degree.rest_per_channel().max(1)) {
            let mut matrices = &self.matrices[..];
            for l in 1..=usize::from(degree.get()) {
                let (from, size) = band(l);
                let (matrix, others) = matrices.split_at(size * size);
                matrices = others;
                let mut turned = [0.0; MAX_COEFFICIENTS];
                for (sum, row) in turned.iter_mut().zip(matrix.chunks_exact(size)) {
                    *sum = row.iter().zip(&channel[from..]).map(|(m, v)| m * f64::from(*v)).sum();
                }
                #[expect(clippy::cast_possible_truncation, reason = "coefficients are in single precision")]
                channel[from..from + size].iter_mut().zip(turned).for_each(|(v, sum)| *v = sum as f32);
            }
        }
    }
}

/// Adds `share` times the products of the basis values `plain` and `seen` to the matrices.
fn add_products(matrices: &mut [f64; ENTRIES], plain: &[f64], seen: &[f64], share: f64) {
    let mut entries = matrices.iter_mut();
    for l in 1..=usize::from(MAX_DEGREE) {
        let (from, size) = band(l);
        for row in &seen[from..from + size] {
            for column in &plain[from..from + size] {
                if let Some(entry) = entries.next() {
                    *entry += share * row * column;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use lexisplat_testing::Random;

    use super::*;

    #[expect(clippy::cast_possible_truncation, reason = "directions are in single precision")]
    #[test]
    fn turned_coefficients_show_the_same_from_turned_directions() {
        let mut random = Random::new(3);
        for degree in (1..=4).map(|l| ShDegree::new(l).unwrap()) {
            for _ in 0..20 {
                let q: [f64; 4] = std::array::from_fn(|_| f64::from(random.signed()));
                let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
                let q = q.map(|v| v / length);
                let before: Vec<f32> = (0..degree.rest()).map(|_| random.signed()).collect();
                let mut after = before.clone();
                ShRotation::new(q).apply(degree, &mut after);
                let d: [f64; 3] = std::array::from_fn(|_| f64::from(random.signed()));
                let length = d.iter().map(|v| v * v).sum::<f64>().sqrt();
                let d = d.map(|v| v / length);
                let per = degree.rest_per_channel();
                for c in 0..3 {
                    let shown = |rest: &[f32], d: [f64; 3]| -> f32 {
                        let basis = rest_basis(degree, d.map(|v| v as f32));
                        rest[c * per..(c + 1) * per].iter().zip(basis).map(|(a, b)| a * b).sum()
                    };
                    assert!((shown(&before, d) - shown(&after, turned(q, d))).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn no_rotation_changes_next_to_nothing() {
        let before: Vec<f32> = (0..72).map(|k| k as f32 / 36.0 - 1.0).collect();
        let mut after = before.clone();
        ShRotation::new([1.0, 0.0, 0.0, 0.0]).apply(ShDegree::new(4).unwrap(), &mut after);
        assert!(before.iter().zip(&after).all(|(a, b)| (a - b).abs() < 2e-6));
    }
}
