//! Vectors of three numbers, and the transcendental functions that the scene needs.
//!
//! The last bit of `f64::sin`, `cos` and `ln` depends on the platform's library. The functions of this module use only
//! operations that IEEE 754 rounds exactly, as does `glam` for vectors of `f64`. The scene is therefore the same
//! everywhere.

/// A point or direction in world units, or a colour.
pub(crate) use glam::DVec3 as Vec3;
pub(crate) use glam::dvec3;

/// Number of terms of each Taylor series. The last term is below 1e-17 on the reduced range.
const TERMS: u32 = 10;
/// The golden angle in turns. Its multiples spread directions evenly.
pub(crate) const GOLDEN_TURN: f64 = 0.381_966_011_250_105_1;

/// Returns the linear interpolation from `a` at 0 to `b` at 1.
pub(crate) fn mix(a: Vec3, b: Vec3, t: f64) -> Vec3 {
    a + (b - a) * t
}

/// Returns 0 below `low`, 1 above `high`, and a smooth transition between.
pub(crate) fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Returns the part of `a` perpendicular to the unit vector `n`, scaled to unit length.
pub(crate) fn tangent(a: Vec3, n: Vec3) -> Vec3 {
    (a - n * a.dot(n)).normalize()
}

/// Returns a unit vector perpendicular to the unit vector `n`.
pub(crate) fn any_tangent(n: Vec3) -> Vec3 {
    let axis = if n.x.abs() < 0.6 { Vec3::X } else { Vec3::Y };
    tangent(axis, n)
}

/// Returns two unit vectors perpendicular to the unit vector `n` and to each other.
pub(crate) fn frame(n: Vec3) -> (Vec3, Vec3) {
    let side = any_tangent(n);
    (side, n.cross(side))
}

/// Returns `count` points of a spiral that starts at the angle `turn`: for each the share of the points so far, 0 to 1,
/// and the sine and cosine of the angle. With the square root of the share as the radius the points cover a disc evenly.
pub(crate) fn spiral(turn: f64, count: usize) -> impl Iterator<Item = (f64, f64, f64)> {
    (0..count).map(move |k| {
        let (sin, cos) = sin_cos_turns(turn + k as f64 * GOLDEN_TURN);
        ((k as f64 + 0.5) / count as f64, sin, cos)
    })
}

/// Returns sine and cosine of `turns` full turns, with an error below 1e-15.
pub(crate) fn sin_cos_turns(turns: f64) -> (f64, f64) {
    // The remainder after the nearest quarter turn is at most an eighth of a turn.
    let quarters = (turns * 4.0).round();
    let x = (turns - quarters / 4.0) * std::f64::consts::TAU;
    let (mut sin, mut cos) = (0.0, 0.0);
    let (mut odd, mut even) = (x, 1.0);
    for k in 0..TERMS {
        let k = f64::from(2 * k);
        sin += odd;
        cos += even;
        even *= -x * x / ((k + 1.0) * (k + 2.0));
        odd *= -x * x / ((k + 2.0) * (k + 3.0));
    }
    match quarters.rem_euclid(4.0) {
        q if q < 0.5 => (sin, cos),
        q if q < 1.5 => (cos, -sin),
        q if q < 2.5 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// Returns the natural logarithm of a positive, normal `x`, with an error below 1e-14.
pub(crate) fn ln(x: f64) -> f64 {
    let (mut mantissa, mut exponent) = (x, 0.0);
    while mantissa > std::f64::consts::SQRT_2 {
        mantissa /= 2.0;
        exponent += 1.0;
    }
    while mantissa < std::f64::consts::FRAC_1_SQRT_2 {
        mantissa *= 2.0;
        exponent -= 1.0;
    }
    // `ln m = 2 artanh((m - 1) / (m + 1))`. The argument of artanh is at most 0.172.
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let mut sum = 0.0;
    let mut power = t;
    for k in 0..TERMS {
        sum += power / f64::from(2 * k + 1);
        power *= t * t;
    }
    2.0 * sum + exponent * std::f64::consts::LN_2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_functions_agree_with_the_library() {
        for i in -400_i32..400 {
            let turns = f64::from(i) / 97.0;
            let (sin, cos) = sin_cos_turns(turns);
            let angle = turns * std::f64::consts::TAU;
            assert!((sin - angle.sin()).abs() < 1e-13, "{turns}");
            assert!((cos - angle.cos()).abs() < 1e-13, "{turns}");
            let x = f64::from(i + 401) / 31.0;
            assert!((ln(x) - x.ln()).abs() < 1e-13, "{x}");
        }
        assert!((ln(1e-9) - 1e-9_f64.ln()).abs() < 1e-12);
    }
}
