//! The walk over the Gaussians of a chunk, all lanes at a time. Encoder and decoder share it.
//!
//! Every value is coded as its difference from a prediction, in units of a step. The prediction and the step depend only on
//! coarse integers that come earlier in the same range. So refinements may be missing.

use super::coarseness::{dropped, factor};
use super::integer_model::{COEFFICIENTS, FEATURE_BITS, ONE, Steering, feature};
use super::neighbour_context::{AVERAGED, NeighbourContext};
use super::streams::Stream;
use super::values::{MAX_LOG_OPACITY, rotations};
use crate::packed::bitstream::broken::Broken;
use crate::packed::bitstream::coded_gaussian::CodedGaussian;
use crate::packed::bitstream::morton;
use crate::packed::bitstream::parameters::{CHANGES, ColourAndShape, DC, LAST_CLASS, OPACITY, TARGETS};
use crate::packed::entropy::lanes::{LANES, Lanes, each, has};
use crate::packed::entropy::symbols::Symbols;

/// The stream of each predicted value.
const TARGET_STREAMS: [Stream; TARGETS] =
    [Stream::Scale0, Stream::Scale1, Stream::Scale2, Stream::Opacity, Stream::Dc0, Stream::Dc1, Stream::Dc2];
const POSITION_STREAMS: [Stream; 3] = [Stream::Position0, Stream::Position1, Stream::Position2];
/// Number of bits of a gap from which on all gaps share a context.
const GAP_CONTEXTS: u32 = 23;
/// Indices of the averages that are not predicted: of the colour class, and of the shape class minus the colour class.
const COLOUR: usize = TARGETS;
const SHAPE: usize = TARGETS + 1;
/// Number of values that refinements apply to: the targets and three moves. Scales and opacities are always coded in full.
pub(in crate::packed) const REFINED: usize = TARGETS + 3;
/// One Gaussian of each lane, as integers.
#[derive(Debug, Clone, Default)]
pub(in crate::packed) struct Group {
    /// Number of the cell on the Morton curve, and its coordinates.
    pub(in crate::packed) number: Lanes<u64>,
    pub(in crate::packed) cell: [Lanes; 3],
    pub(in crate::packed) colour: Lanes<u32>,
    pub(in crate::packed) shape: Lanes<u32>,
    /// Values of the targets as the base has them, with coarse steps.
    pub(in crate::packed) coarse: [Lanes; TARGETS],
    /// Finest steps of the targets.
    pub(in crate::packed) steps: [Lanes; TARGETS],
    /// Number of coarse steps of each value, of the targets and then of the moves, as the base has them.
    pub(in crate::packed) base: [Lanes; REFINED],
    /// The same numbers of steps, as far as they are refined.
    pub(in crate::packed) counts: [Lanes; REFINED],
    /// Codes of the rotation as far as they are refined. Then the full number of bits of each coordinate of the main axis,
    /// and of the turn about it.
    pub(in crate::packed) rotation: [Lanes<u32>; 3],
    pub(in crate::packed) axis_bits: [Lanes<u32>; 2],
    pub(in crate::packed) needle: Lanes<bool>,
    /// Logarithms of the steps of moves, in 512ths of an octave.
    pub(in crate::packed) moves: [Lanes; 3],
    /// Contexts of the moves.
    pub(in crate::packed) fineness: [Lanes<u32>; 3],
    /// Values that the encoder codes: numbers of finest steps, and full codes of rotations.
    pub(in crate::packed) wanted: [Lanes; REFINED],
    pub(in crate::packed) wanted_rotation: [Lanes<u32>; 3],
    /// Steps of the interim changes: of the scales, the opacity and the base colour.
    pub(in crate::packed) interim: [Lanes; CHANGES],
}

/// The state of the walk over a chunk.
#[derive(Debug)]
pub(in crate::packed) struct GeometrySyntax<'a> {
    steering: &'a Steering,
    /// Number of refinements.
    refinements: usize,
    around: NeighbourContext,
    cell: Lanes<u64>,
    gap_bits: Lanes<u32>,
}

impl<'a> GeometrySyntax<'a> {
    pub(in crate::packed) fn new(steering: &'a Steering, refinements: usize) -> Self {
        Self {
            steering,
            refinements,
            around: NeighbourContext::default(),
            cell: [0; LANES],
            gap_bits: [0; LANES],
        }
    }

