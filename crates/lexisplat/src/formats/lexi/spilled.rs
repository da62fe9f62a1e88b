//! An exact file made part after part: its arrays are spilled until all sizes are known.

use super::layout::{CodeLayout, Layout};
use super::tensors::Source;
use super::write::{
    ExactTensors, as_bits, check_pointers, extra_tensor, paper_indices, paper_pointers, paper_values,
};
use crate::scene::source::SplatSource;
use crate::scene::spilled::SpilledExtras;
use crate::scene::splats::Geometry;
use crate::sparse::codes::{Indices, Values};
use crate::sparse::compress::Coded;
use crate::sparse::pursuit::ValueType;
use crate::support::error::{Error, Result};
use crate::support::spill::{Spill, SpillTo};

/// Spilled geometry and codes.
#[derive(Debug)]
pub(crate) struct SpilledModel {
    pub(super) layout: Layout,
    gaussians: usize,
    nonzeros: u64,
    escapes: usize,
    position: Spill,
    dc: Spill,
    opacity: Spill,
    scale: Spill,
    rotation: Spill,
    normal: Option<Spill>,
    extras: SpilledExtras,
    /// Counts, or the pointers of layout `paper`.
    counts: Spill,
    indices: Spill,
    values: Spill,
    escaped: Spill,
    escape_rows: Spill,
}

impl SpilledModel {
    /// An empty one for the Gaussians of `source` and codes with `values`.
    pub(crate) fn new(
        to: SpillTo<'_>,
        source: &dyn SplatSource,
        codes: CodeLayout,
        values: ValueType,
    ) -> Result<Self> {
        let spill = || Spill::new(to);
        let mut counts = spill()?;
        if codes == CodeLayout::Paper {
            counts.push(&[0_i32])?;
        }
        Ok(Self {
            layout: Layout::of(codes, values),
            gaussians: 0,
            nonzeros: 0,
            escapes: 0,
            position: spill()?,
            dc: spill()?,
            opacity: spill()?,
            scale: spill()?,
            rotation: spill()?,
            normal: if source.has_normals() { Some(spill()?) } else { None },
            extras: SpilledExtras::new(to, source.empty().geometry)?,
            counts,
            indices: spill()?,
            values: spill()?,
            escaped: spill()?,
            escape_rows: spill()?,
        })
    }

    /// Appends the next Gaussians and their codes.
    pub(crate) fn push(&mut self, geometry: &Geometry, coded: &Coded) -> Result<()> {
        self.gaussians += geometry.len();
        self.position.push(&geometry.positions)?;
        self.dc.push(&geometry.dc)?;
        self.opacity.push(&geometry.opacities)?;
        self.scale.push(&geometry.scales)?;
        self.rotation.push(&geometry.rotations)?;
        if let Some(normal) = &mut self.normal {
            normal.push(&geometry.normals)?;
        }
        self.extras.push(geometry)?;
        self.push_codes(coded)
    }

    fn push_codes(&mut self, coded: &Coded) -> Result<()> {
        let before = self.nonzeros;
        self.nonzeros += coded.indices.len() as u64;
        self.escapes += coded.escapes.gaussians.len();
        self.escaped.push(&coded.escapes.gaussians)?;
        self.escape_rows.push(&coded.escapes.rows)?;
        if self.layout == Layout::Paper {
            check_pointers(self.nonzeros)?;
            let before = i32::try_from(before).unwrap_or(i32::MAX);
            self.counts.push(&paper_pointers(&coded.counts, before).collect::<Vec<u32>>())?;
            self.indices.push(&paper_indices(&coded.indices).collect::<Vec<u32>>())?;
            return self.values.push(&paper_values(&coded.values).collect::<Vec<u32>>());
        }
        match &coded.indices {
            Indices::U8(v) => self.indices.push(v)?,
            Indices::U16(v) => self.indices.push(v)?,
        }
        match &coded.values {
            Values::F16(v) => self.values.push(as_bits(v))?,
            Values::F32(v) => self.values.push(v)?,
        }
        self.counts.push(&coded.counts)
    }

    /// All arrays, to be written.
    pub(super) fn finish<'a>(self) -> Result<ExactTensors<'a>> {
        let n = self.gaussians;
        let source = |spill: Spill| spill.finish().map(Source::Spilled);
        let extras = self.extras.finish()?.into_iter();
        Ok(ExactTensors {
            gaussians: n,
            nonzeros: usize::try_from(self.nonzeros)
                .map_err(|_| Error::parameter("codes", self.nonzeros, "as many nonzeros as memory counts"))?,
            escapes: self.escapes,
            position: source(self.position)?,
            dc: source(self.dc)?,
            opacity: source(self.opacity)?,
            scale: source(self.scale)?,
            rotation: source(self.rotation)?,
            normal: self.normal.map(source).transpose()?,
            extras: extras.map(|(extra, v)| extra_tensor(&extra, n, Source::Spilled(v))).collect(),
            counts: source(self.counts)?,
            indices: source(self.indices)?,
            values: source(self.values)?,
            escaped: source(self.escaped)?,
            escape_rows: source(self.escape_rows)?,
        })
    }
}
