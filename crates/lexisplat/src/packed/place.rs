//! What a chunk decodes to.

use std::ops::Range;

use half::f16;

use super::stream::BitCounts;
use crate::scene::splats::Geometry;
use crate::sparse::codes::{Escapes, Indices};
use crate::sparse::dictionary::Dictionary;
use crate::support::maths::Vec3;

/// Where a chunk's geometry goes.
#[derive(Debug, Default)]
pub(super) struct Place<'a> {
    pub(super) positions: &'a mut [Vec3],
    pub(super) dc: &'a mut [Vec3],
    pub(super) opacities: &'a mut [f32],
    pub(super) scales: &'a mut [Vec3],
    pub(super) rotations: &'a mut [[f32; 4]],
    /// Nonzeros of each Gaussian.
    pub(super) counts: &'a mut [u8],
}

/// What a chunk holds beside geometry and counts.
#[derive(Debug, Default)]
pub(super) struct Piece {
    pub(super) atoms: Vec<u16>,
    pub(super) values: Vec<f16>,
    pub(super) escapes: Escapes,
    pub(super) bit_counts: BitCounts,
}

/// Takes the first `count` entries from `values`.
fn take<'a, T>(values: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    values.split_off_mut(..count).unwrap_or_default()
}

/// The places of all chunks, which hold these Gaussians one after the other.
pub(super) fn places<'a>(
    g: &'a mut Geometry,
    counts: &'a mut [u8],
    spans: &[Range<usize>],
) -> Vec<Place<'a>> {
    let mut rest = Place {
        positions: &mut g.positions,
        dc: &mut g.dc,
        opacities: &mut g.opacities,
        scales: &mut g.scales,
        rotations: &mut g.rotations,
        counts,
    };
    let place = |span: &Range<usize>| Place {
        positions: take(&mut rest.positions, span.len()),
        dc: take(&mut rest.dc, span.len()),
        opacities: take(&mut rest.opacities, span.len()),
        scales: take(&mut rest.scales, span.len()),
        rotations: take(&mut rest.rotations, span.len()),
        counts: take(&mut rest.counts, span.len()),
    };
    spans.iter().map(place).collect()
}

pub(super) fn indices(dictionary: &Dictionary, atoms: Vec<u16>) -> Indices {
    if dictionary.len() <= 256 {
        Indices::U8(atoms.into_iter().map(|a| a.to_le_bytes()[0]).collect())
    } else {
        Indices::U16(atoms)
    }
}
