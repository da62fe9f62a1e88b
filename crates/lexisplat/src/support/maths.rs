//! Functions that give the same bits on every machine, because a scene makes the same file on every machine.
//!
//! IEEE arithmetic and square roots are rounded the same on every machine. The other functions come from `libm`,
//! which is plain Rust and therefore the same everywhere, unlike the system's library.

#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
#[inline]
fn rounded(x: f64) -> f32 {
    x as f32
}

/// Returns 2 to the power `x`.
pub(crate) fn exp2(x: f32) -> f32 {
    rounded(libm::exp2(f64::from(x)))
}

/// Returns e to the power `x`.
pub(crate) fn exp(x: f32) -> f32 {
    rounded(libm::exp(f64::from(x)))
}

/// Returns the natural logarithm of `x`.
pub(crate) fn ln(x: f32) -> f32 {
    rounded(libm::log(f64::from(x)))
}

/// Returns the binary logarithm of `x`.
pub(crate) fn log2(x: f32) -> f32 {
    rounded(libm::log2(f64::from(x)))
}

/// Returns the angle of the point (x, y).
pub(crate) fn atan2(y: f32, x: f32) -> f32 {
    rounded(libm::atan2(f64::from(y), f64::from(x)))
}

/// Returns `ln(sigmoid(x))`: the logarithm of an opacity, from the number that a trainer stores.
pub(crate) fn log_sigmoid(x: f32) -> f32 {
    let x = f64::from(x);
    rounded(x.min(0.0) - libm::log1p(libm::exp(-x.abs())))
}

/// Returns the inverse of [`log_sigmoid`] at `x`, which must be below 0.
pub(crate) fn logit_of_log(x: f32) -> f32 {
    let x = f64::from(x);
    rounded(x - libm::log(-libm::expm1(x)))
}

/// Returns the value below which `share` of the values in `sorted` lie; 0 if `sorted` is empty.
pub(crate) fn at_share<T: Copy + Default>(sorted: &[T], share: f64) -> T {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
    let index = ((sorted.len().max(1) - 1) as f64 * share) as usize;
    sorted.get(index).copied().unwrap_or_default()
}

pub(crate) type Vec3 = [f32; 3];

pub(crate) fn dot(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn scaled(a: Vec3, s: f32) -> Vec3 {
    a.map(|v| v * s)
}

/// Returns the axes from longest to shortest. Equally long axes keep their order.
pub(crate) fn longest_first(scales: Vec3) -> [usize; 3] {
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| scales[b].total_cmp(&scales[a]));
    order
}

/// Returns the columns of the rotation that a quaternion (w, x, y, z) of any length stands for. A quaternion of length 0
/// stands for the identity.
pub(crate) fn columns(q: [f32; 4]) -> [Vec3; 3] {
    let length = q.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length.is_nan() || length < 1e-12 {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let [w, x, y, z] = q.map(|v| v / length);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Returns the point of the square from -1 to 1 that stands for the unit vector `u` and its opposite. The square is the
/// upper half of an octahedron, flattened and turned by 45 degrees.
pub(crate) fn square_of_axis(u: Vec3) -> [f32; 2] {
    let u = if u[2] < 0.0 { scaled(u, -1.0) } else { u };
    let sum = u[0].abs() + u[1].abs() + u[2];
    let (x, y) = (u[0] / sum, u[1] / sum);
    [x + y, x - y]
}

/// Returns the name of a number that is not finite. Messages that name only such numbers need no code that writes other
/// numbers.
pub(crate) fn name_of(not_finite: f32) -> &'static str {
    match not_finite {
        f32::INFINITY => "inf",
        f32::NEG_INFINITY => "-inf",
        _ => "NaN",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::rng::SplitMix64;

    fn random(rng: &mut SplitMix64) -> f32 {
        f32::from(u16::try_from(rng.next() >> 48).unwrap()) / 32_768.0 - 1.0
    }

    #[test]
    fn rotations_and_axes_are_those_of_quaternions() {
        let mut rng = SplitMix64::new(1);
        for _ in 0..10_000 {
            let q: [f32; 4] = std::array::from_fn(|_| random(&mut rng));
            let r = columns(q);
            // The columns make a right-handed frame. Their trace and their antisymmetric part tell which frame it is.
            for k in 0..3 {
                let across = cross(r[k], r[(k + 1) % 3]);
                assert!(dot(across, r[(k + 2) % 3]) > 0.9999 && dot(r[k], r[(k + 1) % 3]).abs() < 1e-5);
            }
            let over = 4.0 * q[0] / q.iter().map(|v| v * v).sum::<f32>();
            assert!((1.0 + r[0][0] + r[1][1] + r[2][2] - over * q[0]).abs() < 1e-5, "{q:?} {r:?}");
            for k in 0..3 {
                let twice = r[(k + 1) % 3][(k + 2) % 3] - r[(k + 2) % 3][(k + 1) % 3];
                assert!((twice - over * q[k + 1]).abs() < 1e-5, "{q:?} {r:?}");
            }
            let [s, t] = square_of_axis(r[0]);
            let (x, y) = (0.5 * (s + t), 0.5 * (s - t));
            let u = [x, y, 1.0 - x.abs() - y.abs()];
            assert!((dot(u, r[0]).abs() - dot(u, u).sqrt()).abs() < 1e-5, "{u:?} {r:?}");
        }
    }

    /// Files are made with these functions. A new release of `libm` must not change a bit, or a scene would make another
    /// file.
    #[test]
    fn values_are_frozen() {
        let mut hash = crc32fast::Hasher::new();
        let mut rng = SplitMix64::new(7);
        for _ in 0..100_000 {
            let x = 20.0 * random(&mut rng);
            for value in [exp2(x), exp(x), ln(x.abs()), log_sigmoid(x), logit_of_log(-x.abs())] {
                hash.update(&value.to_le_bytes());
            }
        }
        assert_eq!(hash.finalize(), 4_032_334_024);
    }

    #[test]
    fn opacities_come_back() {
        for x in [-20.0_f32, -5.0, -0.1, 0.0, 3.0, 9.0] {
            let back = logit_of_log(log_sigmoid(x));
            assert!((back - x).abs() < 2e-3 * x.abs().max(1.0), "{x} {back}");
        }
    }
}
