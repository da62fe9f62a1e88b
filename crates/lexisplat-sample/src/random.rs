//! Seeded random numbers. Each Gaussian has a stream of its own, so that the numbers do not depend on threads.

use crate::math::Vec3;

/// Step of the `SplitMix64` state (Steele, Lea, Flood 2014): 2^64 over the golden ratio.
const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;
/// Number of uniform random numbers whose sum is a nearly normal random number of variance 1.
const UNIFORMS: u32 = 12;

/// A `SplitMix64` stream.
#[derive(Debug, Clone)]
pub(crate) struct Random(u64);

/// Returns the output of `SplitMix64` for the state `z`.
fn scramble(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Returns the top 53 bits as a number in \[0, 1).
fn to_unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

impl Random {
    /// Returns stream number `stream` of `seed`.
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        Self(scramble(scramble(seed).wrapping_add(stream.wrapping_mul(GAMMA))))
    }

    /// Returns a uniform number in \[0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(GAMMA);
        to_unit(scramble(self.0))
    }

    /// Returns a uniform number in \[-1, 1).
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }

    /// Returns a nearly normal number of mean 0 and variance 1. Its magnitude is at most 6.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..UNIFORMS).map(|_| self.uniform()).sum::<f64>() - f64::from(UNIFORMS) / 2.0
    }
}

/// Returns smooth noise in \[0, 1) with features of unit size. It interpolates random values on the integer lattice.
pub(crate) fn value_noise(p: Vec3) -> f64 {
    let cell = p.floor();
    let blend: [f64; 3] = std::array::from_fn(|i| {
        let t = p[i] - cell[i];
        t * t * (3.0 - 2.0 * t)
    });
    let mut sum = 0.0;
    for corner in 0..8_u8 {
        let mut weight = 1.0;
        let mut key = 0_u64;
        for axis in 0..3 {
            let high = corner >> axis & 1 == 1;
            weight *= if high { blend[axis] } else { 1.0 - blend[axis] };
            #[expect(clippy::cast_possible_truncation, reason = "lattice cells of a small scene")]
            let at = cell[axis] as i64 + i64::from(high);
            key = scramble(key.wrapping_mul(GAMMA).wrapping_add(at.cast_unsigned()));
        }
        sum += weight * to_unit(key);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::dvec3;

    #[test]
    fn streams_are_uniform_and_unrelated() {
        let count = 20_000_u64;
        let (mut mean, mut square, mut product) = (0.0, 0.0, 0.0);
        for stream in 0..count {
            let (a, b) = (Random::new(1, stream).uniform(), Random::new(2, stream).uniform());
            mean += a / 2e4;
            square += a * a / 2e4;
            product += (a - 0.5) * (b - 0.5) / 2e4;
        }
        assert!((mean - 0.5).abs() < 0.01 && (square - 1.0 / 3.0).abs() < 0.01 && product.abs() < 0.003);
    }

    #[test]
    fn noise_is_continuous() {
        for i in 0..100 {
            let p = dvec3(f64::from(i) * 0.37, 2.0, f64::from(i));
            let q = p + dvec3(1e-9, -1e-9, -1e-9);
            assert!((value_noise(p) - value_noise(q)).abs() < 1e-7);
            assert!((0.0..1.0).contains(&value_noise(p)));
        }
    }
}
