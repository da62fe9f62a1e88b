//! The canonical form of a Gaussian: one of the 24 descriptions of its ellipsoid, and the values that are coded.

use crate::packed::bitstream::coded_gaussian::CodedGaussian;
use crate::packed::bitstream::integer_model::VALUE_BITS;
use crate::packed::bitstream::parameters::{CHANGES, ColourAndShape, Parameters};
use crate::scene::splats::Geometry;
use crate::support::maths::{Vec3, columns, cross, dot, log_sigmoid, longest_first};

/// Largest logarithm of the ratio of the longest axis to another. Thinner ellipsoids look the same, since pictures blur by
/// 0.3 squared pixels.
const MAX_THINNESS: f32 = 9.0;
/// Largest magnitude of the logarithm of a standard deviation. The exponential of a larger one leaves f32.
const MAX_LOG_SCALE: f32 = 40.0;
/// Half the logarithm of the largest f32. The variance of a larger scale leaves f32, and no rasteriser draws such a
/// Gaussian. A file limits the scale to [`MAX_LOG_SCALE`], with which the Gaussian might be drawn, so its opacity becomes
/// the smallest one.
const MAX_DRAWN_LOG_SCALE: f32 = 44.361_42;
/// Smallest logarithm of an opacity. The exponential of a smaller one is about 0 in f32.
pub(in crate::packed) const MIN_LOG_OPACITY: f32 = -100.0;
/// Smallest logarithm of an opacity: about that of 2^-23. No picture shows smaller opacities.
const LEAST_LOG_OPACITY: f32 = -16.0;
/// Largest absolute value of an integer that stands for a value.
const MOST_VALUE: f64 = (1_u32 << 26) as f64;

/// One Gaussian in canonical form.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::packed) struct Canonical {
    /// Natural logarithms of the standard deviations, longest first.
    pub(in crate::packed) scales: Vec3,
    /// The axis of the source that each of `scales` belongs to.
    pub(in crate::packed) order: [usize; 3],
    /// The directions of the axes in the order of `scales`, as a right-handed system.
    pub(in crate::packed) axes: [Vec3; 3],
    pub(in crate::packed) position: Vec3,
    /// Natural logarithm of the opacity after the sigmoid.
    pub(in crate::packed) log_opacity: f32,
    pub(in crate::packed) dc: Vec3,
}

/// Returns Gaussian `i` in canonical form.
pub(in crate::packed) fn canonical(geometry: &Geometry, i: usize) -> Canonical {
    let scales = geometry.scales[i];
    let order = longest_first(scales);
    let given = columns(geometry.rotations[i]);
    let [first, second, third] = order.map(|k| given[k]);
    // An ellipsoid does not change when one of its axes is reversed.
    let third = if dot(cross(first, second), third) < 0.0 { third.map(|v| -v) } else { third };
    let drawn = scales[order[0]] <= MAX_DRAWN_LOG_SCALE;
    let log_opacity = if drawn { log_sigmoid(geometry.opacities[i]) } else { MIN_LOG_OPACITY };
    let longest = scales[order[0]].clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE);
    Canonical {
        scales: order.map(|k| scales[k].clamp(longest - MAX_THINNESS, longest)),
        order,
        axes: [first, second, third],
        position: geometry.positions[i],
        log_opacity: log_opacity.max(MIN_LOG_OPACITY),
        dc: geometry.dc[i],
    }
}

/// Returns `x` as a multiple of `2^-VALUE_BITS`, rounded to nearest.
fn value(x: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
    let value = libm::rint(x * f64::from(1_u32 << VALUE_BITS)).clamp(-MOST_VALUE, MOST_VALUE) as i32;
    value
}

impl Canonical {
    /// Returns all values that are coded, except SH-rest. `dc_unit` is the unit of base colours.
    pub(in crate::packed) fn coded(
        &self,
        cell: u64,
        centre: [f64; 3],
        classes: ColourAndShape<u8>,
        parameters: &Parameters,
        dc_unit: f64,
    ) -> CodedGaussian {
        let [s0, s1, s2] = self.scales.map(|s| value(f64::from(s)));
        let opacity = value(f64::from(self.log_opacity.max(LEAST_LOG_OPACITY)));
        let [d0, d1, d2] = parameters.dc_coordinates(self.dc).map(|d| value(f64::from(d) / dc_unit));
        CodedGaussian {
            cell,
            classes,
            values: [s0, s1, s2, opacity, d0, d1, d2],
            axes: self.axes,
            offset: std::array::from_fn(|k| f64::from(self.position[k]) - centre[k]),
            code: Vec::new(),
            energy: 0.0,
            interim: [0; CHANGES],
            exact: Vec::new(),
        }
    }
}
