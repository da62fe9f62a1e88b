//! Puts unpacked Gaussians back in the order of their source.

use crate::scene::extra::for_extra;
use crate::sparse::codes::{Escapes, Indices, SparseCodes, Values};
use crate::sparse::model::Model;
use crate::support::error::{Error, Result};

/// The place in the file of each of `len` Gaussians of the source; `None` if `order` is not a
/// permutation of them.
fn inverse(order: &[u32], len: usize) -> Option<Vec<usize>> {
    let mut from = vec![usize::MAX; len];
    for (k, &source) in order.iter().enumerate() {
        let slot = from.get_mut(source as usize)?;
        if *slot != usize::MAX {
            return None;
        }
        *slot = k;
    }
    (order.len() == len).then_some(from)
}

/// `model`, which is from `file`, with Gaussian k moved to `order[k]`.
pub(super) fn reordered(model: Model, order: &[u32], file: &str) -> Result<Model> {
    let from = inverse(order, model.len())
        .ok_or_else(|| Error::malformed(file, "the packed order is not a permutation of the Gaussians"))?;
    let (mut geometry, meta, dictionary, codes, record) = model.into_parts();
    let g = &mut geometry;
    gather(&mut g.positions, from.iter().copied());
    gather(&mut g.normals, from.iter().copied());
    gather(&mut g.dc, from.iter().copied());
    gather(&mut g.opacities, from.iter().copied());
    gather(&mut g.scales, from.iter().copied());
    gather(&mut g.rotations, from.iter().copied());
    for extra in &mut g.extras {
        for_extra!(&mut extra.values, v => gather(v, from.iter().copied()));
    }
    let codes = codes_reordered(&codes, &from, &dictionary)?;
    Model::new(geometry, meta, dictionary, codes, record)
}

/// Replaces `values` by the entries at the indices `from`. Empty arrays stay empty.
pub(super) fn gather<T: Copy>(values: &mut Vec<T>, from: impl Iterator<Item = usize>) {
    if !values.is_empty() {
        *values = from.map(|k| values[k]).collect();
    }
}

fn codes_reordered(
    codes: &SparseCodes,
    from: &[usize],
    dictionary: &crate::sparse::dictionary::Dictionary,
) -> Result<SparseCodes> {
    let counts = codes.counts();
    let mut starts = Vec::with_capacity(counts.len());
    let mut start = 0;
    for &count in counts {
        starts.push(start);
        start += usize::from(count);
    }
    let spans = || from.iter().map(|&k| starts[k]..starts[k] + usize::from(counts[k]));
    let indices = match codes.indices() {
        Indices::U8(v) => Indices::U8(spans().flat_map(|span| &v[span]).copied().collect()),
        Indices::U16(v) => Indices::U16(spans().flat_map(|span| &v[span]).copied().collect()),
    };
    let values = match codes.values() {
        Values::F16(v) => Values::F16(spans().flat_map(|span| &v[span]).copied().collect()),
        Values::F32(v) => Values::F32(spans().flat_map(|span| &v[span]).copied().collect()),
    };
    let mut escapes = Escapes::default();
    let old = codes.escapes();
    if !old.gaussians.is_empty() {
        let dim = dictionary.dim();
        for (to, &k) in (0_u32..).zip(from) {
            if let Ok(at) = old.gaussians.binary_search_by(|&g| (g as usize).cmp(&k)) {
                escapes.gaussians.push(to);
                escapes.rows.extend_from_slice(&old.rows[at * dim..(at + 1) * dim]);
            }
        }
    }
    let counts = from.iter().map(|&k| counts[k]).collect();
    SparseCodes::new(dictionary, counts, indices, values, escapes)
}
