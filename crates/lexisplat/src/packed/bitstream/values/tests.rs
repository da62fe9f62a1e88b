//! Tests of values against f64.

#![expect(clippy::cast_possible_truncation, reason = "test values fit")]

use proptest::prelude::*;

use super::*;
use crate::packed::bitstream::parameters::{ColourAndShape, Parameters};
use crate::packed::encode::canonical::Canonical;

/// Rotates the vector `v` by the quaternion w, x, y, z.
fn turned([w, x, y, z]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the axes and the quaternion of lane `l`.
fn lane(out: &Turned, l: usize) -> ([[f64; 3]; 3], [f64; 4]) {
    let axes = out.axes.map(|axis| axis.map(|x| f64::from(x[l])));
    (axes, out.quaternions.map(|q| f64::from(q[l])))
}

proptest! {
    #[test]
    fn powers_are_those_of_libm(x in -1000.0..1000.0_f64) {
        let (found, expected) = (exp2(x), libm::exp2(x));
        prop_assert!((found / expected - 1.0).abs() <= 2.0_f64.powi(-31), "{x}: {found} {expected}");
    }

    #[test]
    fn powers_of_steps(log in any::<i16>()) {
        let expected = libm::exp2(f64::from(log) / 512.0);
        prop_assert!((powers(&[log.into(); LANES])[3] / expected - 1.0).abs() <= 2.0_f64.powi(-31));
    }

    #[test]
    fn logarithms_are_those_of_libm(mantissa in 1.0..2.0_f64, exponent in -60..1_i32) {
        let x = libm::ldexp(mantissa, exponent);
        // The first term that is left out is 2 / 17 of 0.1716^17. A few roundings of the sum add to the error.
        let expected = libm::log(x);
        prop_assert!((ln(x) - expected).abs() <= 1.2e-14 + 4.0 * f64::EPSILON * expected.abs(), "{x}");
    }

    #[test]
    fn logits_are_those_of_libm(log in -(1 << 26)..=-105_i32) {
        let x = f64::from(log) / 1_048_576.0;
        let expected = x - libm::log(-libm::expm1(x));
        // Near an opacity of 1, an error of 2^-31 is up to 5e-6 of the difference of the opacity from 1.
        prop_assert!((f64::from(logits(&[log; LANES])[5]) - expected).abs() <= 1e-5 + 1e-7 * expected.abs());
    }

    #[test]
    fn sines_are_those_of_libm(share in 0.0..=1.0_f32) {
        let x = share * std::f32::consts::FRAC_PI_2;
        let (sine, cosine) = sine_cosine(x);
        prop_assert!((f64::from(sine) - libm::sin(x.into())).abs() <= 2.0_f64.powi(-22));
        prop_assert!((f64::from(cosine) - libm::cos(x.into())).abs() <= 2.0_f64.powi(-22));
    }

    #[test]
    fn shares_are_middles(bits in 0_u32..=15, code in any::<u32>()) {
        let code = code & ((1 << bits) - 1);
        let expected = (f64::from(code) + 0.5) / libm::exp2(bits.into());
        prop_assert_eq!(f64::from(share(code, bits)), expected);
    }

    #[test]
    fn rotations_are_orthonormal_and_of_their_codes(
        codes in prop::array::uniform3(any::<u32>()),
        bits in prop::array::uniform2(0_u32..=15),
        needle in any::<bool>(),
    ) {
        let of = |k: usize| codes[k] & ((1 << bits[usize::from(k == 2)]) - 1);
        let codes = [of(0), of(1), of(2)];
        let out = rotations(&codes.map(|c| [c; LANES]), &bits.map(|b| [b; LANES]), &[needle; LANES]);
        let (axes, q) = lane(&out, 7);
        prop_assert!((q.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 2e-6);
        for j in 0..3 {
            for k in 0..3 {
                prop_assert!((dot(axes[j], axes[k]) - f64::from(u8::from(j == k))).abs() < 2e-6);
            }
            // The quaternion turns the axes of the world to the axes of the Gaussian.
            let axis = turned(q, std::array::from_fn(|k| f64::from(u8::from(j == k))));
            prop_assert!((0..3).all(|k| (axis[k] - axes[j][k]).abs() < 4e-6), "{axis:?} {axes:?}");
        }
        // The main axis is that of the middle of its cell of the square, by f64.
        let middle = |k: usize| 2.0 * (f64::from(codes[k]) + 0.5) / libm::exp2(bits[0].into()) - 1.0;
        let (x, y) = (0.5 * (middle(0) + middle(1)), 0.5 * (middle(0) - middle(1)));
        let z = 1.0 - x.abs() - y.abs();
        let length = (x * x + y * y + z * z).sqrt();
        let main = axes[if needle { 0 } else { 2 }];
        prop_assert!((dot(main, [x / length, y / length, z / length]) - 1.0).abs() < 1e-6);
        // The turn about the main axis is that of the code. It is counted from where the shortest turn from z takes x.
        let [first, second] = across(main.map(|v| v as f32)).map(|axis| axis.map(f64::from));
        let other = axes[if needle { 1 } else { 0 }];
        let angle = libm::atan2(dot(other, second), dot(other, first));
        let wanted = std::f64::consts::PI * (f64::from(codes[2]) + 0.5) / libm::exp2(bits[1].into());
        prop_assert!((angle - wanted).abs() < 1e-5, "{angle} {wanted}");
    }

    /// Axes come back within the steps of their codes, except for their signs.
    #[test]
    fn codes_of_axes_come_back(
        q in prop::array::uniform4(-1.0..1.0_f32),
        bits in prop::array::uniform2(6_u32..=15),
        needle in any::<bool>(),
    ) {
        let norm = q.iter().map(|x| x * x).sum::<f32>().sqrt();
        prop_assume!(norm > 0.1);
        let q = q.map(|x| f64::from(x / norm));
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|v| turned(q, v));
        let parameters = Parameters { cell: 1.0, dc_axes: [[0.0; 3]; 3], ..Parameters::default() };
        let form = Canonical { axes: axes.map(|axis| axis.map(|v| v as f32)), ..Canonical::default() };
        let target = form.coded(0, [0.0; 3], ColourAndShape::default(), &parameters, 1.0);
        let codes = target.rotation_codes(bits, needle);
        prop_assert!(codes[0] >> bits[0] == 0 && codes[1] >> bits[0] == 0 && codes[2] >> bits[1] == 0);
        let out = rotations(&codes.map(|c| [c; LANES]), &bits.map(|b| [b; LANES]), &[needle; LANES]);
        let (found, _) = lane(&out, 0);
        let main = if needle { 0 } else { 2 };
        // A step of the square is at most about two steps of the angle. The error along each coordinate is half of that.
        let step = 2.0 * libm::exp2(-f64::from(bits[0])) * 2.0;
        let turn = std::f64::consts::PI * libm::exp2(-f64::from(bits[1]));
        for k in 0..3 {
            let angle = libm::acos(dot(found[k], axes[k]).abs().min(1.0));
            let allowed = if k == main { step } else { step + turn };
            prop_assert!(angle <= allowed + 1e-3, "axis {k}: {angle} of {allowed}");
        }
    }
}

#[test]
fn integers_are_multiples_of_a_unit() {
    let values = [0, 1, -1, 1 << 20, -(1 << 24), 12_345, 7, 8, 9, 10, 11, 12, 13, 14, 15, 1 << 26];
    assert_eq!(numbers(&values).map(f64::from), values.map(|v| f64::from(v) / 1_048_576.0));
}

#[test]
fn opaque_is_four_nines() {
    let opacity = |log: i32| 1.0 / (1.0 + libm::exp(-f64::from(logits(&[log; LANES])[0])));
    assert!((opacity(0) - 0.9999).abs() < 1e-6 && opacity(0) == opacity(MAX_LOG_OPACITY));
    assert!(logits(&[i32::MAX; LANES])[0].is_finite() && logits(&[i32::MIN; LANES])[0].is_finite());
}
