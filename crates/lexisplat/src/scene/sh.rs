//! Real spherical harmonics as 3DGS uses them: degrees, coefficient layout, basis values.
//!
//! A Gaussian of degree `l` has `(l + 1)^2` coefficients in each channel. The first coefficient, DC, is kept apart. The
//! others form the SH-rest vector, which this project compresses. The vector is **channel-major**, as `f_rest_*` in a PLY:
//! all of red, then all of green, then all of blue (INRIA `gaussian_model.py`, `save_ply`, `transpose(1, 2).flatten`).

use serde::{Deserialize, Serialize};

use crate::support::error::{Error, Result};

/// Number of colour channels.
pub const CHANNELS: usize = 3;
/// Highest SH degree read or written.
pub const MAX_DEGREE: u8 = 4;
/// Number of coefficients of a channel at [`MAX_DEGREE`], DC included.
pub const MAX_COEFFICIENTS: usize = 25;
/// Length of the longest SH-rest vector: degree 4, three channels, no DC.
pub const MAX_REST: usize = CHANNELS * (MAX_COEFFICIENTS - 1);

/// Factor of the basis function of degree 0 (INRIA `utils/sh_utils.py`).
pub const C0: f32 = 0.282_094_79;
/// Factor of the basis functions of degree 1.
pub const C1: f32 = 0.488_602_51;
/// Factors of the basis functions of degree 2, in coefficient order.
pub const C2: [f32; 5] = [1.092_548_4, -1.092_548_4, 0.315_391_57, -1.092_548_4, 0.546_274_2];
/// Factors of the basis functions of degree 3, in coefficient order.
pub const C3: [f32; 7] =
    [-0.590_043_6, 2.890_611_4, -0.457_045_8, 0.373_176_34, -0.457_045_8, 1.445_305_7, -0.590_043_6];
/// Factors of the basis functions of degree 4, in the order gsplat uses (INRIA stops at degree 3).
pub const C4: [f32; 9] = [
    2.503_342_9,
    -1.770_130_8,
    0.946_174_7,
    -0.669_046_5,
    0.105_785_55,
    -0.669_046_5,
    0.473_087_34,
    -1.770_130_8,
    0.625_835_7,
];
/// Number added to the evaluated SH before the clamp at zero (INRIA `forward.cu`, `computeColorFromSH`).
pub const COLOUR_OFFSET: f32 = 0.5;

/// An SH degree, 0 to [`MAX_DEGREE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub struct ShDegree(u8);

impl TryFrom<u8> for ShDegree {
    type Error = Error;

    fn try_from(degree: u8) -> Result<Self> {
        Self::new(degree)
    }
}

impl From<ShDegree> for u8 {
    fn from(degree: ShDegree) -> Self {
        degree.0
    }
}

impl ShDegree {
    /// Degree 0, which has no view dependence.
    pub const ZERO: Self = Self(0);
    /// The first view-dependent degree.
    pub const ONE: Self = Self(1);
    pub(crate) const TWO: Self = Self(2);
    /// The degree that INRIA's trainer writes.
    pub const THREE: Self = Self(3);
    pub(crate) const FOUR: Self = Self(4);

    /// Creates an SH degree of at most [`MAX_DEGREE`].
    ///
    /// # Errors
    /// [`Error::Parameter`] for a larger degree.
    pub fn new(degree: u8) -> Result<Self> {
        if degree <= MAX_DEGREE {
            Ok(Self(degree))
        } else {
            Err(Error::parameter("degree", degree, format!("an SH degree from 0 to {MAX_DEGREE}")))
        }
    }

    /// Returns the degree whose SH-rest vector has `rest` values (0, 9, 24, 45 or 72), if any.
    #[must_use]
    pub fn from_rest(rest: usize) -> Option<Self> {
        (0..=MAX_DEGREE).map(Self).find(|d| d.rest() == rest)
    }

    /// Returns the degree as a number.
    #[must_use]
    pub fn get(self) -> u8 {
        self.0
    }

