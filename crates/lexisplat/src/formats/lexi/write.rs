//! Writing .lexi files of every layout.

use std::collections::BTreeMap;

use safetensors::Dtype;

use super::layout::{CodeLayout, Layout};
use super::schema::{EXTRA_PREFIX, FORMAT, PACKED_VERSION, VERSION, key, tensor};
use super::spilled::SpilledModel;
use super::tensors::{Draft, Source, Tensor, preamble};
use crate::packed::{Packed, PackedHead, SpilledPacked};
use crate::scene::sh::ShDegree;
use crate::scene::splats::{Extra, ExtraValues, SceneMeta, for_extra};
use crate::sparse::codes::{Indices, Values};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Model, Pursuit, Record};
use crate::sparse::pursuit::ValueType;
use crate::support::error::Result;
use crate::support::limits::Limits;
use crate::support::progress::{Progress, Silent};
use crate::support::sink::Sink;

/// Writes `model` with [`CodeLayout::Compact`] codes. Returns the number of bytes.
///
/// # Errors
/// [`crate::Error::Io`] for the sink.
pub fn write<'a>(sink: impl Into<Sink<'a>>, model: &Model) -> Result<u64> {
    LexiWriter::exact(model, CodeLayout::Compact)?.write(sink, &Silent)
}

/// A .lexi file ready to be written. Its sizes are known.
#[derive(Debug)]
pub struct LexiWriter<'a> {
    draft: Draft<'a>,
    sizes: Vec<(String, u64)>,
}

impl<'a> LexiWriter<'a> {
    /// The exact file of `model`.
    ///
    /// # Errors
    /// [`crate::Error::Limit`] if the 32-bit pointers of [`CodeLayout::Paper`] cannot count the nonzeros.
    pub fn exact(model: &'a Model, codes: CodeLayout) -> Result<Self> {
        if codes == CodeLayout::Paper {
            check_pointers(model.codes().nonzeros() as u64)?;
        }
        let layout = Layout::of(codes, model.codes().values().value_type());
        let tensors = ExactTensors::of_model(model, codes).list(model.dictionary(), layout);
        Ok(Self::of_exact(layout, model.record(), model.meta(), model.degree(), tensors))
    }

    /// The file of `packed`.
    #[must_use]
    pub fn packed(packed: &'a Packed) -> Self {
        let extras = packed.extras().iter().map(|extra| extra_tensor(extra, packed.len(), bytes_of(extra)));
        let order = packed.order().map(Source::of);
        Self::of_packed(packed.head(), Source::Bytes(packed.data()), order, extras.collect())
    }

    /// The exact file of a scene that was spilled.
    pub(crate) fn spilled(
        spilled: SpilledModel,
        dictionary: &'a Dictionary,
        record: &Record,
        meta: &SceneMeta,
    ) -> Result<Self> {
        let layout = spilled.layout;
        let tensors = spilled.finish()?.list(dictionary, layout);
        Ok(Self::of_exact(layout, record, meta, dictionary.degree(), tensors))
    }

    /// The file of a packed scene that was spilled.
    pub(crate) fn spilled_packed(head: &'a PackedHead, spilled: SpilledPacked) -> Self {
        let n = head.gaussians;
        let extras = spilled.extras.into_iter();
        let extras = extras.map(|(extra, values)| extra_tensor(&extra, n, Source::Spilled(values)));
        let order = spilled.order.map(Source::Spilled);
        Self::of_packed(head, Source::Spilled(spilled.data), order, extras.collect())
    }

    fn of_exact(
        layout: Layout,
        record: &Record,
        meta: &SceneMeta,
        degree: ShDegree,
        tensors: Vec<Tensor<'a>>,
    ) -> Self {
        Self::new(scene_metadata(VERSION, layout, degree, record, meta), tensors)
    }

    fn of_packed(
        head: &'a PackedHead,
        data: Source<'a>,
        order: Option<Source<'a>>,
        extras: Vec<Tensor<'a>>,
    ) -> Self {
        let degree = head.degree;
        let mut metadata = scene_metadata(PACKED_VERSION, Layout::Packed, degree, &head.record, &head.meta);
        let mut put = |key: &str, value: String| metadata.insert(key.to_owned(), value);
        put(key::GAUSSIANS, head.gaussians.to_string());
        put(key::ATOMS, head.atoms.to_string());
        put(key::ATOM_BITS, head.atom_bits.to_string());
        if let Some(target) = &head.target {
            put(key::PROMISE, serde_json::to_string(target).unwrap_or_default());
        }
        if let Some(device) = &head.device {
            put(key::DRAWN_ON, device.clone());
        }
        let bytes = head.lengths.iter().map(|&l| l as usize).sum();
        let mut tensors = vec![
            Tensor::new(
                tensor::PARAMETERS,
                Dtype::F32,
                &[head.parameters.len()],
                Source::of(&head.parameters),
            ),
            Tensor::new(tensor::LENGTHS, Dtype::U32, &[head.lengths.len()], Source::of(&head.lengths)),
            Tensor::new(tensor::TABLES, Dtype::U8, &[head.tables.len()], Source::of(&head.tables)),
            Tensor::new(tensor::DATA, Dtype::U8, &[bytes], data),
        ];
        tensors.extend(order.map(|order| Tensor::new(tensor::ORDER, Dtype::U32, &[head.gaussians], order)));
        tensors.extend(extras);
        Self::new(metadata, tensors)
    }

