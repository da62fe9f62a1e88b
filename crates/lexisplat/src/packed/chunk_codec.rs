//! The loop over the Gaussians of a chunk, which encoder and decoder share.
//!
//! Every value is coded as the difference from a prediction, in units of a step. Prediction and step are
//! computed from values that are already decoded. The encoder computes them from the same rounded values as
//! the decoder, so errors do not add up.

use super::bits::{unzigzag, zigzag};
use super::canonical::Canonical;
use super::codebook::COUNT_CLASSES;
use super::morton;
use super::neighbours::{AVERAGES, Neighbours};
use super::parameters::{FEATURES, LAST_CLASS, Parameters, TARGETS};
use super::stream::{Stream, Symbols};
use crate::support::maths::{
    Vec3, atan2, axis_of_square, cross, dot, frame, logit_of_log, quaternion, sin_cos, square_of_axis,
};

/// Share of a step by which a difference must exceed the middle between two values to be rounded away from
/// zero. The value nearer to zero takes fewer bits.
const DEAD_ZONE: f32 = 0.08;
/// Largest logarithm of an opacity. Its exponential, 0.9999, counts as opaque.
pub(super) const MAX_LOG_OPACITY: f32 = -1e-4;
/// Largest difference, in steps.
const MAX_STEPS: f32 = 1e9;
/// Largest number of bits of each coordinate of an axis, and of a turn.
const MAX_AXIS_BITS: u32 = 15;
/// Angle between neighbouring points of the square of axes, per unit of the square, on average.
const SQUARE_ANGLE: f32 = 1.25;
/// A turn by this angle gives the same ellipsoid.
const HALF_TURN: f32 = std::f32::consts::PI;
/// Smallest and largest width of a cell, in steps of a position, that have contexts of their own. Between them
/// are 24 half octaves, and the first one stands for 2^-2.25 and less.
const MIN_FINENESS: f32 = 0.210_224_1;
const MAX_FINENESS: f32 = MIN_FINENESS * 4000.0;
/// Gaps with at least this many bits share a context.
const GAP_CONTEXTS: u32 = 23;
/// Averages that are not predicted: the classes and the number of nonzeros.
const COLOUR: usize = TARGETS;
const SHAPE: usize = TARGETS + 1;
const NONZEROS: usize = TARGETS + 2;

/// A Gaussian to be coded. Decoders have none and look at no value of it: they pass the default.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct GaussianValues<'a> {
    /// Number of its cell on the Morton curve. It is not below that of the last Gaussian.
    pub(super) cell: u64,
    /// Colour and shape class, at most [`LAST_CLASS`].
    pub(super) classes: [u8; 2],
    pub(super) form: Canonical,
    /// Pairs (atom, value in steps) with values that are not zero, largest first.
    pub(super) code: &'a [(u16, i32)],
    /// The exact row, if it has no code; otherwise empty.
    pub(super) exact: &'a [f32],
}

/// A decoded Gaussian. Its code is in [`ChunkCodec::code`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Decoded {
    pub(super) position: Vec3,
    pub(super) scales: Vec3,
    pub(super) rotation: [f32; 4],
    /// Before the sigmoid.
    pub(super) opacity: f32,
    pub(super) dc: Vec3,
    pub(super) colour_class: u8,
}

/// The state of coding one chunk.
#[derive(Debug)]
pub(super) struct ChunkCodec<'p> {
    parameters: &'p Parameters,
    /// Length of an SH-rest row.
    dim: usize,
    neighbours: Neighbours,
    cell: u64,
    gap_bits: u32,
    /// The last Gaussian's code: (atom, value in steps), in file order.
    pub(super) code: Vec<(u16, i32)>,
    /// Its exact row, if it has no code.
    pub(super) exact: Vec<f32>,
}

