//! Writing of .lexi files of every layout.

use safetensors::Dtype;

use super::exact_tensors::{ExactTensors, check_pointers};
use super::extra_column::ColumnEncoder;
use super::layout::{CodeLayout, Layout};
use super::schema::{EXTRA_PREFIX, FORMAT, PACKED_VERSION, VERSION, key, tensor};
#[cfg(feature = "encode")]
use super::spilled::SpilledModel;
use super::tensors::{Draft, Metadata, Source, Tensor, json, preamble};
#[cfg(feature = "encode")]
use crate::packed::SpilledPacked;
use crate::packed::{Packed, PackedHead};
use crate::scene::extra::{Extra, ExtraValues, ScalarType, with_scalar};
use crate::scene::sh::ShDegree;
use crate::scene::splats::SceneMeta;
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::{Model, Pursuit, Record};
use crate::support::error::Result;
use crate::support::progress::{Progress, Silent};
use crate::support::sink::Sink;
use crate::support::spill::Spilled;

/// Writes `model` with [`CodeLayout::Compact`] codes. Returns the number of bytes.
///
/// # Errors
/// [`crate::Error::Io`] for the sink.
pub fn write<'a>(sink: impl Into<Sink<'a>>, model: &Model) -> Result<u64> {
    LexiWriter::exact(model, CodeLayout::Compact)?.write(sink, &Silent)
}

/// A .lexi file whose sizes are known, and which is not written yet.
#[derive(Debug)]
pub struct LexiWriter<'a> {
    draft: Draft<'a>,
    sizes: Vec<(String, u64)>,
}

impl<'a> LexiWriter<'a> {
    /// Creates the exact file of `model`.
    ///
    /// # Errors
    /// [`crate::Error::Limit`] if the 32-bit pointers of [`CodeLayout::Paper`] cannot count the nonzeros.
    pub fn exact(model: &'a Model, codes: CodeLayout) -> Result<Self> {
        if codes == CodeLayout::Paper {
            check_pointers(model.codes().nonzeros() as u64)?;
        }
        let layout = Layout::of(codes, model.codes().values().value_type());
        let tensors = ExactTensors::of_model(model, codes).list(model.dictionary(), layout);
        let metadata = scene_metadata(layout, model.degree(), model.record(), model.meta());
        Ok(Self::new(metadata, tensors))
    }

    /// Creates the file of `packed`.
    #[must_use]
    pub fn packed(packed: &'a Packed) -> Self {
        let head = packed.head();
        let data = Source::Bytes(packed.data());
        let order = packed.order().map(|order| coded(&ExtraValues::U32(order.to_vec())));
        let extras = packed.extras().iter().map(|extra| (extra.name.as_str(), coded(&extra.values)));
        Self::of_columns(head, packed.data().len(), data, order, extras.collect())
    }

    /// Creates the exact file of a scene that was spilled.
    #[cfg(feature = "encode")]
    pub(crate) fn spilled(
        spilled: SpilledModel,
        dictionary: &'a Dictionary,
        record: &Record,
        meta: &SceneMeta,
    ) -> Result<Self> {
        let layout = spilled.layout;
        let tensors = spilled.finish()?.list(dictionary, layout);
        Ok(Self::new(scene_metadata(layout, dictionary.degree(), record, meta), tensors))
    }

    /// Creates the file of a packed scene that was spilled.
    ///
    /// # Errors
    /// [`crate::Error::Io`] for temporary files.
    #[cfg(feature = "encode")]
    pub(crate) fn spilled_packed(head: &'a PackedHead, spilled: SpilledPacked) -> Result<Self> {
        let SpilledPacked { data, order, extras } = spilled;
        let data_bytes = data.len();
        let order = order.map(|layers| coded_layers(ScalarType::U32, layers)).transpose()?;
        let column = |(extra, layers): (Extra, Vec<(usize, Spilled)>)| {
            Ok((extra.name, coded_layers(extra.values.scalar_type(), layers)?))
        };
        let extras = extras.into_iter().map(column).collect::<Result<Vec<(String, Vec<u8>)>>>()?;
        let extras = extras.iter().map(|(name, column)| (name.as_str(), column.clone())).collect();
        Ok(Self::of_columns(head, data_bytes, Source::Woven(data), order, extras))
    }

