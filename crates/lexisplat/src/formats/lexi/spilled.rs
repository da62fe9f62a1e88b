//! The file of an exact layout made part after part: its tensors are set aside until all sizes are known.

use std::collections::BTreeMap;

use safetensors::Dtype;

use super::schema::{EXTRA_PREFIX, FORMAT, VERSION, tensor};
use super::tensors::{Draft, Tensor, preamble};
use super::write::put_record;
use crate::scene::splats::{ExtraValues, Geometry, SceneMeta, Splats, for_extra};
use crate::sparse::codes::{Indices, Values};
use crate::sparse::compress::Coded;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Layout, Record};
use crate::support::error::{Error, Result};
use crate::support::limits::Limits;
use crate::support::progress::Progress;
use crate::support::sink::Sink;
use crate::support::spill::{Spill, SpillTo};

/// Geometry and codes set aside; byte for byte what [`write`](super::write()) makes of the whole model.
#[derive(Debug)]
pub(crate) struct SpilledModel {
    layout: Layout,
    gaussians: usize,
    nonzeros: u64,
    escapes: usize,
    position: Spill,
    dc: Spill,
    opacity: Spill,
    scale: Spill,
    rotation: Spill,
    normal: Option<Spill>,
    extras: Extras,
    /// Counts, or pointers in layout `paper`.
    counts: Spill,
    indices: Spill,
    values: Spill,
    escaped: Spill,
    escape_rows: Spill,
}

impl SpilledModel {
    /// Nothing yet of a scene that is like `splats`.
    pub(crate) fn new(to: SpillTo<'_>, splats: &Splats, normals: bool, layout: Layout) -> Result<Self> {
        let spill = || Spill::new(to);
        let mut counts = spill()?;
        if layout == Layout::Paper {
            counts.push(&[0_i32])?;
        }
        Ok(Self {
            layout,
            gaussians: 0,
            nonzeros: 0,
            escapes: 0,
            position: spill()?,
            dc: spill()?,
            opacity: spill()?,
            scale: spill()?,
            rotation: spill()?,
            normal: if normals { Some(spill()?) } else { None },
            extras: Extras::new(to, &splats.geometry)?,
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
        match &coded.values {
            Values::F16(v) => self.values.push(super::write::as_bits(v))?,
            Values::F32(v) => self.values.push(v)?,
        }
        self.escaped.push(&coded.escapes.gaussians)?;
        self.escape_rows.push(&coded.escapes.rows)?;
        if self.layout != Layout::Paper {
            match &coded.indices {
                Indices::U8(v) => self.indices.push(v)?,
                Indices::U16(v) => self.indices.push(v)?,
            }
            return self.counts.push(&coded.counts);
        }
        check_pointers(self.nonzeros)?;
        let mut end = i32::try_from(before).unwrap_or(i32::MAX);
        let pointers = coded.counts.iter().map(|&count| {
            end += i32::from(count);
            end
        });
        self.counts.push(&pointers.collect::<Vec<i32>>())?;
        let indices: Vec<i32> = match &coded.indices {
            Indices::U8(v) => v.iter().map(|&i| i32::from(i)).collect(),
            Indices::U16(v) => v.iter().map(|&i| i32::from(i)).collect(),
        };
        self.indices.push(&indices)
    }

    /// Writes the file. Returns the bytes of each tensor and of the header, as
    /// [`attribute_bytes`](super::attribute_bytes).
    pub(crate) fn finish(
        self,
        dictionary: &Dictionary,
        record: &Record,
        meta: &SceneMeta,
        sink: Sink<'_>,
        progress: &dyn Progress,
    ) -> Result<Vec<(String, u64)>> {
        let mut metadata = preamble(FORMAT, VERSION);
        put_record(&mut metadata, dictionary.degree(), record, meta);
        let tensors = self.tensors(dictionary)?;
        write_tensors(metadata, tensors, sink, progress)
    }

    fn tensors(self, dictionary: &Dictionary) -> Result<Vec<Tensor<'_>>> {
        let n = self.gaussians;
        let f32s = |name: &str, shape: &[usize], spill: Spill| -> Result<Tensor<'_>> {
            Ok(Tensor::spilled(name, Dtype::F32, shape, spill.finish()?))
        };
        let mut out = vec![
            f32s(tensor::POSITION, &[n, 3], self.position)?,
            f32s(tensor::DC, &[n, 3], self.dc)?,
            f32s(tensor::OPACITY, &[n], self.opacity)?,
            f32s(tensor::SCALE, &[n, 3], self.scale)?,
            f32s(tensor::ROTATION, &[n, 4], self.rotation)?,
        ];
        if let Some(normal) = self.normal {
            out.push(f32s(tensor::NORMAL, &[n, 3], normal)?);
        }
        out.extend(self.extras.tensors(n)?);
        let dim = dictionary.dim();
        if dim == 0 {
            return Ok(out);
        }
        let shape = [dictionary.len(), dim];
        out.push(Tensor::plain(tensor::DICTIONARY, Dtype::F32, &shape, dictionary.as_slice()));
        let nonzeros = usize::try_from(self.nonzeros)
            .map_err(|_| Error::parameter("codes", self.nonzeros, "as many nonzeros as memory counts"))?;
        let half = self.layout == Layout::F16;
        let value = if half { Dtype::F16 } else { Dtype::F32 };
        out.push(Tensor::spilled(tensor::VALUES, value, &[nonzeros], self.values.finish()?));
        let (counts, indices) = (self.counts.finish()?, self.indices.finish()?);
        if self.layout == Layout::Paper {
            out.push(Tensor::spilled(tensor::POINTERS, Dtype::I32, &[n + 1], counts));
            out.push(Tensor::spilled(tensor::INDICES, Dtype::I32, &[nonzeros], indices));
        } else {
            let small = matches!(Indices::for_atoms(dictionary.len()), Indices::U8(_));
            let index = if small { Dtype::U8 } else { Dtype::U16 };
            out.push(Tensor::spilled(tensor::INDICES, index, &[nonzeros], indices));
            out.push(Tensor::spilled(tensor::COUNTS, Dtype::U8, &[n], counts));
        }
        if self.escapes > 0 {
            let escaped = self.escaped.finish()?;
            out.push(Tensor::spilled(tensor::ESCAPED, Dtype::U32, &[self.escapes], escaped));
            out.push(f32s(tensor::ESCAPE_ROWS, &[self.escapes, dim], self.escape_rows)?);
        }
        Ok(out)
    }
}