impl<'p> ChunkCodec<'p> {
    pub(super) fn new(parameters: &'p Parameters, dim: usize) -> Self {
        Self {
            parameters,
            dim,
            neighbours: Neighbours::default(),
            cell: 0,
            gap_bits: 0,
            code: Vec::with_capacity(dim),
            exact: Vec::new(),
        }
    }

    /// Codes one Gaussian. Returns `None` for impossible values, which only damaged files hold.
    #[inline]
    pub(super) fn step<S: Symbols>(&mut self, s: &mut S, target: &GaussianValues<'_>) -> Option<Decoded> {
        let p = self.parameters;
        let context = self.gap_bits.min(GAP_CONTEXTS) as usize;
        let gap = s.integer(Stream::Cell, context, || target.cell.wrapping_sub(self.cell));
        self.cell = self.cell.checked_add(gap)?;
        self.gap_bits = u64::BITS - gap.leading_zeros();
        let centre = p.centre(morton::decode(self.cell)?);
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
        let near = centre.map(|v| v as f32);
        let average = self.neighbours.average(near, 0.5 * p.cell);
        let around = average.unwrap_or_else(|| {
            let mut around = [0.0; AVERAGES];
            around[..TARGETS].copy_from_slice(&p.means);
            around
        });

        let [colour, shape] = classes(s, target, &around, average.is_some())?;
        let mut features: [f32; FEATURES] = [1.0, 0.0, f32::from(colour), f32::from(shape), 0.0, 0.0, 0.0];
        let mut values = [0.0; AVERAGES];
        let class = usize::from(shape);
        for (k, stream) in Stream::SCALES.into_iter().enumerate() {
            features[1] = around[k];
            let prediction = p.predict(k, &features);
            let step = p.scale_step(k, shape);
            let value = difference(s, stream, class, prediction, step, || target.form.scales[k]);
            features[4 + k] = value;
            values[k] = value;
        }
        let scales: Vec3 = [values[0], values[1], values[2]];
        features[1] = around[3];
        let step = p.opacity_step(shape);
        let log_opacity =
            difference(s, Stream::Opacity, class, p.predict(3, &features), step, || target.form.log_opacity);
        values[3] = log_opacity.min(MAX_LOG_OPACITY);

        let axes = rotation(s, p.rotation_steps(shape, scales), scales, &target.form.axes);
        let steps = p.position_steps(shape, scales);
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
        let offset = || std::array::from_fn(|k| (f64::from(target.form.position[k]) - centre[k]) as f32);
        let mut position = centre;
        for (k, stream) in Stream::POSITIONS.into_iter().enumerate() {
            let context = fineness(p.cell / steps[k]);
            let along = difference(s, stream, context, 0.0, steps[k], || dot(axes[k], offset()));
            for (x, axis) in position.iter_mut().zip(axes[k]) {
                *x += f64::from(along) * f64::from(axis);
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is meant")]
        let position = position.map(|v| v as f32);

        let step = p.dc_step(colour);
        for (k, stream) in Stream::DC.into_iter().enumerate() {
            features[1] = around[4 + k];
            let prediction = p.predict(4 + k, &features);
            values[4 + k] = difference(s, stream, usize::from(colour), prediction, step, || {
                p.dc_coordinates(target.form.dc)[k]
            });
        }
        let dc = p.dc_of([values[4], values[5], values[6]]);
        self.sh(s, target, colour, around[NONZEROS])?;

        values[COLOUR] = f32::from(colour);
        values[SHAPE] = f32::from(shape) - f32::from(colour);
        #[expect(clippy::cast_precision_loss, reason = "at most 72")]
        let nonzeros = self.code.len() as f32;
        values[NONZEROS] = nonzeros;
        self.neighbours.push(position, values);
        let decoded = Decoded {
            position,
            scales,
            rotation: quaternion(axes),
            opacity: logit_of_log(values[3]),
            dc,
            colour_class: colour,
        };
        let values = position.iter().chain(&scales).chain(&dc).chain(&decoded.rotation);
        let finite = values.chain([&decoded.opacity]).all(|v| v.is_finite());
        finite.then_some(decoded)
    }

    /// Codes the code of a Gaussian, and leaves it in [`Self::code`] or [`Self::exact`].
    fn sh<S: Symbols>(
        &mut self,
        s: &mut S,
        target: &GaussianValues<'_>,
        colour: u8,
        around: f32,
    ) -> Option<()> {
        self.code.clear();
        self.exact.clear();
        if self.dim == 0 {
            return Some(());
        }
        // A count above that of the longest code marks a row that is stored exactly.
        let escape = u64::try_from(self.dim).ok()? + 1;
        let context = 2 * usize::from(colour).min(COUNT_CLASSES - 1) + usize::from(around > 1.0);
        let count = s.integer(Stream::Count, context, || {
            if target.exact.is_empty() { target.code.len() as u64 } else { escape }
        });
        if count == escape {
            for k in 0..self.dim {
                let bits = s.bits(Stream::Value, 32, || u64::from(target.exact[k].to_bits()));
                self.exact.push(f32::from_bits(u32::try_from(bits).ok()?));
            }
            return self.exact.iter().all(|v| v.is_finite()).then_some(());
        }
        if count > escape {
            return None;
        }
        let mut last = None;
        for k in 0..usize::try_from(count).ok()? {
            let atom = s.symbol(Stream::Atom, usize::from(k > 0), || target.code[k].0);
            let context = match last {
                None => usize::try_from(count - 1).ok()?.min(7),
                Some(size) => 8 + usize::try_from(size).ok()?.min(15),
            };
            let size = s.integer(Stream::Value, context, || u64::from(target.code[k].1.unsigned_abs()) - 1);
            let negative = s.bits(Stream::Value, 1, || u64::from(target.code[k].1 < 0));
            let value = i32::try_from(size.checked_add(1)?).ok()?;
            self.code.push((atom, if negative == 1 { -value } else { value }));
            last = Some(size);
        }
        Some(())
    }
}

/// Colour and shape class.
fn classes<S: Symbols>(
    s: &mut S,
    target: &GaussianValues<'_>,
    around: &[f32; AVERAGES],
    known: bool,
) -> Option<[u8; 2]> {
    let context = if known { 1 + level(around[COLOUR]) } else { 0 };
    let colour = s.symbol(Stream::ColourClass, context, || u16::from(target.classes[0]));
    let colour = u8::try_from(colour).ok()?;
    let expected = (f32::from(colour) + around[SHAPE]).clamp(0.0, f32::from(LAST_CLASS));
    // In halves, so that the context also says on which side of the rounded value the class may lie.
    let context = if known { level(2.0 * (expected - (expected - 0.25).floor())) + 1 } else { 0 };
    let nearest = level(expected);
    let shape = s.integer(Stream::ShapeClass, context, || {
        zigzag(i64::from(target.classes[1]) - i64::try_from(nearest).unwrap_or(0))
    });
    let shape = i64::try_from(nearest).ok()?.checked_add(unzigzag(shape))?;
    let shape = u8::try_from(shape).ok()?;
    (colour <= LAST_CLASS && shape <= LAST_CLASS).then_some([colour, shape])
}

/// The nearest whole number from 0 to the last class.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn level(x: f32) -> usize {
    (x + 0.5).floor().clamp(0.0, f32::from(LAST_CLASS)) as usize
}

/// The context of a cell's width: its number of half octaves above a quarter of a step.
fn fineness(steps: f32) -> usize {
    // The exponent, and whether the mantissa is beyond half an octave. A logarithm would take longer.
    let scaled = steps.clamp(MIN_FINENESS, MAX_FINENESS) / MIN_FINENESS;
    let bits = scaled.to_bits();
    let octaves = (bits >> 23) - 127;
    let half = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) >= std::f32::consts::SQRT_2;
    (2 * octaves + u32::from(half)) as usize
}

