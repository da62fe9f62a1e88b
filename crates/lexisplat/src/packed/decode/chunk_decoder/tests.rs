//! Chunks with missing ranges, and checksums of integers.

use super::*;
use crate::packed::bitstream::LayerForm;
use crate::packed::decode::output::chunk_outputs;
use crate::packed::{PackOptions, Packed, Packer};
use crate::scene::splats::Geometry;
use crate::{Sensitivity, Silent};

/// Returns a packed scene of two layers. With `row`, every 100th SH-rest row has this value in all of its coefficients.
fn packed(row: Option<f32>, points_of_view: Vec<[f32; 3]>) -> Packed {
    let mut splats = crate::support::testing::scene(9000, 11);
    let dim = splats.degree.rest();
    if let Some(value) = row {
        splats.sh_rest.chunks_exact_mut(dim).step_by(100).for_each(|row| row.fill(value));
    }
    let mut options = PackOptions::default();
    (options.atoms, options.points_of_view) = (Some(20), points_of_view);
    let sensitivity = Sensitivity::guess(&splats.geometry);
    Packer::new(&splats, &sensitivity, &options).unwrap().pack(1e-5, &Silent).unwrap().0
}

fn decoder(packed: &Packed) -> BitstreamDecoder {
    BitstreamDecoder::new(packed.head()).unwrap()
}

/// A decoded chunk.
struct Decoded {
    geometry: Geometry,
    counts: Vec<u8>,
    piece: Piece,
    sums: Vec<u32>,
}

/// Decodes chunk `c` from the ranges for which `there` is true.
fn decoded(
    of: &BitstreamDecoder,
    packed: &Packed,
    c: usize,
    there: impl Fn(usize) -> bool,
) -> Option<Decoded> {
    let chunk = &of.head.index.chunks[c];
    let form = of.head.index.layer(chunk.layer);
    let mut ranges = of.checked(Data::First(packed.data()), c, chunk, |_| true).unwrap();
    ranges.iter_mut().enumerate().for_each(|(k, range)| *range = range.filter(|_| there(k)));
    let (mut geometry, mut counts) = (Geometry::zeros(chunk.gaussians), vec![0; chunk.gaussians]);
    let spans = std::slice::from_ref(&(0..chunk.gaussians)).to_vec();
    let mut output = chunk_outputs(&mut geometry, &mut counts, &spans).pop().unwrap();
    let want = Want { sums: true, bits: false };
    let budget = MemoryBudget::new(&packed.head().limits, "test", u64::MAX);
    let (piece, sums) = of.unpacker.chunk(form, chunk.cell, &[], &ranges, want, &mut output, &budget).ok()?;
    Some(Decoded { geometry, counts, piece, sums })
}

/// Returns the root of the mean squared distance between two lists of vectors.
fn distance<const N: usize>(a: &[[f32; N]], b: &[[f32; N]]) -> f64 {
    let squares = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(a - b).powi(2));
    (squares.sum::<f64>() / a.len() as f64).sqrt()
}

fn assert_finite(d: &Decoded) {
    let g = &d.geometry;
    let values = g.positions.as_flattened().iter().chain(g.scales.as_flattened()).chain(g.dc.as_flattened());
    let values = values.chain(g.rotations.as_flattened()).chain(&g.opacities);
    assert!(values.chain(&d.piece.escapes.rows).all(|v| v.is_finite()));
    assert!(d.piece.values.iter().all(|v| v.is_finite()));
}