    /// Codes the base of the next Gaussian of each lane in `set`, and stores it in `group`, which may hold an earlier
    /// Gaussian. Returns the rule that a damaged file breaks. A decoder passes no Gaussians.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(in crate::packed) fn base<S: Symbols>(
        &mut self,
        s: &mut S,
        set: u32,
        coded: Option<&[&CodedGaussian; LANES]>,
        group: &mut Group,
    ) -> Result<(), Broken> {
        let p = self.steering;
        let gaussian = |l: usize| coded.map(|coded| coded[l]);
        let context = each(|l| self.gap_bits[l].min(GAP_CONTEXTS));
        let before = self.cell;
        let slot = |stream: Stream| stream.at(self.refinements);
        let gap = s.wide(slot(Stream::Cell), context, set, |l| {
            gaussian(l).map_or(0, |t| t.cell.wrapping_sub(before[l]))
        });
        let mut cell = [[0; LANES]; 3];
        let mut beyond = 0;
        for l in 0..LANES {
            self.cell[l] = self.cell[l].wrapping_add(gap[l]);
            beyond |= self.cell[l] | gap[l];
            self.gap_bits[l] = u64::BITS - gap[l].leading_zeros();
            let xyz = morton::gathered(self.cell[l]);
            for k in 0..3 {
                cell[k][l] = xyz[k].cast_signed();
            }
        }
        if beyond >> (3 * morton::BITS) != 0 {
            return Err(Broken("has a cell of 2^63 or above"));
        }
        let known = self.around.is_known();
        let around: [Lanes; AVERAGED] = if known {
            self.around.average(&cell)
        } else {
            std::array::from_fn(|k| [p.means.get(k).copied().unwrap_or(0); LANES])
        };
        let ColourAndShape { colour, shape } = classes(s, set, coded, known, &around, self.refinements)?;

        let features_of = |class: &Lanes<u32>| each(|l| (class[l] << FEATURE_BITS).cast_signed());
        let zeros = [0; LANES];
        let mut features: [Lanes; COEFFICIENTS - 1] =
            [zeros, features_of(&colour), features_of(&shape), zeros, zeros, zeros];
        (group.number, group.cell, group.colour, group.shape) = (self.cell, cell, colour, shape);
        let coarse = factor(self.refinements);
        let mut remembered = [zeros; AVERAGED];
        // All coordinates of a base colour have the same step.
        let colour_step = p.step(DC, &colour);
        for (t, stream) in TARGET_STREAMS.into_iter().enumerate() {
            features[0] = around[t];
            let (class, step) = if t < DC { (&shape, p.step(t, &shape)) } else { (&colour, colour_step) };
            let predicted = p.predict(t, &features);
            if coded.is_some() {
                for l in (0..LANES).filter(|&l| has(set, l)) {
                    let wanted = gaussian(l).map_or(0, |gaussian| gaussian.values[t]);
                    let steps =
                        |value: i32| (f64::from(value) - f64::from(predicted[l])) / f64::from(step[l]);
                    // An opaque Gaussian stays opaque: a value above the largest is coded as the largest, rounded up.
                    group.wanted[t][l] = match t == OPACITY && wanted >= MAX_LOG_OPACITY {
                        true => nearest(steps(MAX_LOG_OPACITY).ceil()),
                        false => nearest(steps(wanted)),
                    };
                }
            }
            let wanted = group.wanted[t];
            // Scales and opacities have no coarse steps, because the steps of turns and moves, and predictions, depend on
            // them.
            let coarse = if t < DC { 1 } else { coarse };
            let counts = s.signed(slot(stream), *class, set, |l| coarsened(wanted[l], coarse));
            for l in 0..LANES {
                let value = predicted[l].wrapping_add(counts[l].wrapping_mul(coarse).wrapping_mul(step[l]));
                group.coarse[t][l] = value;
                remembered[t][l] = feature(value);
            }
            if t < 3 {
                features[3 + t] = remembered[t];
            }
            group.steps[t] = step;
            group.base[t] = counts;
        }
        let scales = [features[3], features[4], features[5]];
        self.turns_and_moves(s, set, coded, scales, group);
        group.counts = group.base;
        remembered[COLOUR] = features[1];
        for l in 0..LANES {
            remembered[SHAPE][l] = features[2][l] - features[1][l];
        }
        self.around.push(cell, remembered);
        Ok(())
    }

    /// Codes the rotation and the position of a Gaussian of each lane.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn turns_and_moves<S: Symbols>(
        &self,
        s: &mut S,
        set: u32,
        coded: Option<&[&CodedGaussian; LANES]>,
        scales: [Lanes; 3],
        group: &mut Group,
    ) {
        let p = self.steering;
        let coarse = factor(self.refinements);
        (group.axis_bits, group.needle) = p.axis_bits(&group.shape, &scales);
        let [directions, turns] = &group.axis_bits;
        let left = [
            each(|l| dropped(directions[l], self.refinements)),
            each(|l| dropped(turns[l], self.refinements)),
        ];
        group.moves = p.move_logs(&group.shape, &scales);
        if let Some(coded) = coded {
            for l in (0..LANES).filter(|&l| has(set, l)) {
                let bits = group.axis_bits.map(|bits| bits[l]);
                let codes = coded[l].rotation_codes(bits, group.needle[l]);
                for (wanted, code) in group.wanted_rotation.iter_mut().zip(codes) {
                    wanted[l] = code;
                }
            }
            let axes = rotations(&group.wanted_rotation, &group.axis_bits, &group.needle).axes;
            for l in (0..LANES).filter(|&l| has(set, l)) {
                for k in 0..3 {
                    let along: f64 = (0..3).map(|j| f64::from(axes[k][j][l]) * coded[l].offset[j]).sum();
                    let step = libm::exp2(f64::from(group.moves[k][l]) / f64::from(ONE));
                    group.wanted[TARGETS + k][l] = nearest(along / step);
                }
            }
        }
        for k in 0..3 {
            let (full, left) =
                if k < 2 { (&group.axis_bits[0], &left[0]) } else { (&group.axis_bits[1], &left[1]) };
            let count = each(|l| full[l] - left[l]);
            let wanted = &group.wanted_rotation[k];
            group.rotation[k] =
                s.bits(Stream::Rotation.at(self.refinements), count, set, |l| wanted[l] >> left[l]);
        }
        for (k, stream) in POSITION_STREAMS.into_iter().enumerate() {
            group.fineness[k] = each(|l| p.fineness(group.moves[k][l]));
            let wanted = &group.wanted[TARGETS + k];
            group.base[TARGETS + k] = s.signed(stream.at(self.refinements), group.fineness[k], set, |l| {
                coarsened(wanted[l], coarse)
            });
        }
    }
}