/// Codes a value as `prediction` plus whole steps, and returns the value that is decoded.
#[inline]
fn difference<S: Symbols>(
    s: &mut S,
    stream: Stream,
    context: usize,
    prediction: f32,
    step: f32,
    value: impl FnOnce() -> f32,
) -> f32 {
    let steps = s.integer(stream, context, || {
        let steps = ((value() - prediction) / step).clamp(-MAX_STEPS, MAX_STEPS);
        #[expect(clippy::cast_possible_truncation, reason = "clamped")]
        let whole = (steps.abs() + 0.5 - DEAD_ZONE).floor() as i64;
        zigzag(if steps < 0.0 { -whole } else { whole })
    });
    #[expect(clippy::cast_precision_loss, reason = "the same in encoder and decoder")]
    let steps = unzigzag(steps) as f32;
    prediction + steps * step
}

/// The axis that a turn about matters least: a needle's longest, and a disc's shortest.
pub(super) fn least_axis(scales: Vec3) -> usize {
    if scales[0] - scales[1] >= scales[1] - scales[2] { 0 } else { 2 }
}

/// The steps of an orientation as it is coded, in radians, for `steps` of turns about each axis: those of
/// [`least_axis`]'s direction, and of the turn about it.
pub(super) fn rotation_steps(steps: Vec3, scales: Vec3) -> [f32; 2] {
    match least_axis(scales) {
        0 => [(steps[1] * steps[2]).sqrt(), steps[0]],
        _ => [(steps[0] * steps[1]).sqrt(), steps[2]],
    }
}

