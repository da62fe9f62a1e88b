//! The loop over the Gaussians of a chunk.
//!
//! Every value is the sum of a prediction and of whole steps. Prediction and step are computed from values that are
//! already decoded.

use super::streams::Stream;
use super::symbols::{SymbolDecoder, unzigzag};
use super::tables::CONTEXTS;
use crate::packed::appearance::MAX_LOG_OPACITY;
use crate::packed::morton;
use crate::packed::neighbours::{AVERAGES, Neighbours};
use crate::packed::parameters::{FEATURES, LAST_CLASS, Parameters, TARGETS, least_axis, rotation_steps};
use crate::support::maths::{Vec3, axis_of_square, cross, frame, logit_of_log, quaternion, sin_cos};

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
/// Colour classes that numbers of nonzeros are told apart by. Each has two contexts.
const COUNT_CLASSES: usize = 12;
/// Averages that are not predicted: the classes and the number of nonzeros.
const COLOUR: usize = TARGETS;
const SHAPE: usize = TARGETS + 1;
const NONZEROS: usize = TARGETS + 2;

/// A decoded Gaussian. Its code is in [`Walk::code`].
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

/// The state of decoding one chunk.
#[derive(Debug)]
pub(super) struct Walk<'p> {
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

impl<'p> Walk<'p> {
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

    /// Decodes one Gaussian. Returns `None` for impossible values, which only damaged files hold.
    #[inline]
    pub(super) fn step(&mut self, s: &mut SymbolDecoder<'_>) -> Option<Decoded> {
        let p = self.parameters;
        let context = self.gap_bits.min(GAP_CONTEXTS) as usize;
        let gap = s.integer(Stream::Cell, context);
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

        let [colour, shape] = classes(s, &around, average.is_some())?;
        let mut features: [f32; FEATURES] = [1.0, 0.0, f32::from(colour), f32::from(shape), 0.0, 0.0, 0.0];
        let mut values = [0.0; AVERAGES];
        let class = usize::from(shape);
        for (k, stream) in Stream::SCALES.into_iter().enumerate() {
            features[1] = around[k];
            let prediction = p.predict(k, &features);
            let step = p.scale_step(k, shape);
            let value = difference(s, stream, class, prediction, step);
            features[4 + k] = value;
            values[k] = value;
        }
        let scales: Vec3 = [values[0], values[1], values[2]];
        features[1] = around[3];
        let step = p.opacity_step(shape);
        let log_opacity = difference(s, Stream::Opacity, class, p.predict(3, &features), step);
        values[3] = log_opacity.min(MAX_LOG_OPACITY);

        let axes = rotation(s, p.rotation_steps(shape, scales), scales);
        let steps = p.position_steps(shape, scales);
        let mut position = centre;
        for (k, stream) in Stream::POSITIONS.into_iter().enumerate() {
            let context = fineness(p.cell / steps[k]);
            let along = difference(s, stream, context, 0.0, steps[k]);
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
            values[4 + k] = difference(s, stream, usize::from(colour), prediction, step);
        }
        let dc = p.dc_of([values[4], values[5], values[6]]);
        self.sh(s, colour, around[NONZEROS])?;

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

    /// Decodes the code of a Gaussian, and leaves it in [`Self::code`] or [`Self::exact`].
    fn sh(&mut self, s: &mut SymbolDecoder<'_>, colour: u8, around: f32) -> Option<()> {
        self.code.clear();
        self.exact.clear();
        if self.dim == 0 {
            return Some(());
        }
        // A count above that of the longest code marks a row that is stored exactly.
        let escape = u64::try_from(self.dim).ok()? + 1;
        let context = 2 * usize::from(colour).min(COUNT_CLASSES - 1) + usize::from(around > 1.0);
        let count = s.integer(Stream::Count, context);
        if count == escape {
            for _ in 0..self.dim {
                let bits = s.bits(Stream::Value, 32);
                self.exact.push(f32::from_bits(u32::try_from(bits).ok()?));
            }
            return self.exact.iter().all(|v| v.is_finite()).then_some(());
        }
        if count > escape {
            return None;
        }
        let mut last = None;
        for k in 0..usize::try_from(count).ok()? {
            let atom = s.symbol(Stream::Atom, usize::from(k > 0));
            let context = match last {
                None => usize::try_from(count - 1).ok()?.min(7),
                Some(size) => 8 + usize::try_from(size).ok()?.min(15),
            };
            let size = s.integer(Stream::Value, context);
            let negative = s.bits(Stream::Value, 1);
            let value = i32::try_from(size.checked_add(1)?).ok()?;
            self.code.push((atom, if negative == 1 { -value } else { value }));
            last = Some(size);
        }
        Some(())
    }
}

/// Colour and shape class.
fn classes(s: &mut SymbolDecoder<'_>, around: &[f32; AVERAGES], known: bool) -> Option<[u8; 2]> {
    let context = if known { 1 + level(around[COLOUR]) } else { 0 };
    let colour = s.symbol(Stream::ColourClass, context);
    let colour = u8::try_from(colour).ok()?;
    let expected = (f32::from(colour) + around[SHAPE]).clamp(0.0, f32::from(LAST_CLASS));
    // In halves, so that the context also says on which side of the rounded value the class may lie.
    let context = if known { level(2.0 * (expected - (expected - 0.25).floor())) + 1 } else { 0 };
    let nearest = level(expected);
    let shape = s.integer(Stream::ShapeClass, context);
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

/// Decodes a value: `prediction` plus whole steps.
#[inline]
fn difference(s: &mut SymbolDecoder<'_>, stream: Stream, context: usize, prediction: f32, step: f32) -> f32 {
    let steps = s.integer(stream, context);
    #[expect(clippy::cast_precision_loss, reason = "the same in encoder and decoder")]
    let steps = unzigzag(steps) as f32;
    prediction + steps * step
}

/// Decodes the axes: the one that matters least from a point on a sphere, and the others from a turn about it.
fn rotation(s: &mut SymbolDecoder<'_>, steps: Vec3, scales: Vec3) -> [Vec3; 3] {
    let needle = least_axis(scales) == 0;
    let [step, turn_step] = rotation_steps(steps, scales);
    let count = bits_for(2.0 * SQUARE_ANGLE / step);
    let coordinates: [f32; 2] = std::array::from_fn(|_| share(s, count) * 2.0 - 1.0);
    let u = axis_of_square(coordinates);
    let [first, second] = frame(u);
    let turn = share(s, bits_for(HALF_TURN / turn_step));
    let (sine, cosine) = sin_cos(turn * HALF_TURN);
    let v: Vec3 = std::array::from_fn(|k| cosine * first[k] + sine * second[k]);
    if needle { [u, v, cross(u, v)] } else { [v, cross(u, v), u] }
}

/// Decodes a number from 0 to 1 of `count` bits.
fn share(s: &mut SymbolDecoder<'_>, count: u32) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "at most 15 bits")]
    let cell = s.bits(Stream::Rotation, count) as f32;
    (cell + 0.5) / power(count)
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

const _: () = assert!(COUNT_CLASSES * 2 <= CONTEXTS);
