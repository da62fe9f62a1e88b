//! Decoding a chunk to what is drawn.

use half::f16;

use super::chunk::{Form, Sink, starts};
use super::rest::{Coded, Cursor, Rest};
use super::steering::VALUE_BITS;
use super::symbols::{LANES, Lanes, each, has};
use super::tables::Lookup;
use super::values::{logits, numbers, powers, rotations};
use super::walk::{DC, Group, OPACITY, dropped, factor};
use crate::packed::parameters::{LAST_CLASS, TARGETS};
use crate::sparse::codes::Escapes;
use crate::support::maths::Vec3;
use crate::support::simd::Simd;

/// Largest absolute value of a value. Steps of the largest sizes take what encoders accept no farther.
const VALUE_LIMIT: i32 = 1 << (VALUE_BITS + 7);

/// What values are made with.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Frame {
    /// Corner of the grid, and side of a cell, in world units.
    pub(in crate::packed) origin: Vec3,
    pub(in crate::packed) cell: f32,
    /// Mean base colour, the axes in which its deviation is coded, and the unit of these coordinates.
    pub(in crate::packed) dc_mean: Vec3,
    pub(in crate::packed) dc_axes: [Vec3; 3],
    pub(in crate::packed) dc_unit: f32,
    /// Steps of the values of nonzeros, by colour class.
    pub(in crate::packed) value_steps: [f32; LAST_CLASS as usize + 1],
}

/// Where a chunk's geometry goes.
#[derive(Debug)]
pub(in crate::packed) struct Place<'a> {
    pub(in crate::packed) positions: &'a mut [Vec3],
    pub(in crate::packed) dc: &'a mut [Vec3],
    pub(in crate::packed) opacities: &'a mut [f32],
    pub(in crate::packed) scales: &'a mut [Vec3],
    pub(in crate::packed) rotations: &'a mut [[f32; 4]],
    /// Nonzeros of each Gaussian.
    pub(in crate::packed) counts: &'a mut [u8],
}

/// What a chunk holds beside geometry and counts.
#[derive(Debug, Default)]
pub(in crate::packed) struct Piece {
    pub(in crate::packed) atoms: Vec<u16>,
    pub(in crate::packed) values: Vec<f16>,
    /// Numbered from the start of the chunk.
    pub(in crate::packed) escapes: Escapes,
    /// Checksums of the integers of its ranges, if they were wanted.
    pub(in crate::packed) sums: Vec<u32>,
}

/// The work of [`unpack`], compiled once for each vector width.
struct Job<'j, 'p, 'r> {
    form: &'j Form,
    frame: &'j Frame,
    lookup: &'j Lookup,
    ranges: &'j [Option<&'r [u8]>],
    want_sums: bool,
    place: &'j mut Place<'p>,
}

impl pulp::NullaryFnOnce for Job<'_, '_, '_> {
    type Output = Option<Piece>;

    #[inline(always)]
    fn call(self) -> Option<Piece> {
        let Self { form, frame, lookup, ranges, want_sums, place } = self;
        let n = place.counts.len();
        let starts = starts(n, super::chunk::lanes(n));
        let mut out = Out { form, frame, place, starts, lanes: Lanes::default(), sorted: Vec::new() };
        let sums = form.play(lookup, ranges, n, want_sums, &mut out)?;
        let [mut all, rest @ ..] = out.lanes;
        for lane in rest {
            all.atoms.extend(lane.atoms);
            all.values.extend(lane.values);
            all.escapes.gaussians.extend(lane.escapes.gaussians);
            all.escapes.rows.extend(lane.escapes.rows);
        }
        // Large values of f16 are infinite, and no atom occurs twice in a Gaussian.
        let good = all.values.iter().all(|v| v.is_finite());
        good.then_some(Piece { sums, ..all })
    }
}

/// Where a decoded chunk goes.
struct Out<'j, 'p> {
    form: &'j Form,
    frame: &'j Frame,
    place: &'j mut Place<'p>,
    /// First Gaussian of each lane.
    starts: [usize; LANES + 1],
    lanes: Lanes<Piece>,
    sorted: Vec<(u16, f16)>,
}

impl Sink for Out<'_, '_> {
    #[inline(always)]
    fn group(&mut self, number: usize, set: u32, group: &Group, missing: usize) -> Option<()> {
        let drawn = Drawn::new(self.form, self.frame, group, missing);
        for l in (0..LANES).filter(|&l| has(set, l)) {
            let i = self.starts[l] + number;
            *self.place.positions.get_mut(i)? = drawn.position.map(|x| x[l]);
            *self.place.scales.get_mut(i)? = drawn.scales.map(|x| x[l]);
            *self.place.opacities.get_mut(i)? = drawn.opacity[l];
            *self.place.rotations.get_mut(i)? = drawn.rotation.map(|x| x[l]);
            *self.place.dc.get_mut(i)? = drawn.dc.map(|x| x[l]);
        }
        drawn.can_be(set).then_some(())
    }

