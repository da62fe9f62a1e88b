//! The head of a file: the parameters of the coding of chunks and of their values, the tables, the dictionary and the
//! index.

use super::atoms::WholeAtoms;
use super::axes::{axes_of, turn_of};
use super::broken::{BrokenHead, must};
use super::bytes::{ByteReader, Fields, put_f24, put_number};
use super::chunk::Form;
use super::index::Index;
use super::integer_model::{Integers, Steering, Step, VALUE_BITS};
use super::interim::MOST_STEP;
use super::parameters::KINDS;
use super::points_of_view::{PointsOfView, SOFTENINGS};
use super::sh_codes::RestForm;
use super::streams::SH_PARTS;
use crate::packed::bitstream::drawn::Frame;
use crate::packed::bitstream::parameters::{LAST_CLASS, Parameters};
use crate::support::limits::MAX_ATOMS;

/// Largest binary logarithm of the unit of base colours.
const MAX_DC_EXPONENT: u8 = 100;
/// Number of bits of the number of points of view, and the position of the two flags after the number of SH parts.
const POINTS_BITS: u32 = 4;
const MARKS: u32 = 6;
/// Number of bits of the binary logarithm of the unit of base colours. The flag of interim changes is the bit above.
const EXPONENT_BITS: u32 = 7;
/// Largest absolute value of a coordinate of a base colour, in units. Values may be four times as large, since the largest
/// coordinate of a scene may not be in the sample that sets the unit.
const MOST_DC: f64 = 16.0;

/// Returns the number of atoms that a head states.
pub(crate) fn atoms_of_head(head: &[u8]) -> Option<u64> {
    ByteReader(head).number()
}

/// The head of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::packed) struct Head {
    /// Whether the fixed atoms follow the learned ones.
    pub(in crate::packed) with_axes: bool,
    /// Binary logarithm of the unit of base colours.
    pub(in crate::packed) dc_exponent: u8,
    pub(in crate::packed) rest: RestForm,
    /// Steps of the interim changes of scales, opacities and base colours; `None` without interim changes.
    pub(in crate::packed) interim: Option<[u32; KINDS]>,
    pub(in crate::packed) points_of_view: PointsOfView,
    pub(in crate::packed) integers: Integers,
    /// The turn that makes the axes of base colours.
    pub(in crate::packed) dc_turn: [i16; 4],
    /// The floats that values are made with. Its steps of SH values, its unit of base colours and its steps of interim
    /// changes follow from the other fields.
    pub(in crate::packed) frame: Frame,
    /// Step of SH values of colour class 0, and step of SH values of all classes if an error was promised. One of them is
    /// 0.
    pub(in crate::packed) value_step: f32,
    pub(in crate::packed) promised: f32,
    /// The bytes of the tables.
    pub(in crate::packed) tables: Vec<u8>,
    /// The bytes of the learned atoms.
    pub(in crate::packed) dictionary: Vec<u8>,
    pub(in crate::packed) index: Index,
}

impl Head {
    /// Creates a head without tables and index.
    pub(in crate::packed) fn new(
        p: &Parameters,
        most_dc: f64,
        rest: RestForm,
        atoms: &WholeAtoms,
        points_of_view: PointsOfView,
    ) -> Self {
        let mut dc_exponent = 0;
        while most_dc > MOST_DC * f64::from(dc_exponent).exp2() && dc_exponent < MAX_DC_EXPONENT {
            dc_exponent += 1;
        }
        let mut head = Self {
            with_axes: atoms.with_axes(),
            dictionary: atoms.write(),
            dc_exponent,
            rest,
            points_of_view,
            dc_turn: turn_of(&p.dc_axes),
            frame: Frame {
                origin: p.origin,
                cell: p.cell,
                dc_mean: p.dc_mean,
                dc_axes: p.dc_axes,
                ..Frame::default()
            },
            value_step: if p.promised > 0.0 { 0.0 } else { p.free_value_step() },
            promised: p.promised,
            ..Self::default()
        };
        head.integers = Integers::of(p, head.dc_unit());
        head.complete();
        head
    }