/// Writes a file. Returns the bytes of each tensor and of the header.
pub(super) fn write_tensors(
    metadata: BTreeMap<String, String>,
    tensors: Vec<Tensor<'_>>,
    sink: Sink<'_>,
    progress: &dyn Progress,
) -> Result<Vec<(String, u64)>> {
    let mut sizes: Vec<(String, u64)> = tensors.iter().map(|t| (t.name.clone(), t.bytes() as u64)).collect();
    let draft = Draft::new(metadata, tensors);
    sizes.push(("header".to_owned(), draft.header_bytes()));
    draft.save(sink, progress)?;
    Ok(sizes)
}

/// Properties 3DGS does not define, set aside.
#[derive(Debug)]
pub(crate) struct Extras(Vec<(String, Dtype, Spill)>);

impl Extras {
    /// None yet of a scene with those of `like`.
    pub(crate) fn new(to: SpillTo<'_>, like: &Geometry) -> Result<Self> {
        let extra = |extra: &crate::scene::splats::Extra| {
            let dtype = match extra.values {
                ExtraValues::I8(_) => Dtype::I8,
                ExtraValues::U8(_) => Dtype::U8,
                ExtraValues::I16(_) => Dtype::I16,
                ExtraValues::U16(_) => Dtype::U16,
                ExtraValues::I32(_) => Dtype::I32,
                ExtraValues::U32(_) => Dtype::U32,
                ExtraValues::F32(_) => Dtype::F32,
                ExtraValues::F64(_) => Dtype::F64,
            };
            Ok((format!("{EXTRA_PREFIX}{}", extra.name), dtype, Spill::new(to)?))
        };
        like.extras.iter().map(extra).collect::<Result<_>>().map(Self)
    }

    /// Appends those of the next Gaussians.
    pub(crate) fn push(&mut self, geometry: &Geometry) -> Result<()> {
        for (extra, (_, _, spill)) in geometry.extras.iter().zip(&mut self.0) {
            for_extra!(&extra.values, v => spill.push(v)?);
        }
        Ok(())
    }

    /// Those of all `n` Gaussians.
    pub(super) fn tensors(self, n: usize) -> Result<Vec<Tensor<'static>>> {
        let tensor = |(name, dtype, spill): (String, Dtype, Spill)| {
            Ok(Tensor::spilled(&name, dtype, &[n], spill.finish()?))
        };
        self.0.into_iter().map(tensor).collect()
    }
}

/// Refuses more nonzeros than the pointers of layout `paper` count.
pub(super) fn check_pointers(nonzeros: u64) -> Result<()> {
    let largest = i32::MAX.unsigned_abs().into();
    Limits::check("nonzeros in layout 'paper', whose pointers are i32", nonzeros, largest)
}