    /// Creates the file of a packed scene. `order` and the values of `extras` are coded columns.
    fn of_columns(
        head: &'a PackedHead,
        data_bytes: usize,
        data: Source<'a>,
        order: Option<Vec<u8>>,
        extras: Vec<(&str, Vec<u8>)>,
    ) -> Self {
        let mut metadata = preamble(FORMAT, PACKED_VERSION);
        metadata.remove(key::GENERATOR);
        let Record { seed, max_residual, rms_residual, over_tolerance, tolerance, .. } = &head.record;
        metadata.extend([(key::DEGREE, head.degree.to_string())]);
        // A missing key stands for an empty list, zero or false.
        for (key, residual) in [(key::MAX_RESIDUAL, max_residual), (key::RMS_RESIDUAL, rms_residual)] {
            metadata.extend((*residual != 0.0).then(|| (key, residual.to_string())));
        }
        metadata.extend((*seed != 0).then(|| (key::SEED, seed.to_string())));
        metadata.extend((*over_tolerance != 0).then(|| (key::OVER_TOLERANCE, over_tolerance.to_string())));
        metadata.extend(head.meta.antialiased.then(|| (key::ANTIALIASED, "true".to_owned())));
        metadata.extend((!head.meta.comments.is_empty()).then(|| (key::COMMENTS, json(&head.meta.comments))));
        metadata.extend(head.meta.offset.map(|offset| (key::OFFSET, json(&offset))));
        metadata.extend(view(&head.meta));
        metadata.extend(tolerance.map(|tolerance| (key::TOLERANCE, tolerance.to_string())));
        metadata.extend([(key::GAUSSIANS, head.gaussians.to_string())]);
        metadata.extend((head.removed > 0).then(|| (key::REMOVED, head.removed.to_string())));
        metadata.extend(head.target.as_ref().map(|target| (key::TARGET, json(target))));
        metadata.extend(head.reached.as_ref().map(|reached| (key::REACHED, json(reached))));
        metadata.extend(head.device.clone().map(|device| (key::DEVICE, device)));
        // The tensors that draw the scene come first.
        let mut tensors = vec![
            list(tensor::HEAD, Dtype::U8, head.bytes.len(), Source::Bytes(&head.bytes)).sealed(),
            list(tensor::DATA, Dtype::U8, data_bytes, data).summed_elsewhere(),
        ];
        let column = |name: &str, bytes: Vec<u8>| list(name, Dtype::U8, bytes.len(), Source::Owned(bytes));
        tensors.extend(order.map(|order| column(tensor::ORDER, order)));
        tensors
            .extend(extras.into_iter().map(|(name, bytes)| column(&format!("{EXTRA_PREFIX}{name}"), bytes)));
        Self::new(metadata, tensors)
    }

    pub(super) fn new(metadata: Metadata, tensors: Vec<Tensor<'a>>) -> Self {
        let mut sizes: Vec<_> = tensors.iter().map(|t| (t.name.clone(), t.bytes() as u64)).collect();
        let draft = Draft::new(metadata, tensors);
        sizes.push(("header".to_owned(), draft.header_bytes()));
        Self { draft, sizes }
    }

    /// Returns the bytes of each tensor, and of the header under `header`. Their sum is the size of the file.
    #[must_use]
    pub fn tensor_bytes(&self) -> &[(String, u64)] {
        &self.sizes
    }

    /// Returns the bytes of the whole file.
    #[must_use]
    pub fn file_bytes(&self) -> u64 {
        self.sizes.iter().map(|s| s.1).sum()
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

/// Returns a tensor of one dimension.
fn list<'a>(name: &str, dtype: Dtype, len: usize, source: Source<'a>) -> Tensor<'a> {
    Tensor::new(name, dtype, &[len], source)
}

/// Returns values as a coded column.
fn coded(values: &ExtraValues) -> Vec<u8> {
    let mut encoder = ColumnEncoder::new(values.scalar_type());
    let mut out = encoder.push(values);
    out.extend(encoder.finish());
    out
}

/// Number of values that are coded together while a column is made.
const COLUMN_BLOCK: usize = 1 << 18;

/// Returns a coded column of type `ty` of the values of all layers. Each layer has its number of values.
fn coded_layers(ty: ScalarType, layers: Vec<(usize, Spilled)>) -> Result<Vec<u8>> {
    let mut encoder = ColumnEncoder::new(ty);
    let mut out = Vec::new();
    for (mut count, mut layer) in layers {
        while count > 0 {
            let part = count.min(COLUMN_BLOCK);
            let values: ExtraValues = with_scalar!(ty, T => layer.take::<T>(part)?.into());
            out.extend(encoder.push(&values));
            count -= part;
        }
    }
    out.extend(encoder.finish());
    Ok(out)
}

/// Returns the entry of the first view. An empty text stands for no view.
fn view(meta: &SceneMeta) -> Option<(&'static str, String)> {
    meta.view.clone().filter(|view| !view.is_empty()).map(|view| (key::VIEW, view))
}

/// Returns the metadata of an exact file.
fn scene_metadata(layout: Layout, degree: ShDegree, record: &Record, meta: &SceneMeta) -> Metadata {
    let mut metadata = preamble(FORMAT, VERSION);
    metadata.extend([
        (key::DEGREE, degree.to_string()),
        (key::LAYOUT, layout.to_string()),
        // Exact files must have the key, and the record of a packed scene has no value for it.
        (key::PURSUIT, record.pursuit.unwrap_or(Pursuit::Omp).to_string()),
        (key::SEED, record.seed.to_string()),
        (key::MAX_RESIDUAL, record.max_residual.to_string()),
        (key::RMS_RESIDUAL, record.rms_residual.to_string()),
        (key::OVER_TOLERANCE, record.over_tolerance.to_string()),
        (key::ANTIALIASED, meta.antialiased.to_string()),
        (key::COMMENTS, json(&meta.comments)),
    ]);
    metadata.extend(meta.offset.map(|offset| (key::OFFSET, json(&offset))));
    metadata.extend(view(meta));
    metadata.extend(record.tolerance.map(|tolerance| (key::TOLERANCE, tolerance.to_string())));
    metadata.extend(record.max_nonzeros.map(|cap| (key::MAX_NONZEROS, cap.to_string())));
    metadata
}
