//! What the head of a file holds: how chunks are coded, what values are made with, tables, dictionary and index.

use super::bytes::ByteReader;
use super::chunk::Form;
use super::index::Index;
use super::interim::{KINDS, MOST_STEP};
use super::mean_view::{MAX_POINTS, MeanView};
use super::rest::RestForm;
use super::steering::{Integers, Steering, Step, VALUE_BITS};
use super::streams::REST_PARTS;
use super::unpack::Frame;
use crate::packed::parameters::{LAST_CLASS, Parameters};
use crate::support::limits::MAX_ATOMS;

/// Largest number of bits of the coefficients of atoms.
const MAX_ATOM_BITS: u8 = 14;
/// Largest binary logarithm of the unit of base colours.
const MAX_DC_EXPONENT: u8 = 100;
/// Largest absolute value of a coordinate of a base colour, in units. Targets may be four times as large, since the
/// largest of a scene may not be in the sample that is known.
const MOST_DC: f64 = 16.0;

/// The head of a file of version 3.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Head {
    pub(in crate::packed) atom_bits: u8,
    /// Binary logarithm of the unit of base colours.
    pub(in crate::packed) dc_exponent: u8,
    pub(in crate::packed) rest: RestForm,
    /// Steps of interim changes, if there are any, of scales, opacities and base colours.
    pub(in crate::packed) interim: Option<[u32; KINDS]>,
    pub(in crate::packed) mean_view: MeanView,
    pub(in crate::packed) integers: Integers,
    /// Its steps of values and its unit of base colours follow from the other fields.
    pub(in crate::packed) frame: Frame,
    /// Step of the values of colour class 0, and of all classes if an error was promised, otherwise 0.
    pub(in crate::packed) value_step: f32,
    pub(in crate::packed) promised: f32,
    /// Probabilities of all symbols.
    pub(in crate::packed) tables: Vec<u8>,
    /// The range of the dictionary, of one lane.
    pub(in crate::packed) dictionary: Vec<u8>,
    pub(in crate::packed) index: Index,
}

impl Head {
    /// A head without tables, dictionary and index.
    pub(in crate::packed) fn new(
        p: &Parameters,
        most_dc: f64,
        rest: RestForm,
        atom_bits: u8,
        mean_view: MeanView,
    ) -> Self {
        let mut dc_exponent = 0;
        while most_dc > MOST_DC * f64::from(dc_exponent).exp2() && dc_exponent < MAX_DC_EXPONENT {
            dc_exponent += 1;
        }
        let mut head = Self {
            atom_bits,
            dc_exponent,
            rest,
            mean_view,
            frame: Frame {
                origin: p.origin,
                cell: p.cell,
                dc_mean: p.dc_mean,
                dc_axes: p.dc_axes,
                ..Frame::default()
            },
            value_step: p.free_value_step(),
            promised: p.promised,
            ..Self::default()
        };
        head.integers = Integers::of(p, head.dc_unit());
        head.complete();
        head
    }

