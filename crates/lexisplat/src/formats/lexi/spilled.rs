//! An exact file that is made part after part. Its arrays are spilled until all sizes are known.

use super::exact_tensors::{
    ExactTensors, check_pointers, extra_tensor, geometry_tensors, paper_indices, paper_pointers, paper_values,
};
use super::layout::{CodeLayout, Layout};
use super::schema::GEOMETRY;
use super::tensors::Source;
use crate::scene::source::SplatSource;
use crate::scene::spilled::SpilledExtras;
use crate::scene::splats::Geometry;
use crate::sparse::codes::ValueType;
use crate::sparse::compress::Coded;
use crate::support::error::{Error, Result};
use crate::support::spill::{Spill, SpillTo};

/// Spilled geometry and codes.
#[derive(Debug)]
pub(crate) struct SpilledModel {
    pub(super) layout: Layout,
    gaussians: usize,
    nonzeros: u64,
    escapes: usize,
    /// The arrays of [`GEOMETRY`], without the normals if there are none.
    geometry: Vec<Spill>,
    extras: SpilledExtras,
    /// The counts, or the pointers of layout `paper`.
    counts: Spill,
    indices: Spill,
    values: Spill,
    escaped: Spill,
    escape_rows: Spill,
}

impl SpilledModel {
    /// Creates empty arrays for the Gaussians of `source` and codes with `values`.
    pub(crate) fn new(
        to: SpillTo<'_>,
        source: &dyn SplatSource,
        codes: CodeLayout,
        values: ValueType,
    ) -> Result<Self> {
        let spill = || Spill::new(to);
        let arrays = if source.has_normals() { GEOMETRY.len() } else { GEOMETRY.len() - 1 };
        let mut counts = spill()?;
        if codes == CodeLayout::Paper {
            counts.push(&[0_i32])?;
        }
        Ok(Self {
            layout: Layout::of(codes, values),
            gaussians: 0,
            nonzeros: 0,
            escapes: 0,
            geometry: (0..arrays).map(|_| spill()).collect::<Result<_>>()?,
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
        for (spill, values) in self.geometry.iter_mut().zip(geometry.floats()) {
            spill.push(values)?;
        }
        self.extras.push(&geometry.extras)?;
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
        self.indices.push(coded.indices.as_bytes())?;
        self.values.push(coded.values.as_bytes())?;
        self.counts.push(&coded.counts)
    }

    /// Returns all arrays, which are then written.
    pub(super) fn finish<'a>(self) -> Result<ExactTensors<'a>> {
        let n = self.gaussians;
        let source = |spill: Spill| spill.finish().map(Source::Spilled);
        let arrays = self.geometry.into_iter().map(source).collect::<Result<Vec<_>>>()?;
        let mut geometry: Vec<_> = geometry_tensors(n, arrays).collect();
        let extras = self.extras.finish()?.into_iter();
        geometry.extend(extras.map(|(extra, values)| extra_tensor(&extra, n, Source::Spilled(values))));
        Ok(ExactTensors {
            geometry,
            gaussians: n,
            nonzeros: usize::try_from(self.nonzeros)
                .map_err(|_| Error::parameter("codes", self.nonzeros, "as many nonzeros as memory counts"))?,
            escapes: self.escapes,
            counts: source(self.counts)?,
            indices: source(self.indices)?,
            values: source(self.values)?,
            escaped: source(self.escaped)?,
            escape_rows: source(self.escape_rows)?,
        })
    }
}
