//! Fits SH coefficients to a colour that depends on the direction, by least squares.

use crate::math::{GOLDEN_TURN, Vec3, dvec3, sin_cos_turns};
use crate::random::Random;
use lexisplat::ShDegree;
use lexisplat::sh::{C0, CHANNELS, COLOUR_OFFSET, rest_basis};

/// Number of directions in which the colour is evaluated.
const DIRECTIONS: u32 = 144;
/// Number of SH coefficients of a channel at degree 3.
const COEFFICIENTS: usize = 16;
/// Number of SH-rest values of a Gaussian.
pub(crate) const REST: usize = CHANNELS * (COEFFICIENTS - 1);

/// Directions, and the matrix from values in these directions to coefficients.
#[derive(Debug)]
pub(crate) struct Fit {
    directions: Vec<Vec3>,
    /// Weight of each direction in each coefficient.
    weights: Vec<[f64; COEFFICIENTS]>,
}

impl Fit {
    pub(crate) fn new() -> Self {
        let mut directions = Vec::new();
        let mut basis = Vec::new();
        for k in 0..DIRECTIONS {
            let y = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(DIRECTIONS);
            let level = (1.0 - y * y).sqrt();
            let (sin, cos) = sin_cos_turns(f64::from(k) * GOLDEN_TURN);
            let direction = dvec3(level * cos, y, level * sin);
            #[expect(clippy::cast_possible_truncation, reason = "the basis is f32 by design")]
            let rest = rest_basis(ShDegree::THREE, direction.to_array().map(|v| v as f32));
            let mut row = [f64::from(C0); COEFFICIENTS];
            for (value, rest) in row[1..].iter_mut().zip(rest) {
                *value = f64::from(rest);
            }
            directions.push(direction);
            basis.push(row);
        }
        let weights = pseudo_inverse(&basis);
        Self { directions, weights }
    }

    /// Returns DC and channel-major SH-rest of `colour`, a function of the direction from the viewer to the Gaussian.
    pub(crate) fn project(&self, colour: impl Fn(Vec3) -> Vec3) -> ([f64; CHANNELS], [f64; REST]) {
        let mut sums = [[0.0; COEFFICIENTS]; CHANNELS];
        for (direction, weights) in self.directions.iter().zip(&self.weights) {
            let value = colour(*direction).to_array();
            for (sums, value) in sums.iter_mut().zip(value) {
                let value = value - f64::from(COLOUR_OFFSET);
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum += value * weight;
                }
            }
        }
        let mut rest = [0.0; REST];
        for (rest, sums) in rest.chunks_exact_mut(COEFFICIENTS - 1).zip(&sums) {
            rest.copy_from_slice(&sums[1..]);
        }
        (sums.map(|sums| sums[0]), rest)
    }
}

/// Returns `basis (basis^T basis)^-1`, row by row, by a Cholesky factorisation.
fn pseudo_inverse(basis: &[[f64; COEFFICIENTS]]) -> Vec<[f64; COEFFICIENTS]> {
    let mut l = [[0.0; COEFFICIENTS]; COEFFICIENTS];
    for i in 0..COEFFICIENTS {
        for j in 0..=i {
            let gram: f64 = basis.iter().map(|row| row[i] * row[j]).sum();
            let rest = gram - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
            l[i][j] = if i == j { rest.sqrt() } else { rest / l[j][j] };
        }
    }
    let solve = |row: &[f64; COEFFICIENTS]| {
        let mut x = *row;
        for i in 0..COEFFICIENTS {
            x[i] = (x[i] - (0..i).map(|k| l[i][k] * x[k]).sum::<f64>()) / l[i][i];
        }
        for i in (0..COEFFICIENTS).rev() {
            x[i] = (x[i] - (i + 1..COEFFICIENTS).map(|k| l[k][i] * x[k]).sum::<f64>()) / l[i][i];
        }
        x
    };
    basis.iter().map(solve).collect()
}

/// Standard deviation of the noise of a typical Gaussian's coefficients.
const NOISE: f64 = 0.033;
/// Share of the noise's variance that is common to all channels; trained models have about 0.75.
const SHARED: f64 = 0.75;

/// Adds noise like that of training. It is equally strong in all bands, mostly common to the channels, and stronger on
/// some Gaussians than on others. `amount` is a factor on the noise, usually 1.
pub(crate) fn add_training_noise(rest: &mut [f64; REST], amount: f64, random: &mut Random) {
    // The factor `0.5 + 0.2 / (1.08 - u)` is 0.7 to 3, with a mean of 1.0. Gaussians that few training views see have the
    // most noise.
    let u = random.uniform();
    let strength = amount * NOISE * (0.5 + 0.2 / (1.08 - u));
    let (common, own) = (SHARED.sqrt(), (1.0 - SHARED).sqrt());
    let shared: [f64; COEFFICIENTS - 1] = std::array::from_fn(|_| random.normal());
    for channel in rest.chunks_exact_mut(COEFFICIENTS - 1) {
        for (value, shared) in channel.iter_mut().zip(shared) {
            *value += strength * (common * shared + own * random.normal());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_function_of_degree_three_is_found_exactly() {
        let coefficient = |c: usize, k: usize| (c as f64 + 1.0) * (k as f64 - 6.5) / 40.0;
        let colour = |d: Vec3| {
            #[expect(clippy::cast_possible_truncation, reason = "the basis is f32 by design")]
            let basis = rest_basis(ShDegree::THREE, d.to_array().map(|v| v as f32));
            let channel = |c: usize| {
                let rest: f64 = (0..15).map(|k| f64::from(basis[k]) * coefficient(c, k + 1)).sum();
                0.5 + f64::from(C0) * coefficient(c, 0) + rest
            };
            Vec3::from([0, 1, 2].map(channel))
        };
        let (dc, rest) = Fit::new().project(colour);
        for c in 0..3 {
            assert!((dc[c] - coefficient(c, 0)).abs() < 1e-9);
            for k in 0..15 {
                assert!((rest[c * 15 + k] - coefficient(c, k + 1)).abs() < 1e-9);
            }
        }
    }
}