    /// Adds interim changes with these steps, given as natural logarithms and SH coefficients.
    pub(in crate::packed) fn with_interim(mut self, [scale, opacity, colour]: [f64; KINDS]) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let step =
            |x: f64| libm::rint(x * f64::from(1_u32 << VALUE_BITS)).clamp(1.0, f64::from(MOST_STEP)) as u32;
        self.interim = Some([step(scale), step(opacity), step(colour / self.dc_unit())]);
        self.complete();
        self
    }

    /// Returns the unit of base colours, a power of two.
    pub(in crate::packed) fn dc_unit(&self) -> f64 {
        f64::from_bits((1023 + u64::from(self.dc_exponent)) << 52)
    }

    /// Computes the fields that follow from others.
    fn complete(&mut self) {
        self.frame.dc_unit = f32::from_bits((127 + u32::from(self.dc_exponent)) << 23);
        let step = |class: usize| match self.promised > 0.0 {
            true => self.promised,
            // The factor is 2 to the power of the class, which is at most 15.
            false => self.value_step * f32::from_bits((127 + class as u32) << 23),
        };
        self.frame.interim = self.interim.unwrap_or_default();
        self.frame.value_steps = std::array::from_fn::<f32, { LAST_CLASS as usize + 1 }, _>(step);
    }

    /// Returns the parameters with which chunks are coded.
    pub(in crate::packed) fn form(&self) -> Form {
        Form { steering: Steering::new(&self.integers), rest: self.rest.clone() }
    }

    pub(in crate::packed) fn write(&self) -> Vec<u8> {
        let mut out = Vec::new();
        put_number(&mut out, self.rest.atoms as u64);
        let (points, sh_parts) = (&self.points_of_view.points, &self.rest.least);
        let is_promised = self.promised > 0.0;
        let marks = u8::from(is_promised) | u8::from(self.with_axes) << 1;
        out.push(points.len() as u8 | (sh_parts.len() as u8) << POINTS_BITS | marks << MARKS);
        out.push(self.dc_exponent | u8::from(self.interim.is_some()) << EXPONENT_BITS);
        // The last SH part is left out, since its smallest size is always 1.
        out.extend(sh_parts.iter().rev().skip(1).rev().map(|&least| least as u8));
        self.interim.iter().flatten().for_each(|&step| put_number(&mut out, step.into()));
        let f = &self.frame;
        let step = if is_promised { self.promised } else { self.value_step };
        out.extend(
            [&f.origin[..], &[f.cell, step], &f.dc_mean].concat().iter().flat_map(|x| x.to_le_bytes()),
        );
        out.extend(self.dc_turn.iter().flat_map(|x| x.to_le_bytes()));
        let softening = (!points.is_empty()).then_some(&self.points_of_view.softening);
        out.extend(softening.into_iter().flat_map(|x| x.to_le_bytes()));
        points.as_flattened().iter().for_each(|&x| put_f24(&mut out, x));
        for step in self.integers.steps {
            out.extend(step.mantissa.to_le_bytes());
            out.extend(step.shift.to_le_bytes());
        }
        for block in [&self.integers.write(), &self.tables, &self.dictionary] {
            put_number(&mut out, block.len() as u64);
            out.extend(block);
        }
        self.index.write(&mut out);
        out
    }

    /// Reads the bytes that [`Self::write`] wrote, for rows of `dim` coefficients.
    ///
    /// # Errors
    /// The broken rule for bytes that break a rule of docs/FORMAT.md, "Head".
    pub(in crate::packed) fn read(bytes: &[u8], dim: usize) -> Result<Self, BrokenHead> {
        let mut from = Fields(ByteReader(bytes));
        let atoms = from.take("m", ByteReader::number32)? as usize;
        let flags = from.take("flags", ByteReader::u8)?;
        let exponent = from.take("dc_exponent", ByteReader::u8)?;
        let (dc_exponent, interim) = (exponent & ((1 << EXPONENT_BITS) - 1), exponent >> EXPONENT_BITS == 1);
        let points = usize::from(flags & ((1 << POINTS_BITS) - 1));
        let sh_parts = usize::from(flags >> POINTS_BITS & ((1 << (MARKS - POINTS_BITS)) - 1));
        let (is_promised, with_axes) = (flags >> MARKS & 1 == 1, flags >> (MARKS + 1) == 1);
        let (fewest, most_atoms, most_sh_parts) = if dim == 0 { (0, 0, 0) } else { (1, MAX_ATOMS, SH_PARTS) };
        must((fewest..=most_atoms).contains(&atoms), || {
            format!("'m' is {atoms}, not from {fewest} to {most_atoms}")
        })?;
        must((fewest..=most_sh_parts).contains(&sh_parts), || {
            format!("'flags': P is {sh_parts}, not from {fewest} to {most_sh_parts}")
        })?;
        must(!with_axes || (dim > 0 && atoms >= dim), || {
            format!("'flags': 'fixed' needs at least {} atoms, and m is {atoms}", dim.max(1))
        })?;
        must(dc_exponent <= MAX_DC_EXPONENT, || {
            format!("'dc_exponent' is {dc_exponent}, above {MAX_DC_EXPONENT}")
        })?;
        let mut least: Vec<u32> = Vec::with_capacity(sh_parts);
        for _ in 1..sh_parts {
            least.push(from.take("least", ByteReader::u8)?.into());
        }
        least.extend((sh_parts > 0).then_some(1));
        must(least.is_sorted_by(|a, b| a > b), || format!("'least' is {least:?}, which does not fall to 1"))?;
        let interim =
            if interim {
                Some(from.take("interim_step", |from| {
                    Some([from.number32()?, from.number32()?, from.number32()?])
                })?)
            } else {
                None
            };
        for step in interim.iter().flatten() {
            must((1..=MOST_STEP).contains(step), || {
                format!("'interim_step' has {step}, not from 1 to {MOST_STEP}")
            })?;
        }
        let origin = from.take("origin", ByteReader::f32s)?;
        let cell = from.take("side", ByteReader::f32)?;
        let step = from.take("value_step", ByteReader::f32)?;
        // These messages name no value: code that writes floats would be 18 kB of the WebAssembly decoder.
        must(cell > 0.0, || "'side' is not above 0".to_owned())?;
        must(step > 0.0, || "'value_step' is not above 0".to_owned())?;
        let (value_step, promised) = if is_promised { (0.0, step) } else { (step, 0.0) };
        let dc_mean = from.take("dc_mean", ByteReader::f32s)?;
        let dc_turn: [i16; 4] = from.take("dc_turn", ByteReader::i16s)?;
        let dc_axes = axes_of(dc_turn).ok_or_else(|| BrokenHead("'dc_turn' is 0".to_owned()))?;
        let mut points_of_view = PointsOfView::default();
        if points > 0 {
            points_of_view.softening = from.take("softening", ByteReader::f32)?;
            must(SOFTENINGS.contains(&points_of_view.softening), || {
                "'softening' is not from 2^-60 to 2^60".to_owned()
            })?;
        }
        for _ in 0..points {
            points_of_view.points.push(from.take("points", ByteReader::f24s)?);
        }
        let mut integers = Integers::default();
        for step in &mut integers.steps {
            let mantissa = from.take("steps", ByteReader::u16)?;
            *step = Step { mantissa, shift: from.take("steps", ByteReader::u8)?.cast_signed() };
            must(Step::SHIFTS.contains(&step.shift), || {
                format!(
                    "'steps' has the shift {}, not from {} to {}",
                    step.shift,
                    Step::SHIFTS.start(),
                    Step::SHIFTS.end()
                )
            })?;
        }
        let mut block = |name: &str| {
            let length = from.take(name, ByteReader::number32)? as usize;
            from.take(name, |from| from.bytes(length))
        };
        integers.read(block("integers")?)?;
        let (tables, dictionary) = (block("tables")?.to_vec(), block("dictionary")?.to_vec());
        let mut head = Self {
            with_axes,
            dc_exponent,
            rest: RestForm { dim, atoms, least },
            interim,
            points_of_view,
            integers,
            dc_turn,
            frame: Frame { origin, cell, dc_mean, dc_axes, ..Frame::default() },
            value_step,
            promised,
            tables,
            dictionary,
            index: Index::default(),
        };
        head.index = Index::read(&mut from, head.rest.least.len(), interim.is_some())?;
        head.complete();
        let left = from.0.0.len();
        must(left == 0, || format!("{left} bytes follow the index"))?;
        Ok(head)
    }
}
