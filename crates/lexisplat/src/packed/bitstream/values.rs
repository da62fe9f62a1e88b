//! The values of decoded integers.
//!
//! Every step is an addition, a multiplication, a division or a square root of IEEE numbers. Each lane takes these steps in
//! an order that does not depend on other lanes, so values are the same on every machine. Other decoders may compute values
//! in other ways: docs/FORMAT.md says how far values may differ.

use super::integer_model::VALUE_BITS;
use crate::packed::entropy::lanes::{LANES, Lanes, each};

/// The value of the integer 1.
const UNIT: f32 = 1.0 / (1_u32 << VALUE_BITS) as f32;
/// Largest logarithm of an opacity, as an integer value. Its exponential, 0.9999, counts as opaque.
pub(in crate::packed) const MAX_LOG_OPACITY: i32 = -105;

/// Three numbers of each lane.
pub(in crate::packed) type Lanes3 = [Lanes<f32>; 3];

/// Returns integer values as numbers.
#[inline(always)]
pub(in crate::packed) fn numbers(values: &Lanes) -> Lanes<f32> {
    each(|l| values[l] as f32 * UNIT)
}

/// Returns 2 to the power of `x`.
#[inline(always)]
fn exp2(x: f64) -> f64 {
    // Taylor series of `(2^f - 1) / f` for `f` from -0.5 to 0.5. Its error is below 2^-31.
    const TERMS: [f64; 8] = [
        std::f64::consts::LN_2,
        0.240_226_506_959_100_7,
        0.055_504_108_664_821_58,
        0.009_618_129_107_628_477,
        0.001_333_355_814_642_844_3,
        0.000_154_035_303_933_816_1,
        0.000_015_252_733_804_059_84,
        0.000_001_321_548_679_014_431,
    ];
    let x = x.clamp(-1000.0, 1000.0);
    // Adding this number and subtracting it again rounds to a whole number.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let shifted = x + WHOLE;
    let f = x - (shifted - WHOLE);
    let mut sum = TERMS[7];
    for k in (0..7).rev() {
        sum = sum * f + TERMS[k];
    }
    let power = f64::from_bits((shifted.to_bits() << 52).wrapping_add(1.0_f64.to_bits()));
    (sum * f + 1.0) * power
}

/// Returns the natural logarithm of a positive number.
#[inline(always)]
fn ln(x: f64) -> f64 {
    // `x = m * 2^e` with `m` from about 0.7 to 1.4. `ln m = 2 artanh(z)` with `z = (m - 1) / (m + 1)`, which is at most
    // 0.172.
    let bits = x.to_bits();
    let over = bits.wrapping_sub(0x3fe6_a09e_667f_3bcd);
    let m = f64::from_bits(bits.wrapping_sub(over & 0xfff0_0000_0000_0000));
    let e = ((over >> 52 ^ 0x800) as i64 - 0x800) as f64;
    let z = (m - 1.0) / (m + 1.0);
    let zz = z * z;
    let mut sum = 1.0 / 15.0;
    for k in [13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        sum = sum * zz + 1.0 / k;
    }
    e * std::f64::consts::LN_2 + 2.0 * z * sum
}

/// Returns the logits of opacities, as trainers store them. `log_opacity` holds logarithms of opacities as integer values.
#[cfg_attr(target_arch = "wasm32", inline(never))]
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(in crate::packed) fn logits(log_opacity: &Lanes) -> Lanes<f32> {
    each(|l| {
        let log = f64::from(log_opacity[l].min(MAX_LOG_OPACITY)) / f64::from(1_u32 << VALUE_BITS);
        let opacity = exp2(log * std::f64::consts::LOG2_E);
        (log - ln(1.0 - opacity)) as f32
    })
}

/// The axes and the quaternions of rotations.
#[derive(Debug, Clone, Copy)]
pub(in crate::packed) struct Turned {
    /// The axis of each of the three scales.
    pub(in crate::packed) axes: [Lanes3; 3],
    /// Quaternions w, x, y, z.
    pub(in crate::packed) quaternions: [Lanes<f32>; 4],
}

