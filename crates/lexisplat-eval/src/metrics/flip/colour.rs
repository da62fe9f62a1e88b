//! Colour spaces of FLIP. All constants are those of NVIDIA's `FLIP.h` (v1.7), which states their sources.

use std::sync::LazyLock;

/// Largest sRGB value on the straight part of the transfer curve (IEC 61966-2-1).
const SRGB_KNEE: f64 = 0.04045;
/// Slope of the straight part of the curve.
const SRGB_SLOPE: f64 = 12.92;
/// Offset of the curved part of the curve.
const SRGB_OFFSET: f64 = 0.055;
/// Exponent of the curved part of the curve.
const SRGB_GAMMA: f64 = 2.4;

/// Linear sRGB to CIE XYZ (`LinearRGB2XYZ`).
const RGB_TO_XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];
/// CIE XYZ to linear sRGB (`XYZ2LinearRGB`).
const XYZ_TO_RGB: [[f64; 3]; 3] = [
    [3.241_003_275, -1.537_398_934, -0.498_615_861],
    [-0.969_224_334, 1.875_930_071, 0.041_554_224],
    [0.055_639_423, -0.204_011_202, 1.057_148_933],
];
/// XYZ of the D65 white point (`DEFAULT_ILLUMINANT`).
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];
/// Reciprocal of the white point, rounded as in the source (`INV_DEFAULT_ILLUMINANT`).
const INVERSE_WHITE: [f64; 3] = [1.052_156_925, 1.0, 0.918_357_670];

/// Constants of CIE L*a*b*: `L = 116 y - 16`, `a = 500 (x - y)`, `b = 200 (y - z)`. YCxCz has the same formulas with
/// linear x, y and z.
pub(super) const LIGHTNESS_SCALE: f64 = 116.0;
const LIGHTNESS_OFFSET: f64 = 16.0;
const RED_GREEN_SCALE: f64 = 500.0;
const BLUE_YELLOW_SCALE: f64 = 200.0;
/// Cube root of the largest value for which L*a*b* has a line instead of the cube root.
const LAB_DELTA: f64 = 6.0 / 29.0;
/// Value of this line at 0.
const LAB_TERM: f64 = 4.0 / 29.0;

/// Strength of the Hunt effect: chroma is seen in proportion to lightness (`Hunt`).
const HUNT: f64 = 0.01;

fn times(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn linear(value: f64) -> f64 {
    if value <= SRGB_KNEE {
        value / SRGB_SLOPE
    } else {
        ((value + SRGB_OFFSET) / (1.0 + SRGB_OFFSET)).powf(SRGB_GAMMA)
    }
}

/// Returns XYZ divided by the white point.
fn white_balanced(rgb: [f64; 3]) -> [f64; 3] {
    let xyz = times(&RGB_TO_XYZ, rgb);
    [xyz[0] * INVERSE_WHITE[0], xyz[1] * INVERSE_WHITE[1], xyz[2] * INVERSE_WHITE[2]]
}

fn opponent([x, y, z]: [f64; 3]) -> [f64; 3] {
    [LIGHTNESS_SCALE * y - LIGHTNESS_OFFSET, RED_GREEN_SCALE * (x - y), BLUE_YELLOW_SCALE * (y - z)]
}

/// The value of [`linear`] for each 8-bit value.
static LINEAR: LazyLock<[f64; 256]> =
    LazyLock::new(|| std::array::from_fn(|k| linear(f64::from(of_8bit(k)))));

/// Returns the value of an 8-bit channel, as in pictures that are read.
#[expect(clippy::cast_precision_loss, reason = "at most 255")]
fn of_8bit(k: usize) -> f32 {
    k as f32 / 255.0
}

/// Converts sRGB in 0..1 to YCxCz, the linear opponent space in which the blur is applied.
pub(super) fn srgb_to_ycxcz(srgb: [f32; 3]) -> [f64; 3] {
    let table = &*LINEAR;
    opponent(white_balanced(srgb.map(|value| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
        let k = (value * 255.0).round().clamp(0.0, 255.0) as usize;
        // Photos have only 8-bit values, and computing the curve is slow.
        if of_8bit(k) == value { table[k] } else { linear(f64::from(value)) }
    })))
}

