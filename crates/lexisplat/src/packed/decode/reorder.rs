//! Restores the order of the source in unpacked scenes.

use half::f16;

use super::output::indices;
use crate::scene::extra::for_extra;
use crate::scene::splats::Geometry;
use crate::sparse::codes::{CodedRest, Escapes, SparseCodes, Values};
use crate::sparse::dictionary::Dictionary;
use crate::sparse::model::Model;
use crate::support::error::{Error, Result};

/// Returns the index in the file of each of `len` Gaussians of the source. `None` if `order` is not a permutation of them.
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

/// Moves Gaussian `k` of `model` to index `order[k]`. `file` is the file's name in errors.
pub(in crate::packed) fn reordered(model: Model, order: &[u32], file: &str) -> Result<Model> {
    let from = inverse(order, model.len())
        .ok_or_else(|| Error::malformed(file, "the packed order is not a permutation of the Gaussians"))?;
    let (mut geometry, meta, dictionary, codes, record) = model.into_parts();
    gather_geometry(&mut geometry, &from);
    let codes = codes_reordered(&codes, &from, &dictionary)?;
    Model::new(geometry, meta, dictionary, codes, record)
}

/// Replaces the Gaussians of `g` by those at the indices `from`.
pub(in crate::packed) fn gather_geometry(g: &mut Geometry, from: &[usize]) {
    gather(&mut g.positions, from.iter().copied());
    gather(&mut g.normals, from.iter().copied());
    gather(&mut g.dc, from.iter().copied());
    gather(&mut g.opacities, from.iter().copied());
    gather(&mut g.scales, from.iter().copied());
    gather(&mut g.rotations, from.iter().copied());
    for extra in &mut g.extras {
        for_extra!(&mut extra.values, v => gather(v, from.iter().copied()));
    }
}

/// Replaces `values` by the entries at the indices `from`. An empty list stays empty.
pub(in crate::packed) fn gather<T: Copy>(values: &mut Vec<T>, from: impl Iterator<Item = usize>) {
    if !values.is_empty() {
        *values = from.map(|k| values[k]).collect();
    }
}

fn codes_reordered(codes: &SparseCodes, from: &[usize], dictionary: &Dictionary) -> Result<SparseCodes> {
    let (mut atoms, mut values) =
        (Vec::with_capacity(codes.nonzeros()), Vec::with_capacity(codes.nonzeros()));
    let mut escapes = Escapes::default();
    for (to, &k) in (0..).zip(from) {
        match codes.row(k) {
            CodedRest::Code(column) => {
                for (atom, value) in column.iter() {
                    atoms.push(u16::try_from(atom).unwrap_or(u16::MAX));
                    values.push(f16::from_f32(value));
                }
            }
            CodedRest::Exact(row) => {
                escapes.gaussians.push(to);
                escapes.rows.extend_from_slice(row);
            }
        }
    }
    let counts = from.iter().map(|&k| codes.counts()[k]).collect();
    SparseCodes::new(dictionary, counts, indices(dictionary, atoms), Values::F16(values), escapes)
}