    /// Returns the number of coefficients of one channel, DC included: 1, 4, 9, 16 or 25.
    #[must_use]
    pub fn coefficients(self) -> usize {
        (usize::from(self.0) + 1) * (usize::from(self.0) + 1)
    }

    /// Returns the number of coefficients of one channel without DC: 0, 3, 8, 15 or 24.
    #[must_use]
    pub fn rest_per_channel(self) -> usize {
        self.coefficients() - 1
    }

    /// Returns the length of the SH-rest vector over three channels: 0, 9, 24, 45 or 72.
    #[must_use]
    pub fn rest(self) -> usize {
        CHANNELS * self.rest_per_channel()
    }
}

impl std::fmt::Display for ShDegree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// Returns the values of the basis functions without DC for the unit vector `direction`, which points from the camera to
/// the Gaussian. Entry `k` belongs to coefficient `k + 1`; entries above `degree` are 0.
///
/// Source: INRIA `diff-gaussian-rasterization` 59f5f77, `forward.cu`, `computeColorFromSH`; degree 4
/// as in gsplat.
#[must_use]
#[inline(always)]
pub fn rest_basis(degree: ShDegree, direction: [f32; 3]) -> [f32; MAX_COEFFICIENTS - 1] {
    let [x, y, z] = direction;
    let mut b = [0.0; MAX_COEFFICIENTS - 1];
    if degree.0 >= 1 {
        b[0] = -C1 * y;
        b[1] = C1 * z;
        b[2] = -C1 * x;
    }
    if degree.0 >= 2 {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (xy, yz, xz) = (x * y, y * z, x * z);
        b[3] = C2[0] * xy;
        b[4] = C2[1] * yz;
        b[5] = C2[2] * (2.0 * zz - xx - yy);
        b[6] = C2[3] * xz;
        b[7] = C2[4] * (xx - yy);
        if degree.0 >= 3 {
            b[8] = C3[0] * y * (3.0 * xx - yy);
            b[9] = C3[1] * xy * z;
            b[10] = C3[2] * y * (4.0 * zz - xx - yy);
            b[11] = C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
            b[12] = C3[4] * x * (4.0 * zz - xx - yy);
            b[13] = C3[5] * z * (xx - yy);
            b[14] = C3[6] * x * (xx - 3.0 * yy);
        }
        if degree.0 >= 4 {
            b[15] = C4[0] * xy * (xx - yy);
            b[16] = C4[1] * yz * (3.0 * xx - yy);
            b[17] = C4[2] * xy * (7.0 * zz - 1.0);
            b[18] = C4[3] * yz * (7.0 * zz - 3.0);
            b[19] = C4[4] * (zz * (35.0 * zz - 30.0) + 3.0);
            b[20] = C4[5] * xz * (7.0 * zz - 3.0);
            b[21] = C4[6] * (xx - yy) * (7.0 * zz - 1.0);
            b[22] = C4[7] * xz * (xx - 3.0 * yy);
            b[23] = C4[8] * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy));
        }
    }
    b
}