/// Returns the cube root of a positive `x`, with a relative error of at most 1e-15.
///
/// The first estimate divides the exponent by 3. It is within 6 % of the root. Each of Halley's steps cubes the error.
fn cube_root(x: f64) -> f64 {
    /// A third of the exponent's bias, in the bits of an `f64`. It is lowered a little, so that the error is equal to
    /// both sides.
    const THIRD_OF_BIAS: u64 = 0x2a9f_7893_782d_a1ce;
    let mut y = f64::from_bits(x.to_bits() / 3 + THIRD_OF_BIAS);
    for _ in 0..3 {
        let cube = y * y * y;
        y *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    y
}

/// Converts YCxCz to linear sRGB clipped to 0..1.
pub(super) fn ycxcz_to_rgb([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + LIGHTNESS_OFFSET) / LIGHTNESS_SCALE;
    let xyz = [(y + cx / RED_GREEN_SCALE) * WHITE[0], y * WHITE[1], (y - cz / BLUE_YELLOW_SCALE) * WHITE[2]];
    times(&XYZ_TO_RGB, xyz).map(|value| value.clamp(0.0, 1.0))
}

/// Converts linear sRGB to L*a*b* with chroma scaled by the Hunt effect.
pub(super) fn rgb_to_hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    let curve = |value: f64| {
        if value > LAB_DELTA * LAB_DELTA * LAB_DELTA {
            cube_root(value)
        } else {
            value / (3.0 * LAB_DELTA * LAB_DELTA) + LAB_TERM
        }
    };
    let [lightness, a, b] = opponent(white_balanced(rgb).map(curve));
    [lightness, HUNT * lightness * a, HUNT * lightness * b]
}

/// Returns the distance of two colours that may differ much: the city-block distance in lightness plus the Euclidean
/// distance in chroma (Abasi et al. 2020).
pub(super) fn hyab(p: [f64; 3], q: [f64; 3]) -> f64 {
    let (a, b) = (p[1] - q[1], p[2] - q[2]);
    (p[0] - q[0]).abs() + (a * a + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_white_and_black_is_black() {
        let [y, cx, cz] = srgb_to_ycxcz([1.0; 3]);
        // The inverse of the white point is rounded, hence the tolerance.
        assert!((y - 100.0).abs() < 1e-6 && cx.abs() < 1e-4 && cz.abs() < 1e-4, "{y} {cx} {cz}");
        let [y, cx, cz] = srgb_to_ycxcz([0.0; 3]);
        assert!((y + 16.0).abs() < 1e-12 && cx.abs() < 1e-12 && cz.abs() < 1e-12);
        let [lightness, a, b] = rgb_to_hunt_lab([1.0; 3]);
        assert!((lightness - 100.0).abs() < 1e-6 && a.abs() < 1e-5 && b.abs() < 1e-5, "{lightness} {a} {b}");
        assert!(rgb_to_hunt_lab([0.0; 3]).iter().all(|v| v.abs() < 1e-12));
    }

    #[test]
    fn cube_roots_are_accurate() {
        for i in 1..20_000 {
            let x = f64::from(i) * 1e-4;
            assert!((cube_root(x) / x.cbrt() - 1.0).abs() < 1e-15, "{x}");
        }
    }

    #[test]
    fn eight_bits_take_the_curve_too() {
        for k in 0..256 {
            let value = of_8bit(k);
            let [y, ..] = srgb_to_ycxcz([value; 3]);
            let [expected, ..] = opponent(white_balanced([linear(f64::from(value)); 3]));
            assert_eq!(y.to_bits(), expected.to_bits());
        }
    }

    #[test]
    fn colours_survive_the_round_trip() {
        for srgb in [[0.2, 0.5, 0.9], [0.03, 0.0, 1.0], [0.7, 0.7, 0.1]] {
            let back = ycxcz_to_rgb(srgb_to_ycxcz(srgb));
            for (back, value) in back.into_iter().zip(srgb.map(|v| linear(f64::from(v)))) {
                assert!((back - value).abs() < 1e-6, "{back} {value}");
            }
        }
    }
}