/// Codes the axes: the one that matters least as a point on a sphere, and the others as a turn about it.
fn rotation<S: Symbols>(s: &mut S, steps: Vec3, scales: Vec3, target: &[Vec3; 3]) -> [Vec3; 3] {
    let main = least_axis(scales);
    let needle = main == 0;
    let other = if needle { 1 } else { 0 };
    let [step, turn_step] = rotation_steps(steps, scales);
    let count = bits_for(2.0 * SQUARE_ANGLE / step);
    let coordinates: [f32; 2] = std::array::from_fn(|k| {
        share(s, count, || (square_of_axis(target[main])[k] + 1.0) * 0.5) * 2.0 - 1.0
    });
    let u = axis_of_square(coordinates);
    let [first, second] = frame(u);
    let turn = share(s, bits_for(HALF_TURN / turn_step), || {
        let angle = atan2(dot(target[other], second), dot(target[other], first));
        angle.rem_euclid(HALF_TURN) / HALF_TURN
    });
    let (sine, cosine) = sin_cos(turn * HALF_TURN);
    let v: Vec3 = std::array::from_fn(|k| cosine * first[k] + sine * second[k]);
    if needle { [u, v, cross(u, v)] } else { [v, cross(u, v), u] }
}

/// Codes a number from 0 to 1 in `count` bits, and returns the one that is decoded.
fn share<S: Symbols>(s: &mut S, count: u32, value: impl FnOnce() -> f32) -> f32 {
    let size = power(count);
    let cell = s.bits(Stream::Rotation, count, || {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let cell = (value() * size).floor().clamp(0.0, size - 1.0) as u64;
        cell
    });
    #[expect(clippy::cast_precision_loss, reason = "at most 15 bits")]
    let cell = cell as f32;
    (cell + 0.5) / size
}

/// Bits for about `values` different values.
fn bits_for(values: f32) -> u32 {
    // A loop of comparisons, because the last bits of a logarithm differ between machines.
    let mut count = 0;
    while count < MAX_AXIS_BITS && values > power(count) * std::f32::consts::SQRT_2 {
        count += 1;
    }
    count
}

fn power(count: u32) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "a power of two")]
    let size = (1_u64 << count) as f32;
    size
}
