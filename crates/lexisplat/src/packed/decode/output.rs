//! The output of decoding a chunk.

use std::ops::Range;

use half::f16;

use crate::packed::bitstream::drawn::Drawn;
use crate::packed::bitstream::stream::BitCounts;
use crate::scene::splats::Geometry;
use crate::sparse::codes::{Escapes, Indices};
use crate::sparse::dictionary::Dictionary;
use crate::support::maths::Vec3;

/// The slices of a scene into which the geometry of a chunk is decoded.
#[derive(Debug, Default)]
pub(in crate::packed) struct ChunkOutput<'a> {
    pub(in crate::packed) positions: &'a mut [Vec3],
    pub(in crate::packed) dc: &'a mut [Vec3],
    pub(in crate::packed) opacities: &'a mut [f32],
    pub(in crate::packed) scales: &'a mut [Vec3],
    pub(in crate::packed) rotations: &'a mut [[f32; 4]],
    /// Number of nonzeros of each Gaussian.
    pub(in crate::packed) counts: &'a mut [u8],
}

impl ChunkOutput<'_> {
    /// Stores lane `l` of `drawn` as Gaussian `i`; `None` if there is no such Gaussian.
    #[inline(always)]
    pub(in crate::packed) fn put(&mut self, i: usize, drawn: &Drawn, l: usize) -> Option<()> {
        *self.positions.get_mut(i)? = drawn.position.map(|x| x[l]);
        *self.scales.get_mut(i)? = drawn.scales.map(|x| x[l]);
        *self.opacities.get_mut(i)? = drawn.opacity[l];
        *self.rotations.get_mut(i)? = drawn.rotation.map(|x| x[l]);
        *self.dc.get_mut(i)? = drawn.dc.map(|x| x[l]);
        Some(())
    }
}

/// The codes of a decoded chunk, without their counts.
#[derive(Debug, Default)]
pub(in crate::packed) struct Piece {
    pub(in crate::packed) atoms: Vec<u16>,
    pub(in crate::packed) values: Vec<f16>,
    pub(in crate::packed) escapes: Escapes,
    pub(in crate::packed) bit_counts: BitCounts,
}

/// Takes the first `count` entries out of `values`.
fn take<'a, T>(values: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    values.split_off_mut(..count).unwrap_or_default()
}

/// Splits a scene into the outputs of all chunks. `spans` holds the Gaussians of each chunk, one chunk after the other.
pub(in crate::packed) fn chunk_outputs<'a>(
    g: &'a mut Geometry,
    counts: &'a mut [u8],
    spans: &[Range<usize>],
) -> Vec<ChunkOutput<'a>> {
    let mut rest = ChunkOutput {
        positions: &mut g.positions,
        dc: &mut g.dc,
        opacities: &mut g.opacities,
        scales: &mut g.scales,
        rotations: &mut g.rotations,
        counts,
    };
    let output = |span: &Range<usize>| ChunkOutput {
        positions: take(&mut rest.positions, span.len()),
        dc: take(&mut rest.dc, span.len()),
        opacities: take(&mut rest.opacities, span.len()),
        scales: take(&mut rest.scales, span.len()),
        rotations: take(&mut rest.rotations, span.len()),
        counts: take(&mut rest.counts, span.len()),
    };
    spans.iter().map(output).collect()
}

pub(in crate::packed) fn indices(dictionary: &Dictionary, atoms: Vec<u16>) -> Indices {
    if dictionary.len() <= 256 {
        Indices::U8(atoms.into_iter().map(|a| a.to_le_bytes()[0]).collect())
    } else {
        Indices::U16(atoms)
    }
}