    #[inline(always)]
    fn rest(&mut self, number: usize, rest: &Rest) -> Option<()> {
        let form = &self.form.rest;
        for l in 0..LANES {
            let out = &mut self.lanes[l];
            let mut cursor = Cursor::default();
            for k in (0..rest.len()).filter(|&k| has(rest.of(k).0, l)) {
                let i = self.starts[l] + number + k;
                let step = self.frame.value_steps[(rest.of(k).1[l] & u32::from(LAST_CLASS)) as usize];
                self.sorted.clear();
                for part in 0..form.least.len() {
                    match rest.coded(form, part, k, l, &mut cursor) {
                        Coded::Exact(row) => {
                            out.escapes.gaussians.push(u32::try_from(i).ok()?);
                            out.escapes.rows.extend_from_slice(row);
                        }
                        Coded::Code(from, count) => {
                            for (atom, value) in (from..from + count).map(|j| rest.nonzero(part, j, l)) {
                                // Codes are short, so that moving what follows is cheaper than sorting.
                                let at = self.sorted.iter().rposition(|&(other, _)| other <= atom);
                                let at = at.map_or(0, |before| before + 1);
                                self.sorted.insert(at, (atom, f16::from_f32(value as f32 * step)));
                            }
                        }
                    }
                }
                *self.place.counts.get_mut(i)? = u8::try_from(self.sorted.len()).ok()?;
                out.atoms.extend(self.sorted.iter().map(|p| p.0));
                out.values.extend(self.sorted.iter().map(|p| p.1));
            }
        }
        Some(())
    }
}

/// Decodes a chunk from the ranges that are there to `place`. `None` if no encoder writes it.
pub(in crate::packed) fn unpack(
    form: &Form,
    frame: &Frame,
    lookup: &Lookup,
    ranges: &[Option<&[u8]>],
    want_sums: bool,
    place: &mut Place<'_>,
) -> Option<Piece> {
    Simd::current().run(Job { form, frame, lookup, ranges, want_sums, place })
}

/// Eight Gaussians as numbers.
struct Drawn {
    position: [Lanes<f32>; 3],
    scales: [Lanes<f32>; 3],
    opacity: Lanes<f32>,
    rotation: [Lanes<f32>; 4],
    dc: [Lanes<f32>; 3],
    /// Whether all values of a lane are within limits.
    within: Lanes<bool>,
}

impl Drawn {
    #[inline(always)]
    fn new(form: &Form, frame: &Frame, group: &Group, missing: usize) -> Self {
        let (coarse, finer) = (factor(form.levels), factor(missing));
        let mut values = group.coarse;
        let mut within = [true; LANES];
        for t in 0..TARGETS {
            for l in 0..LANES {
                let over = group.counts[t][l].wrapping_mul(finer).wrapping_sub(group.base[t][l].wrapping_mul(coarse));
                values[t][l] = values[t][l].wrapping_add(over.wrapping_mul(group.steps[t][l]));
                within[l] &= (-VALUE_LIMIT..VALUE_LIMIT).contains(&values[t][l]);
            }
        }
        let [directions, turns] = &group.axis_bits;
        let left = |bits: &Lanes<u32>| each(|l| bits[l] - dropped(bits[l], missing));
        let bits = [left(directions), left(turns)];
        let turned = rotations(&group.rotation, &bits, &group.needle);
        let centre = |k: usize| {
            let origin = f64::from(frame.origin[k]);
            each(|l| origin + (f64::from(group.cell[k][l]) + 0.5) * f64::from(frame.cell))
        };
        let mut position: [Lanes<f64>; 3] = [centre(0), centre(1), centre(2)];
        for k in 0..3 {
            let step = powers(&group.moves[k]);
            for j in 0..3 {
                for l in 0..LANES {
                    let along = f64::from(group.counts[TARGETS + k][l].wrapping_mul(finer)) * step[l];
                    position[j][l] += along * f64::from(turned.axes[k][j][l]);
                }
            }
        }
        let coordinates = [numbers(&values[DC]), numbers(&values[DC + 1]), numbers(&values[DC + 2])];
        let channel = |c: usize| {
            let [a, b, d] = frame.dc_axes.map(|axis| axis[c] * frame.dc_unit);
            each(|l| frame.dc_mean[c] + coordinates[0][l] * a + coordinates[1][l] * b + coordinates[2][l] * d)
        };
        Self {
            position: [each(|l| position[0][l] as f32), each(|l| position[1][l] as f32), each(|l| position[2][l] as f32)],
            scales: [numbers(&values[0]), numbers(&values[1]), numbers(&values[2])],
            opacity: logits(&values[OPACITY]),
            rotation: turned.quaternions,
            dc: [channel(0), channel(1), channel(2)],
            within,
        }
    }

    /// Whether the values of all lanes in `set` are within limits and finite.
    #[inline(always)]
    fn can_be(&self, set: u32) -> bool {
        let all = self.position.iter().chain(&self.dc);
        let mut good = self.within;
        for values in all {
            for l in 0..LANES {
                good[l] &= values[l].is_finite();
            }
        }
        (0..LANES).all(|l| good[l] || !has(set, l))
    }
}
