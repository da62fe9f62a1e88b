//! Functions that give the same bits on every machine, because a file must be decoded with the functions that
//! encoded it.
//!
//! IEEE arithmetic and square roots are rounded the same on every machine. The other functions come from `libm`,
//! which is plain Rust and therefore the same everywhere, unlike the system's library.

#[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
#[inline]
fn rounded(x: f64) -> f32 {
    x as f32
}

/// 2 to the power `x`.
pub(crate) fn exp2(x: f32) -> f32 {
    rounded(libm::exp2(f64::from(x)))
}

/// e to the power `x`.
pub(crate) fn exp(x: f32) -> f32 {
    rounded(libm::exp(f64::from(x)))
}

/// Natural logarithm.
pub(crate) fn ln(x: f32) -> f32 {
    rounded(libm::log(f64::from(x)))
}

/// Binary logarithm.
pub(crate) fn log2(x: f32) -> f32 {
    rounded(libm::log2(f64::from(x)))
}

/// The angle of the point (x, y).
pub(crate) fn atan2(y: f32, x: f32) -> f32 {
    rounded(libm::atan2(f64::from(y), f64::from(x)))
}

/// Sine and cosine.
pub(crate) fn sin_cos(x: f32) -> (f32, f32) {
    let (sine, cosine) = libm::sincos(f64::from(x));
    (rounded(sine), rounded(cosine))
}

/// ln(sigmoid(x)): the logarithm of an opacity, from what a trainer stores.
pub(crate) fn log_sigmoid(x: f32) -> f32 {
    let x = f64::from(x);
    rounded(x.min(0.0) - libm::log1p(libm::exp(-x.abs())))
}

/// Inverse of [`log_sigmoid`], for arguments below 0.
pub(crate) fn logit_of_log(x: f32) -> f32 {
    let x = f64::from(x);
    rounded(x - libm::log(-libm::expm1(x)))
}

/// The value below which `share` of the values in `sorted` lie; 0 if `sorted` is empty.
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

pub(crate) fn normalised(a: Vec3) -> Vec3 {
    scaled(a, 1.0 / dot(a, a).sqrt().max(f32::MIN_POSITIVE))
}

/// The axes from longest to shortest. Equally long axes keep their order.
pub(crate) fn longest_first(scales: Vec3) -> [usize; 3] {
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| scales[b].total_cmp(&scales[a]));
    order
}

/// Columns of the rotation that a quaternion (w, x, y, z) of any length means. Zero means the identity.
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

/// The quaternion (w, x, y, z) with w >= 0 of the rotation with these columns.
pub(crate) fn quaternion([a, b, c]: [Vec3; 3]) -> [f32; 4] {
    let trace = [
        1.0 + a[0] + b[1] + c[2],
        1.0 + a[0] - b[1] - c[2],
        1.0 - a[0] + b[1] - c[2],
        1.0 - a[0] - b[1] + c[2],
    ];
    let mut most = 0;
    for k in 1..4 {
        if trace[k] > trace[most] {
            most = k;
        }
    }
    let twice = trace[most].max(f32::MIN_POSITIVE).sqrt();
    let (half, inverse) = (0.5 * twice, 0.5 / twice);
    let (x, y, z) = ((b[2] - c[1]) * inverse, (c[0] - a[2]) * inverse, (a[1] - b[0]) * inverse);
    let (xy, xz, yz) = ((a[1] + b[0]) * inverse, (a[2] + c[0]) * inverse, (b[2] + c[1]) * inverse);
    let q = match most {
        0 => [half, x, y, z],
        1 => [x, half, xy, xz],
        2 => [y, xy, half, yz],
        _ => [z, xz, yz, half],
    };
    if q[0] < 0.0 { q.map(|v| -v) } else { q }
}

/// Two unit vectors that make a right-handed frame with the unit vector `u`.
pub(crate) fn frame(u: Vec3) -> [Vec3; 2] {
    // The coordinate axis that is most perpendicular to u.
    let mut least = 0;
    for k in 1..3 {
        if u[k].abs() < u[least].abs() {
            least = k;
        }
    }
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    let first = normalised(cross(axis, u));
    [first, cross(u, first)]
}

/// Maps a unit vector and its opposite to one point of the square from -1 to 1: the upper half of an octahedron,
/// flattened and turned by 45 degrees.
pub(crate) fn square_of_axis(u: Vec3) -> [f32; 2] {
    let u = if u[2] < 0.0 { scaled(u, -1.0) } else { u };
    let sum = u[0].abs() + u[1].abs() + u[2];
    let (x, y) = (u[0] / sum, u[1] / sum);
    [x + y, x - y]
}

/// Inverse of [`square_of_axis`] up to the sign.
pub(crate) fn axis_of_square([s, t]: [f32; 2]) -> Vec3 {
    let (x, y) = (0.5 * (s + t), 0.5 * (s - t));
    normalised([x, y, (1.0 - x.abs() - y.abs()).max(0.0)])
}

/// What a number is called that is not finite. Where only such numbers are told, nothing that writes others is needed.
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
    fn rotations_and_axes_come_back() {
        let mut rng = SplitMix64::new(1);
        for _ in 0..10_000 {
            let q: [f32; 4] = std::array::from_fn(|_| random(&mut rng));
            let r = columns(q);
            let back = columns(quaternion(r));
            for (a, b) in r.as_flattened().iter().zip(back.as_flattened()) {
                assert!((a - b).abs() < 1e-5, "{r:?} {back:?}");
            }
            let u = axis_of_square(square_of_axis(r[0]));
            assert!((dot(u, r[0]).abs() - 1.0).abs() < 1e-5, "{u:?} {r:?}");
            let [s, t] = frame(u);
            assert!(dot(cross(u, s), t) > 0.999 && dot(u, s).abs() < 1e-5);
        }
    }

    /// Files are decoded with these functions. A new release of `libm` must not change a bit, or old files would
    /// decode differently.
    #[test]
    fn values_are_frozen() {
        let mut hash = crc32fast::Hasher::new();
        let mut rng = SplitMix64::new(7);
        for _ in 0..100_000 {
            let x = 20.0 * random(&mut rng);
            let (sine, cosine) = sin_cos(x);
            for value in [exp2(x), exp(x), ln(x.abs()), sine, cosine, log_sigmoid(x), logit_of_log(-x.abs())]
            {
                hash.update(&value.to_le_bytes());
            }
        }
        assert_eq!(hash.finalize(), 2_287_769_419);
    }

    #[test]
    fn opacities_come_back() {
        for x in [-20.0_f32, -5.0, -0.1, 0.0, 3.0, 9.0] {
            let back = logit_of_log(log_sigmoid(x));
            assert!((back - x).abs() < 2e-3 * x.abs().max(1.0), "{x} {back}");
        }
    }
}