    /// The same with interim changes in these steps.
    pub(in crate::packed) fn with_interim(mut self, [scale, opacity, colour]: [f64; KINDS]) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let step =
            |x: f64| libm::rint(x * f64::from(1_u32 << VALUE_BITS)).clamp(1.0, f64::from(MOST_STEP)) as u32;
        self.interim = Some([step(scale), step(opacity), step(colour / self.dc_unit())]);
        self.complete();
        self
    }

    /// The unit of base colours.
    pub(in crate::packed) fn dc_unit(&self) -> f64 {
        f64::from_bits((1023 + u64::from(self.dc_exponent)) << 52)
    }

    /// Fills the fields that follow from others.
    fn complete(&mut self) {
        self.frame.dc_unit = f32::from_bits((127 + u32::from(self.dc_exponent)) << 23);
        let step = |class: usize| match self.promised > 0.0 {
            true => self.promised,
            // 2 to the power of the class, which is at most 15.
            false => self.value_step * f32::from_bits((127 + class as u32) << 23),
        };
        self.frame.interim = self.interim.unwrap_or_default();
        self.frame.value_steps = std::array::from_fn::<f32, { LAST_CLASS as usize + 1 }, _>(step);
    }

    /// How chunks are coded.
    pub(in crate::packed) fn form(&self) -> Form {
        Form { steering: Steering::new(&self.integers), rest: self.rest.clone() }
    }

    pub(in crate::packed) fn write(&self) -> Vec<u8> {
        let mut out = Vec::new();
        out.extend((self.rest.atoms as u16).to_le_bytes());
        let points = &self.mean_view.points;
        out.extend([self.atom_bits, self.dc_exponent, self.rest.least.len() as u8, points.len() as u8]);
        out.push(u8::from(self.interim.is_some()));
        out.extend(self.rest.least.iter().map(|&least| least as u8));
        out.extend(self.interim.iter().flatten().flat_map(|step| step.to_le_bytes()));
        let f = &self.frame;
        let softening: &[f32] = if points.is_empty() { &[] } else { &[self.mean_view.softening] };
        let floats = [
            &f.origin[..],
            &[f.cell],
            &f.dc_mean,
            f.dc_axes.as_flattened(),
            &[self.value_step, self.promised],
            softening,
            points.as_flattened(),
        ];
        out.extend(floats.concat().iter().flat_map(|x| x.to_le_bytes()));
        let p = &self.integers;
        for step in p.steps {
            out.extend(step.mantissa.to_le_bytes());
            out.extend(step.shift.to_le_bytes());
        }
        let integers = [
            &[p.cell, p.shape][..],
            p.turns.as_flattened(),
            p.moves.as_flattened(),
            &p.means,
            p.predictors.as_flattened(),
        ];
        out.extend(integers.concat().iter().flat_map(|x| x.to_le_bytes()));
        for part in [&self.tables, &self.dictionary] {
            out.extend((part.len() as u32).to_le_bytes());
            out.extend(part);
        }
        self.index.write(&mut out);
        out
    }

    /// Reads what [`Self::write`] wrote, for rows of `dim` coefficients; `None` for anything else.
    pub(in crate::packed) fn read(bytes: &[u8], dim: usize) -> Option<Self> {
        let mut from = ByteReader(bytes);
        let atoms = usize::from(from.u16()?);
        let [atom_bits, dc_exponent, parts, points] = [from.u8()?, from.u8()?, from.u8()?, from.u8()?];
        let (parts, points) = (usize::from(parts), usize::from(points));
        let interim = from.u8()?;
        let atoms_can_be = if dim == 0 { atoms == 0 && parts == 0 } else { (1..=MAX_ATOMS).contains(&atoms) };
        let parts_can_be = dim == 0 || (1..=REST_PARTS).contains(&parts);
        let within = atom_bits <= MAX_ATOM_BITS && dc_exponent <= MAX_DC_EXPONENT && points <= MAX_POINTS;
        if !(atoms_can_be && parts_can_be && within && interim <= 1) {
            return None;
        }
        let least: Vec<u32> = from.bytes(parts)?.iter().map(|&least| u32::from(least)).collect();
        if !least.is_sorted_by(|a, b| a > b) || least.last().is_some_and(|&last| last != 1) {
            return None;
        }
        let interim = match interim {
            0 => None,
            _ => Some([from.u32()?, from.u32()?, from.u32()?]),
        };
        if interim.iter().flatten().any(|step| !(1..=MOST_STEP).contains(step)) {
            return None;
        }
        let (origin, cell, dc_mean) = (from.f32s()?, from.f32()?, from.f32s()?);
        let dc_axes = [from.f32s()?, from.f32s()?, from.f32s()?];
        let (value_step, promised) = (from.f32()?, from.f32()?);
        let mut mean_view = MeanView::default();
        if points > 0 {
            mean_view.softening = from.f32()?;
        }
        for _ in 0..points {
            mean_view.points.push(from.f32s()?);
        }
        // Directions are divided by the softening where there is no distance.
        if cell <= 0.0 || value_step <= 0.0 || promised < 0.0 || (points > 0 && mean_view.softening <= 0.0) {
            return None;
        }
        let mut steps = [Step::default(); 5];
        for step in &mut steps {
            *step = Step { mantissa: from.u16()?, shift: from.u8()?.cast_signed() };
            if !Step::SHIFTS.contains(&step.shift) {
                return None;
            }
        }
        let [cell_log, shape] = from.i16s()?;
        let (turns, moves, means, predictors) = (from.rows()?, from.rows()?, from.i16s()?, from.rows()?);
        let length = from.u32()? as usize;
        let tables = from.bytes(length)?.to_vec();
        let length = from.u32()? as usize;
        let dictionary = from.bytes(length)?.to_vec();
        let mut head = Self {
            atom_bits,
            dc_exponent,
            rest: RestForm { dim, atoms, least },
            interim,
            mean_view,
            integers: Integers { cell: cell_log, shape, steps, turns, moves, means, predictors },
            frame: Frame { origin, cell, dc_mean, dc_axes, ..Frame::default() },
            value_step,
            promised,
            tables,
            dictionary,
            index: Index::default(),
        };
        head.index = Index::read(&mut from, head.rest.least.len(), interim.is_some())?;
        head.complete();
        from.0.is_empty().then_some(head)
    }
}