/// Returns the sine and the cosine of `x`, for `x` from 0 to pi / 2.
#[inline(always)]
fn sine_cosine(x: f32) -> (f32, f32) {
    // Taylor series about the middle of the range. Their errors are below 2^-26.
    let x = x - std::f32::consts::FRAC_PI_4;
    let xx = x * x;
    let sine =
        x * (1.0 + xx * (-1.0 / 6.0 + xx * (1.0 / 120.0 + xx * (-1.0 / 5040.0 + xx * (1.0 / 362_880.0)))));
    let cosine = 1.0
        + xx * (-0.5
            + xx * (1.0 / 24.0 + xx * (-1.0 / 720.0 + xx * (1.0 / 40_320.0 + xx * (-1.0 / 3_628_800.0)))));
    let root = std::f32::consts::FRAC_1_SQRT_2;
    ((cosine + sine) * root, (cosine - sine) * root)
}

/// Returns the middle of piece `code` of the interval from 0 to 1, if it is cut into `2^bits` equal pieces.
#[inline(always)]
fn share(code: u32, bits: u32) -> f32 {
    (code.cast_signed() as f32 + 0.5) * f32::from_bits((127 - bits) << 23)
}

/// Returns the main axis for the point `(s, t)` of the octahedral square. Both are from 0 to 1.
#[inline(always)]
pub(in crate::packed) fn main_axis(s: f32, t: f32) -> [f32; 3] {
    let (s, t) = (s * 2.0 - 1.0, t * 2.0 - 1.0);
    let (x, y) = (0.5 * (s + t), 0.5 * (s - t));
    let z = 1.0 - x.abs() - y.abs();
    // `max` is not used, since the compiler calls a function for it where its NaN may differ from that of vector
    // instructions.
    let z = if z > 0.0 { z } else { 0.0 };
    let scale = 1.0 / (x * x + y * y + z * z).sqrt();
    [x * scale, y * scale, z * scale]
}

/// Returns the two axes across a main axis with z >= 0. They are x and y after the shortest turn from (0, 0, 1) to the main
/// axis.
#[inline(always)]
pub(in crate::packed) fn across([x, y, z]: [f32; 3]) -> [[f32; 3]; 2] {
    let a = 1.0 / (1.0 + z);
    let b = -(x * y * a);
    [[1.0 - x * x * a, b, -x], [b, 1.0 - y * y * a, -y]]
}

/// Returns the rotations of codes: two coordinates of the main axis of `bits[0]` bits each, and a turn of `bits[1]` bits.
#[cfg_attr(target_arch = "wasm32", inline(never))]
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(in crate::packed) fn rotations(
    codes: &[Lanes<u32>; 3],
    bits: &[Lanes<u32>; 2],
    needle: &Lanes<bool>,
) -> Turned {
    let mut out = Turned { axes: [[[0.0; LANES]; 3]; 3], quaternions: [[0.0; LANES]; 4] };
    for l in 0..LANES {
        let u = main_axis(share(codes[0][l], bits[0][l]), share(codes[1][l], bits[0][l]));
        let [first, second] = across(u);
        let half = share(codes[2][l], bits[1][l]) * std::f32::consts::FRAC_PI_2;
        let (s, c) = sine_cosine(half);
        let (sine, cosine) = (2.0 * s * c, c * c - s * s);
        let mut v = [0.0; 3];
        let mut w = [0.0; 3];
        for k in 0..3 {
            v[k] = cosine * first[k] + sine * second[k];
            w[k] = cosine * second[k] - sine * first[k];
        }
        for k in 0..3 {
            let axes = if needle[l] { [u[k], v[k], w[k]] } else { [v[k], w[k], u[k]] };
            for (axis, value) in out.axes.iter_mut().zip(axes) {
                axis[k][l] = value;
            }
        }
        // The rotation is a turn about z, followed by the shortest turn from z to u, which is (1 + z, -y, x, 0) normalised.
        let scale = 1.0 / (2.0 + 2.0 * u[2]).sqrt();
        let (qw, qx, qy) = ((1.0 + u[2]) * scale, -(u[1] * scale), u[0] * scale);
        let (w, x, y, z) = (qw * c, qx * c + qy * s, qy * c - qx * s, qw * s);
        // A third of a turn about (1, 1, 1) makes the third axis the first one.
        let turned = [w + x + y + z, x - w - y + z, y - w - z + x, z - w - x + y].map(|v| 0.5 * v);
        let q = if needle[l] { turned } else { [w, x, y, z] };
        for (out, value) in out.quaternions.iter_mut().zip(q) {
            out[l] = value;
        }
    }
    out
}

/// Returns the powers of two of logarithms in 512ths of an octave.
#[cfg_attr(target_arch = "wasm32", inline(never))]
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(in crate::packed) fn powers(logs: &Lanes) -> Lanes<f64> {
    each(|l| exp2(f64::from(logs[l]) / 512.0))
}

#[cfg(test)]
mod tests;