#[test]
fn chunks_are_decoded_from_the_ranges_that_are_there() {
    let packed = packed(Some(1e6), Vec::new());
    let of = decoder(&packed);
    assert_eq!(of.head.index.layers.iter().map(|form| form.refinements).collect::<Vec<_>>(), [2, 1]);
    for (c, chunk) in of.head.index.chunks.iter().enumerate() {
        let LayerForm { refinements, sh_parts, .. } = of.head.index.layer(chunk.layer);
        let with = |finer: usize, rest: usize| {
            let there = move |k: usize| {
                k == 0 || (1..=finer).contains(&k) || (1 + refinements..1 + refinements + rest).contains(&k)
            };
            decoded(&of, &packed, c, there).unwrap()
        };
        let all = with(refinements, sh_parts);
        let (mut moved, mut coloured) = (f64::INFINITY, f64::INFINITY);
        for finer in 0..=refinements {
            let (mut before, mut none) = (0, None);
            for rest in 0..=sh_parts {
                let found = with(finer, rest);
                assert_finite(&found);
                // Scales and opacities are in the base in full.
                assert_eq!(
                    (&found.geometry.scales, &found.geometry.opacities),
                    (&all.geometry.scales, &all.geometry.opacities)
                );
                // Nonzeros change nothing in the geometry.
                let none = none.get_or_insert_with(|| found.geometry.clone());
                assert_eq!(found.geometry, *none);
                let nonzeros: usize = found.counts.iter().map(|&count| usize::from(count)).sum();
                assert_eq!((nonzeros, nonzeros), (found.piece.atoms.len(), found.piece.values.len()));
                assert!(
                    if rest == 0 { nonzeros == 0 } else { nonzeros > before },
                    "{nonzeros} after {before}"
                );
                assert_eq!(found.piece.escapes.gaussians.is_empty(), rest == 0);
                before = nonzeros;
                // The integers of a range do not depend on later ranges.
                for (k, range) in chunk.ranges.iter().enumerate() {
                    if k <= finer || (1 + refinements..1 + refinements + rest).contains(&k) {
                        assert_eq!(found.sums[k], range.integers, "range {k} of chunk {c}");
                    }
                }
            }
            let geometry = none.unwrap();
            let far = distance(&geometry.positions, &all.geometry.positions);
            let other = distance(&geometry.dc, &all.geometry.dc);
            assert!(far < moved && other < coloured, "chunk {c}: {far} {moved}, {other} {coloured}");
            (moved, coloured) = (far, other);
        }
        assert_eq!((moved, coloured), (0.0, 0.0));
    }
}

#[test]
fn ranges_after_one_that_is_missing_are_not_looked_at() {
    let packed = packed(Some(1e6), Vec::new());
    let of = decoder(&packed);
    assert!(decoded(&of, &packed, 0, |k| k > 0).is_none(), "a chunk without its base");
    let same = |a: &dyn Fn(usize) -> bool, b: &dyn Fn(usize) -> bool| {
        let (a, b) = (decoded(&of, &packed, 0, a).unwrap(), decoded(&of, &packed, 0, b).unwrap());
        assert_eq!((a.geometry, a.counts, a.piece.atoms), (b.geometry, b.counts, b.piece.atoms));
        assert_eq!(a.piece.escapes, b.piece.escapes);
    };
    // The chunk has a base, two refinements and three parts of SH-rest.
    same(&|k| k == 0 || k == 2, &|k| k == 0);
    same(&|k| k != 4, &|k| k <= 3);
    same(&|k| [0, 4, 5].contains(&k), &|k| k == 0);
}

/// Without codes, base colours are the average over the points of view. With codes, they are the colours of the source.
#[test]
fn base_colours_are_seen_on_average() {
    let plain = packed(None, Vec::new());
    let seen = packed(None, vec![[5.0, 0.0, 0.0], [0.0, 5.0, 1.0]]);
    let (of, from) = (decoder(&plain), decoder(&seen));
    for c in 0..from.head.index.chunks.len() {
        let colours = |of: &BitstreamDecoder, packed: &Packed, codes: bool| {
            let refinements = of.head.index.layer(of.head.index.chunks[c].layer).refinements;
            decoded(of, packed, c, |k| codes || k <= refinements).unwrap()
        };
        let (whole, bare) = (colours(&from, &seen, true), colours(&from, &seen, false));
        assert_finite(&whole);
        assert_finite(&bare);
        let original = colours(&of, &plain, true).geometry;
        let kept = distance(&whole.geometry.dc, &original.dc);
        let differ = distance(&whole.geometry.dc, &bare.geometry.dc);
        assert!(kept < 0.5 * differ, "chunk {c}: {kept}, {differ}");
    }
}

#[test]
fn cells_are_those_of_the_index() {
    let packed = packed(None, Vec::new());
    let mut of = decoder(&packed);
    assert!(of.head.index.chunks.len() > 1);
    for c in 0..of.head.index.chunks.len() {
        assert!(decoded(&of, &packed, c, |_| true).is_some());
        of.head.index.chunks[c].cell ^= 1;
        assert!(decoded(&of, &packed, c, |_| true).is_none());
    }
}