    pub(super) fn new(metadata: BTreeMap<String, String>, tensors: Vec<Tensor<'a>>) -> Self {
        let mut sizes: Vec<_> = tensors.iter().map(|t| (t.name.clone(), t.bytes() as u64)).collect();
        let draft = Draft::new(metadata, tensors);
        sizes.push(("header".to_owned(), draft.header_bytes()));
        Self { draft, sizes }
    }

    /// Bytes of each tensor, and of the header under `header`. They sum to the size of the file.
    #[must_use]
    pub fn attribute_bytes(&self) -> &[(String, u64)] {
        &self.sizes
    }

    /// Bytes of the whole file.
    #[must_use]
    pub fn file_bytes(&self) -> u64 {
        self.sizes.iter().map(|s| s.1).sum()
    }

    /// Bytes that stand for SH-rest in an exact file: dictionary, codes and escapes.
    #[must_use]
    pub fn sh_bytes(&self) -> u64 {
        sh_bytes(&self.sizes)
    }

    /// Writes the file. Returns the number of bytes.
    ///
    /// # Errors
    /// [`crate::Error::Io`] for the sink, [`crate::Error::Cancelled`].
    pub fn write<'s>(self, sink: impl Into<Sink<'s>>, progress: &dyn Progress) -> Result<u64> {
        let bytes = self.file_bytes();
        sink.into().write(bytes, progress, |writer, named| self.draft.write_to(writer).map_err(named))
    }
}

/// Bytes of the tensors that stand for SH-rest in an exact file.
pub(crate) fn sh_bytes(attribute_bytes: &[(String, u64)]) -> u64 {
    let is_sh =
        |name: &str| name == tensor::DICTIONARY || name.starts_with("codes.") || name.starts_with("escapes.");
    attribute_bytes.iter().filter(|a| is_sh(&a.0)).map(|a| a.1).sum()
}

/// The metadata that all layouts share.
fn scene_metadata(
    version: u64,
    layout: Layout,
    degree: ShDegree,
    record: &Record,
    meta: &SceneMeta,
) -> BTreeMap<String, String> {
    let mut metadata = preamble(FORMAT, version);
    let mut put = |key: &str, value: String| metadata.insert(key.to_owned(), value);
    put(key::DEGREE, degree.to_string());
    put(key::LAYOUT, layout.to_string());
    // The key is mandatory. In packed files its value means nothing.
    put(key::PURSUIT, record.pursuit.unwrap_or(Pursuit::Omp).to_string());
    put(key::SEED, record.seed.to_string());
    put(key::MAX_RESIDUAL, record.max_residual.to_string());
    put(key::RMS_RESIDUAL, record.rms_residual.to_string());
    put(key::OVER_TOLERANCE, record.over_tolerance.to_string());
    put(key::ANTIALIASED, meta.antialiased.to_string());
    put(key::COMMENTS, serde_json::to_string(&meta.comments).unwrap_or_default());
    if let Some(tolerance) = record.tolerance {
        put(key::TOLERANCE, tolerance.to_string());
    }
    if let Some(cap) = record.max_nonzeros {
        put(key::MAX_NONZEROS, cap.to_string());
    }
    metadata
}

/// The bytes of every array of an exact file.
pub(super) struct ExactTensors<'a> {
    pub(super) gaussians: usize,
    pub(super) nonzeros: usize,
    pub(super) escapes: usize,
    pub(super) position: Source<'a>,
    pub(super) dc: Source<'a>,
    pub(super) opacity: Source<'a>,
    pub(super) scale: Source<'a>,
    pub(super) rotation: Source<'a>,
    pub(super) normal: Option<Source<'a>>,
    pub(super) extras: Vec<Tensor<'a>>,
    /// Counts, or the pointers of layout `paper`.
    pub(super) counts: Source<'a>,
    pub(super) indices: Source<'a>,
    pub(super) values: Source<'a>,
    pub(super) escaped: Source<'a>,
    pub(super) escape_rows: Source<'a>,
}

