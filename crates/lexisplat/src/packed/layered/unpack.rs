//! Decoding a chunk to what is drawn.

use half::f16;

use super::chunk::{Form, Sink, starts};
use super::rest::Rest;
use super::steering::VALUE_BITS;
use super::symbols::{LANES, Lanes, has};
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
    fn take(&mut self, number: usize, set: u32, group: &Group, rest: &Rest, missing: usize) -> Option<()> {
        let drawn = Drawn::new(self.form, self.frame, group, missing);
        for l in (0..LANES).filter(|&l| has(set, l)) {
            let i = self.starts[l] + number;
            *self.place.positions.get_mut(i)? = drawn.position.map(|x| x[l]);
            *self.place.scales.get_mut(i)? = drawn.scales.map(|x| x[l]);
            *self.place.opacities.get_mut(i)? = drawn.opacity[l];
            *self.place.rotations.get_mut(i)? = drawn.rotation.map(|x| x[l]);
            *self.place.dc.get_mut(i)? = drawn.dc.map(|x| x[l]);
            code(self.frame, rest, group, l, &mut self.sorted);
            *self.place.counts.get_mut(i)? = u8::try_from(self.sorted.len()).ok()?;
            let out = &mut self.lanes[l];
            for &(atom, value) in &self.sorted {
                out.atoms.push(atom);
                out.values.push(value);
            }
            if !rest.exact[l].is_empty() {
                out.escapes.gaussians.push(u32::try_from(i).ok()?);
                out.escapes.rows.extend_from_slice(&rest.exact[l]);
            }
        }
        drawn.can_be(set).then_some(())
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

/// The code of a lane as it is kept in memory: by ascending atom, values in f16.
#[inline(always)]
fn code(frame: &Frame, rest: &Rest, group: &Group, l: usize, out: &mut Vec<(u16, f16)>) {
    out.clear();
    let step = frame.value_steps[(group.colour[l] & u32::from(LAST_CLASS)) as usize];
    out.extend(rest.codes[l].iter().map(|&(atom, value)| (atom, f16::from_f32(value as f32 * step))));
    out.sort_by_key(|p| p.0);
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
        let bits = group.axis_bits.map(|bits| bits.map(|bits| bits - dropped(bits, missing)));
        let turned = rotations(&group.rotation, &bits, &group.needle);
        let mut position: [Lanes<f64>; 3] = std::array::from_fn(|k| {
            let origin = f64::from(frame.origin[k]);
            group.cell[k].map(|x| origin + (f64::from(x) + 0.5) * f64::from(frame.cell))
        });
        for k in 0..3 {
            let step = powers(&group.moves[k]);
            for j in 0..3 {
                for l in 0..LANES {
                    let along = f64::from(group.counts[TARGETS + k][l].wrapping_mul(finer)) * step[l];
                    position[j][l] += along * f64::from(turned.axes[k][j][l]);
                }
            }
        }
        let coordinates: [Lanes<f32>; 3] = std::array::from_fn(|k| numbers(&values[DC + k]));
        let dc = std::array::from_fn(|c| {
            let axis = frame.dc_axes.map(|axis| axis[c] * frame.dc_unit);
            std::array::from_fn(|l| {
                frame.dc_mean[c] + coordinates[0][l] * axis[0] + coordinates[1][l] * axis[1] + coordinates[2][l] * axis[2]
            })
        });
        Self {
            position: position.map(|x| x.map(|x| x as f32)),
            scales: std::array::from_fn(|k| numbers(&values[k])),
            opacity: logits(&values[OPACITY]),
            rotation: turned.quaternions,
            dc,
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