/// Codes the colour class and the shape class.
#[inline(always)]
fn classes<S: Symbols>(
    s: &mut S,
    set: u32,
    coded: Option<&[&CodedGaussian; LANES]>,
    known: bool,
    around: &[Lanes; AVERAGED],
    refinements: usize,
) -> Result<ColourAndShape<Lanes<u32>>, Broken> {
    const LAST: i32 = LAST_CLASS as i32;
    let rounded = |x: i32| ((x + ONE / 2) >> FEATURE_BITS).clamp(0, LAST).cast_unsigned();
    let class =
        |l: usize| coded.map_or_else(ColourAndShape::default, |coded| coded[l].classes.map(u32::from));
    let none = [0; LANES];
    let context = if known { each(|l| 1 + rounded(around[COLOUR][l])) } else { none };
    let colour = s.symbols(Stream::ColourClass.at(refinements), context, set, |l| class(l).colour);
    let (mut context, mut nearest) = (none, none);
    for l in 0..LANES {
        let own = (colour[l] << FEATURE_BITS).cast_signed();
        let expected = own.wrapping_add(around[SHAPE][l]).clamp(0, LAST << FEATURE_BITS);
        // The context is in half classes, so that it also says on which side of the rounded value the class may lie.
        let below = (expected - ONE / 4) >> FEATURE_BITS << FEATURE_BITS;
        context[l] = if known { 1 + rounded(2 * (expected - below)) } else { 0 };
        nearest[l] = rounded(expected);
    }
    let over = s.signed(Stream::ShapeClass.at(refinements), context, set, |l| {
        class(l).shape.wrapping_sub(nearest[l]).cast_signed()
    });
    let mut shape = none;
    let mut beyond = false;
    for l in 0..LANES {
        shape[l] = nearest[l].wrapping_add(over[l].cast_unsigned());
        beyond |= colour[l] > u32::from(LAST_CLASS) || shape[l] > u32::from(LAST_CLASS);
    }
    if beyond { Err(Broken("has a class above 15")) } else { Ok(ColourAndShape { colour, shape }) }
}

/// Share of a step by which a difference must exceed the middle between two values to be rounded away from zero. The value
/// nearer to zero takes fewer bits.
const DEAD_ZONE: f64 = 0.08;
/// Largest number of steps.
const MAX_STEPS: f64 = 1e9;

/// Rounds a number of steps to a whole number, towards zero within the dead zone.
#[expect(clippy::cast_possible_truncation, reason = "clamped")]
pub(in crate::packed) fn nearest(steps: f64) -> i32 {
    let whole = (steps.abs().min(MAX_STEPS) + 0.5 - DEAD_ZONE).floor() as i32;
    if steps < 0.0 { -whole } else { whole }
}

/// Returns the number of steps nearest to `whole` steps, if steps are `coarse` times as large. `coarse` must be odd.
#[inline(always)]
pub(in crate::packed) fn coarsened(whole: i32, coarse: i32) -> i32 {
    (whole + coarse / 2).div_euclid(coarse)
}
