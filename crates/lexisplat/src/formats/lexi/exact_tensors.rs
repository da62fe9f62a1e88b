//! The tensors of an exact file, from a model or from arrays that were spilled.

use safetensors::Dtype;

use super::layout::{CodeLayout, Layout};
use super::schema::{EXTRA_PREFIX, GEOMETRY, geometry_shape, tensor};
use super::tensors::{Source, Tensor};
use crate::scene::extra::{Extra, for_extra};
use crate::sparse::codes::{Indices, ValueType, Values};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Model;
use crate::support::error::Result;
use crate::support::limits::Limits;

/// The arrays of an exact file.
pub(super) struct ExactTensors<'a> {
    /// Geometry and extras, in the order in which sizes are listed.
    pub(super) geometry: Vec<Tensor<'a>>,
    pub(super) gaussians: usize,
    pub(super) nonzeros: usize,
    pub(super) escapes: usize,
    /// The counts, or the pointers of layout `paper`.
    pub(super) counts: Source<'a>,
    pub(super) indices: Source<'a>,
    pub(super) values: Source<'a>,
    pub(super) escaped: Source<'a>,
    pub(super) escape_rows: Source<'a>,
}

impl<'a> ExactTensors<'a> {
    pub(super) fn of_model(model: &'a Model, layout: CodeLayout) -> Self {
        let (n, g, codes) = (model.len(), model.geometry(), model.codes());
        let (counts, indices, values) = match layout {
            CodeLayout::Compact => (
                Source::of(codes.counts()),
                Source::Bytes(codes.indices().as_bytes()),
                Source::Bytes(codes.values().as_bytes()),
            ),
            CodeLayout::Paper => (
                Source::words(move || std::iter::once(0).chain(paper_pointers(codes.counts(), 0))),
                Source::words(move || paper_indices(codes.indices())),
                Source::words(move || paper_values(codes.values())),
            ),
        };
        let arrays = if g.normals.is_empty() { GEOMETRY.len() - 1 } else { GEOMETRY.len() };
        let geometry = geometry_tensors(n, g.floats().into_iter().take(arrays).map(Source::of));
        let extras = g.extras.iter().map(|extra| extra_tensor(extra, n, bytes_of(extra)));
        Self {
            geometry: geometry.chain(extras).collect(),
            gaussians: n,
            nonzeros: codes.nonzeros(),
            escapes: codes.escapes().gaussians.len(),
            counts,
            indices,
            values,
            escaped: Source::of(&codes.escapes().gaussians),
            escape_rows: Source::of(&codes.escapes().rows),
        }
    }

    /// Returns the tensors in the order in which sizes are listed.
    pub(super) fn list(self, dictionary: &'a Dictionary, layout: Layout) -> Vec<Tensor<'a>> {
        let (n, nonzeros, escapes) = (self.gaussians, self.nonzeros, self.escapes);
        let mut out = self.geometry;
        let dim = dictionary.dim();
        if dim == 0 {
            return out;
        }
        let mut put = |name: &str, dtype: Dtype, shape: &[usize], source: Source<'a>| {
            out.push(Tensor::new(name, dtype, shape, source));
        };
        put(tensor::DICTIONARY, Dtype::F32, &[dictionary.len(), dim], Source::of(dictionary.as_slice()));
        let value = if layout.values() == ValueType::F16 { Dtype::F16 } else { Dtype::F32 };
        put(tensor::VALUES, value, &[nonzeros], self.values);
        if layout == Layout::Paper {
            put(tensor::POINTERS, Dtype::I32, &[n + 1], self.counts);
            put(tensor::INDICES, Dtype::I32, &[nonzeros], self.indices);
        } else {
            let small = matches!(Indices::for_atoms(dictionary.len()), Indices::U8(_));
            put(tensor::INDICES, if small { Dtype::U8 } else { Dtype::U16 }, &[nonzeros], self.indices);
            put(tensor::COUNTS, Dtype::U8, &[n], self.counts);
        }
        if escapes > 0 {
            put(tensor::ESCAPED, Dtype::U32, &[escapes], self.escaped);
            put(tensor::ESCAPE_ROWS, Dtype::F32, &[escapes, dim], self.escape_rows);
        }
        out
    }
}

/// Returns the tensors of the geometry of `n` Gaussians. `arrays` are in the order of [`GEOMETRY`] and may lack the normals.
pub(super) fn geometry_tensors<'a>(
    n: usize,
    arrays: impl IntoIterator<Item = Source<'a>>,
) -> impl Iterator<Item = Tensor<'a>> {
    let tensor =
        move |((name, width), source)| Tensor::new(name, Dtype::F32, &geometry_shape(n, width), source);
    GEOMETRY.into_iter().zip(arrays).map(tensor)
}

/// Returns the tensor of a property that 3DGS does not define.
pub(super) fn extra_tensor<'a>(extra: &Extra, n: usize, source: Source<'a>) -> Tensor<'a> {
    let dtype = extra.values.scalar_type().dtype();
    Tensor::new(&format!("{EXTRA_PREFIX}{}", extra.name), dtype, &[n], source)
}

fn bytes_of(extra: &Extra) -> Source<'_> {
    for_extra!(&extra.values, v => Source::of(v))
}

/// Returns the end of the codes of each Gaussian, if `before` nonzeros come before them. The caller has checked that an i32
/// can hold the ends.
pub(super) fn paper_pointers(counts: &[u8], before: i32) -> impl Iterator<Item = u32> + '_ {
    counts.iter().scan(before, |end, &count| {
        *end = end.wrapping_add(i32::from(count));
        Some(end.cast_unsigned())
    })
}

/// Returns indices as i32.
pub(super) fn paper_indices(indices: &Indices) -> impl Iterator<Item = u32> + '_ {
    #[expect(clippy::cast_possible_truncation, reason = "an index is a u16 at most")]
    (0..indices.len()).map(|k| indices.get(k) as u32)
}

/// Returns the bits of values as f32.
pub(super) fn paper_values(values: &Values) -> impl Iterator<Item = u32> + '_ {
    (0..values.len()).map(|k| values.get(k).to_bits())
}

/// Refuses more nonzeros than the pointers of layout `paper` can count.
pub(super) fn check_pointers(nonzeros: u64) -> Result<()> {
    let largest = i32::MAX.unsigned_abs().into();
    Limits::check("nonzeros in layout 'paper', whose pointers are i32", nonzeros, largest)
}