/// Returns the derivatives of the values of [`rest_basis`] by x, y and z of the direction, each as if the others stayed the same.
#[must_use]
pub fn rest_basis_slopes(degree: ShDegree, direction: [f32; 3]) -> [[f32; 3]; MAX_COEFFICIENTS - 1] {
    let [x, y, z] = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let mut slopes = [[0.0; 3]; MAX_COEFFICIENTS - 1];
    let mut set = |first: usize, factors: &[f32], rows: &[[f32; 3]]| {
        for ((slope, factor), row) in slopes[first..].iter_mut().zip(factors).zip(rows) {
            *slope = row.map(|v| factor * v);
        }
    };
    if degree.0 >= 1 {
        set(0, &[-C1, C1, -C1], &[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
    }
    if degree.0 >= 2 {
        set(
            3,
            &C2,
            &[[y, x, 0.0], [0.0, z, y], [-2.0 * x, -2.0 * y, 4.0 * z], [z, 0.0, x], [2.0 * x, -2.0 * y, 0.0]],
        );
    }
    if degree.0 >= 3 {
        let rows = [
            [6.0 * x * y, 3.0 * (xx - yy), 0.0],
            [y * z, x * z, x * y],
            [-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z],
            [-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * (xx + yy)],
            [4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z],
            [2.0 * x * z, -2.0 * y * z, xx - yy],
            [3.0 * (xx - yy), -6.0 * x * y, 0.0],
        ];
        set(8, &C3, &rows);
    }
    if degree.0 >= 4 {
        let (seven, three) = (7.0 * zz - 1.0, 7.0 * zz - 3.0);
        let rows = [
            [y * (3.0 * xx - yy), x * (xx - 3.0 * yy), 0.0],
            [6.0 * x * y * z, 3.0 * z * (xx - yy), y * (3.0 * xx - yy)],
            [y * seven, x * seven, 14.0 * x * y * z],
            [0.0, z * three, y * (21.0 * zz - 3.0)],
            [0.0, 0.0, z * (140.0 * zz - 60.0)],
            [z * three, 0.0, x * (21.0 * zz - 3.0)],
            [2.0 * x * seven, -2.0 * y * seven, 14.0 * z * (xx - yy)],
            [3.0 * z * (xx - yy), -6.0 * x * y * z, x * (xx - 3.0 * yy)],
            [4.0 * x * (xx - 3.0 * yy), 4.0 * y * (yy - 3.0 * xx), 0.0],
        ];
        set(15, &C4, &rows);
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_from_the_degree() {
        let rests: Vec<usize> = (0..=4).map(|d| ShDegree::new(d).unwrap().rest()).collect();
        assert_eq!(rests, [0, 9, 24, 45, 72]);
        assert_eq!(ShDegree::from_rest(45), Some(ShDegree::THREE));
        assert_eq!(ShDegree::from_rest(44), None);
        assert!(ShDegree::new(5).is_err());
    }

    /// Averaged over the sphere, products of basis functions are the identity over 4 pi. The error bound in docs/METHOD.md
    /// rests on this.
    #[test]
    fn basis_is_orthonormal() {
        let degree = ShDegree::new(4).unwrap();
        // Gauss-Legendre would need fewer points; a fine product grid is simpler to trust.
        let (rows, columns) = (400_u16, 64_u16);
        let mut gram = [[0.0_f64; 24]; 24];
        for r in 0..rows {
            let z = (f64::from(r) + 0.5) / f64::from(rows) * 2.0 - 1.0;
            let s = (1.0 - z * z).sqrt();
            for c in 0..columns {
                let phi = f64::from(c) / f64::from(columns) * std::f64::consts::TAU;
                #[expect(clippy::cast_possible_truncation, reason = "directions are f32 by design")]
                let d = [(s * phi.cos()) as f32, (s * phi.sin()) as f32, z as f32];
                let b = rest_basis(degree, d);
                for i in 0..24 {
                    for j in 0..24 {
                        gram[i][j] += f64::from(b[i]) * f64::from(b[j]);
                    }
                }
            }
        }
        let weight = 4.0 * std::f64::consts::PI / (f64::from(rows) * f64::from(columns));
        for (i, row) in gram.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((value * weight - expected).abs() < 2e-4, "{i} {j} {}", value * weight);
            }
        }
    }

    #[test]
    fn slopes_are_those_of_the_basis() {
        const STEP: f32 = 1.0 / 128.0;
        for degree in (0..=4).map(ShDegree) {
            for direction in [[0.6, -0.64, 0.48], [0.0, 0.28, -0.96], [-0.8, 0.36, 0.48]] {
                let slopes = rest_basis_slopes(degree, direction);
                for axis in 0..3 {
                    let [more, less] = [STEP, -STEP].map(|step| {
                        let mut moved = direction;
                        moved[axis] += step;
                        rest_basis(degree, moved)
                    });
                    for k in 0..24 {
                        let expected = (more[k] - less[k]) / (2.0 * STEP);
                        assert!((slopes[k][axis] - expected).abs() < 2e-3, "{degree}: {k}, {axis}");
                    }
                }
            }
        }
    }
}