impl<'a> ExactTensors<'a> {
    fn of_model(model: &'a Model, layout: CodeLayout) -> Self {
        let (g, codes) = (model.geometry(), model.codes());
        let (counts, indices, values) = match layout {
            CodeLayout::Compact => (
                Source::of(codes.counts()),
                match codes.indices() {
                    Indices::U8(v) => Source::of(v),
                    Indices::U16(v) => Source::of(v),
                },
                match codes.values() {
                    Values::F16(v) => Source::of(as_bits(v)),
                    Values::F32(v) => Source::of(v),
                },
            ),
            CodeLayout::Paper => (
                Source::words(move || std::iter::once(0).chain(paper_pointers(codes.counts(), 0))),
                Source::words(move || paper_indices(codes.indices())),
                Source::words(move || paper_values(codes.values())),
            ),
        };
        Self {
            gaussians: model.len(),
            nonzeros: codes.nonzeros(),
            escapes: codes.escapes().gaussians.len(),
            position: Source::of(&g.positions),
            dc: Source::of(&g.dc),
            opacity: Source::of(&g.opacities),
            scale: Source::of(&g.scales),
            rotation: Source::of(&g.rotations),
            normal: (!g.normals.is_empty()).then(|| Source::of(&g.normals)),
            extras: g.extras.iter().map(|extra| extra_tensor(extra, model.len(), bytes_of(extra))).collect(),
            counts,
            indices,
            values,
            escaped: Source::of(&codes.escapes().gaussians),
            escape_rows: Source::of(&codes.escapes().rows),
        }
    }

    /// The tensors in the order in which sizes are listed.
    fn list(self, dictionary: &'a Dictionary, layout: Layout) -> Vec<Tensor<'a>> {
        let (n, nonzeros) = (self.gaussians, self.nonzeros);
        let mut out = vec![
            Tensor::new(tensor::POSITION, Dtype::F32, &[n, 3], self.position),
            Tensor::new(tensor::DC, Dtype::F32, &[n, 3], self.dc),
            Tensor::new(tensor::OPACITY, Dtype::F32, &[n], self.opacity),
            Tensor::new(tensor::SCALE, Dtype::F32, &[n, 3], self.scale),
            Tensor::new(tensor::ROTATION, Dtype::F32, &[n, 4], self.rotation),
        ];
        out.extend(self.normal.map(|normal| Tensor::new(tensor::NORMAL, Dtype::F32, &[n, 3], normal)));
        out.extend(self.extras);
        let dim = dictionary.dim();
        if dim == 0 {
            return out;
        }
        let shape = [dictionary.len(), dim];
        out.push(Tensor::new(tensor::DICTIONARY, Dtype::F32, &shape, Source::of(dictionary.as_slice())));
        let value = if layout.values() == ValueType::F16 { Dtype::F16 } else { Dtype::F32 };
        out.push(Tensor::new(tensor::VALUES, value, &[nonzeros], self.values));
        if layout == Layout::Paper {
            out.push(Tensor::new(tensor::POINTERS, Dtype::I32, &[n + 1], self.counts));
            out.push(Tensor::new(tensor::INDICES, Dtype::I32, &[nonzeros], self.indices));
        } else {
            let small = matches!(Indices::for_atoms(dictionary.len()), Indices::U8(_));
            let index = if small { Dtype::U8 } else { Dtype::U16 };
            out.push(Tensor::new(tensor::INDICES, index, &[nonzeros], self.indices));
            out.push(Tensor::new(tensor::COUNTS, Dtype::U8, &[n], self.counts));
        }
        if self.escapes > 0 {
            out.push(Tensor::new(tensor::ESCAPED, Dtype::U32, &[self.escapes], self.escaped));
            out.push(Tensor::new(tensor::ESCAPE_ROWS, Dtype::F32, &[self.escapes, dim], self.escape_rows));
        }
        out
    }
}

/// The tensor of a property that 3DGS does not define.
pub(super) fn extra_tensor<'a>(extra: &Extra, n: usize, source: Source<'a>) -> Tensor<'a> {
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
    Tensor::new(&format!("{EXTRA_PREFIX}{}", extra.name), dtype, &[n], source)
}

fn bytes_of(extra: &Extra) -> Source<'_> {
    for_extra!(&extra.values, v => Source::of(v))
}

/// Where the codes of each Gaussian end, if `before` nonzeros come before them. The caller has checked that
/// an i32 can count them.
pub(super) fn paper_pointers(counts: &[u8], before: i32) -> impl Iterator<Item = u32> + '_ {
    counts.iter().scan(before, |end, &count| {
        *end = end.wrapping_add(i32::from(count));
        Some(end.cast_unsigned())
    })
}

/// Indices as i32.
pub(super) fn paper_indices(indices: &Indices) -> impl Iterator<Item = u32> + '_ {
    (0..indices.len()).map(|k| match indices {
        Indices::U8(v) => u32::from(v[k]),
        Indices::U16(v) => u32::from(v[k]),
    })
}

/// The bits of values as f32.
pub(super) fn paper_values(values: &Values) -> impl Iterator<Item = u32> + '_ {
    (0..values.len()).map(|k| values.get(k).to_bits())
}

/// The bits of half floats, which `bytemuck` knows as integers.
pub(super) fn as_bits(values: &[half::f16]) -> &[u16] {
    use half::slice::HalfFloatSliceExt;
    values.reinterpret_cast()
}

/// Refuses more nonzeros than the pointers of layout `paper` count.
pub(super) fn check_pointers(nonzeros: u64) -> Result<()> {
    let largest = i32::MAX.unsigned_abs().into();
    Limits::check("nonzeros in layout 'paper', whose pointers are i32", nonzeros, largest)
}
