//! The Gaussians of a part, as the processor reads them.

use half::f16;
use lexisplat::sh::CHANNELS;
use lexisplat::{Escapes, Geometry, Indices, ShDegree, SparseCodes, Values};

use crate::error::{Error, Result};
use crate::radiance::{Atoms, Radiance};

use super::constants::{COLUMN_GROUP, COLUMN_WORDS, ESCAPED};
use super::form::SceneForm;
use super::part::{ScenePart, word, words};
use super::part_layout::{Section, ShKind};
use super::part_sample::{BODY, SHAPE, rows};
use crate::gpu_report::SceneBytes;

/// Number of bytes of the place and the counts of a group of Gaussians.
const GROUP_BYTES: usize = 4 * COLUMN_WORDS as usize;

/// The Gaussians of a part.
#[derive(Debug)]
pub(crate) struct PartGaussians {
    /// A Gaussian that is never drawn has an opacity of 0.
    pub(crate) geometry: Geometry,
    pub(crate) rest: PartRest,
}

/// The SH-rest of a part.
#[derive(Debug)]
pub(crate) enum PartRest {
    /// Channel-major rows.
    Dense(Vec<f32>),
    Codes(SparseCodes),
}

impl PartGaussians {
    /// Returns the colours, where the scene has SH of `degree`. `atoms` are those of the form of the scene.
    pub(crate) fn radiance<'a>(&'a self, degree: ShDegree, atoms: &'a Atoms) -> Radiance<'a> {
        let dc = &self.geometry.dc;
        match &self.rest {
            PartRest::Dense(rest) => Radiance::of_rows(degree, dc, rest),
            PartRest::Codes(codes) => Radiance::of_codes(degree, dc, codes, atoms),
        }
    }

    /// Returns the numbers of bytes in memory.
    pub(crate) fn bytes(&self) -> SceneBytes {
        let Geometry { positions, scales, opacities, rotations, dc, .. } = &self.geometry;
        let shapes = size_of_val(positions.as_slice()) + size_of_val(scales.as_slice());
        let geometry = shapes + size_of_val(opacities.as_slice()) + size_of_val(rotations.as_slice());
        let rest = match &self.rest {
            PartRest::Dense(rest) => size_of_val(rest.as_slice()),
            PartRest::Codes(codes) => codes.resident_bytes(),
        };
        SceneBytes { geometry: geometry as u64, sh: (size_of_val(dc.as_slice()) + rest) as u64 }
    }
}

impl ScenePart<'_> {
    /// Returns the Gaussians, whose values are those that the part was made of.
    ///
    /// # Errors
    /// [`Error::Parameter`] if the part does not have the form of the scene, or has SH in 16 bits; [`Error::Codec`] for
    /// codes that a scene cannot have.
    pub(crate) fn gaussians(&self, form: &SceneForm) -> Result<PartGaussians> {
        let layout = self.outline.layout;
        if layout != form.layout {
            return Err(Error::parameter("part", format!("{layout:?}"), format!("{:?}", form.layout)));
        }
        let mut geometry = self.bodies();
        let rest = match layout.kind {
            ShKind::Dense { half: true } => {
                return Err(Error::parameter("part", format!("{layout:?}"), "SH in 32 bits"));
            }
            ShKind::Dense { half: false } => PartRest::Dense(self.dense_rows(&mut geometry)),
            ShKind::Codes { index, value, .. } => {
                geometry.dc = rows(self.section(Section::Colours)).collect();
                PartRest::Codes(self.codes(form, index, value)?)
            }
        };
        Ok(PartGaussians { geometry, rest })
    }

    /// Returns everything but colours.
    fn bodies(&self) -> Geometry {
        let mut geometry = Geometry::default();
        let bodies = rows::<BODY>(self.section(Section::Bodies));
        let shapes = rows::<SHAPE>(self.section(Section::Shapes));
        for ([x, y, z, largest], [a, b, c, opacity, rotation @ ..]) in bodies.zip(shapes) {
            geometry.positions.push([x, y, z]);
            geometry.scales.push([a, b, c]);
            geometry.opacities.push(if largest < 0.0 { f32::NEG_INFINITY } else { opacity });
            geometry.rotations.push(rotation);
        }
        geometry
    }

    /// Adds the base colours to `geometry`, and returns the rows of SH-rest.
    fn dense_rows(&self, geometry: &mut Geometry) -> Vec<f32> {
        let layout = self.outline.layout;
        let (dim, row) = (layout.degree.rest(), usize::try_from(layout.colour_bytes()).unwrap_or(usize::MAX));
        let mut rest = Vec::with_capacity(dim * self.len() as usize);
        for row in self.section(Section::Colours).chunks_exact(row) {
            let mut dc = [0.0; CHANNELS];
            dc.iter_mut().zip(floats(row)).for_each(|(to, from)| *to = from);
            geometry.dc.push(dc);
            channel_major(row.get(4 * CHANNELS..).unwrap_or_default(), dim, &mut rest);
        }
        rest
    }

    fn codes(&self, form: &SceneForm, index: u32, value: u32) -> Result<SparseCodes> {
        let (mut counts, mut numbers, mut values) = (Vec::new(), Vec::new(), Vec::new());
        let nonzeros = self.section(Section::Nonzeros);
        for group in self.section(Section::Columns).chunks_exact(GROUP_BYTES) {
            let first = counts.len();
            // Escapes have no nonzeros. The last group is filled up with zeros.
            let own = group[4..].iter().map(|&count| if u32::from(count) == ESCAPED { 0 } else { count });
            counts.extend(own.take((self.len() as usize - first).min(COLUMN_GROUP as usize)));
            let total: usize = counts[first..].iter().map(|&count| usize::from(count)).sum();
            let at = 4 * word(group).unwrap_or(u32::MAX) as usize;
            let own = nonzeros.get(at..).unwrap_or_default();
            let first_value = (total * index as usize).next_multiple_of(4);
            numbers.extend_from_slice(own.get(..total * index as usize).unwrap_or_default());
            let own = own.get(first_value..first_value + total * value as usize);
            values.extend_from_slice(own.unwrap_or_default());
        }
        let pairs = |bytes: &[u8]| {
            bytes.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b)).collect::<Vec<_>>()
        };
        let indices = if index == 1 { Indices::U8(numbers) } else { Indices::U16(pairs(&numbers)) };
        let values = match value {
            2 => Values::F16(pairs(&values).into_iter().map(f16::from_bits).collect()),
            _ => Values::F32(floats(&values).collect()),
        };
        let dim = self.outline.layout.degree.rest();
        let mut escapes =
            Escapes { gaussians: words(self.section(Section::Escaped)).collect(), rows: Vec::new() };
        for row in self.section(Section::Exact).chunks_exact(4 * dim.max(1)) {
            channel_major(row, dim, &mut escapes.rows);
        }
        Ok(SparseCodes::new(&form.dictionary, counts, indices, values, escapes)?)
    }
}

fn floats(bytes: &[u8]) -> impl Iterator<Item = f32> + '_ {
    words(bytes).map(f32::from_bits)
}

/// Appends `dim` numbers to `out`, channel by channel. In `row` the channels of each coefficient are side by side.
fn channel_major(row: &[u8], dim: usize, out: &mut Vec<f32>) {
    for channel in 0..CHANNELS {
        out.extend(floats(row).take(dim).skip(channel).step_by(CHANNELS));
    }
}
