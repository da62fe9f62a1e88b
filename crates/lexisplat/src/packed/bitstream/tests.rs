//! Heads and indexes come back, and no other bytes are accepted.

#![expect(clippy::cast_possible_truncation, reason = "test values fit")]

use proptest::prelude::*;

use super::bytes::{ByteReader, Fields};
use super::*;
use crate::packed::bitstream::parameters::{ColourAndShape, Parameters};
use crate::scene::sh::ShDegree;

/// Most Gaussians of a chunk.
const MOST: usize = 1 << 16;

/// Indexes of chunks with any layers and numbers of Gaussians. Ranges are long enough, and in an order that an index may
/// have.
fn indexes(sh_parts: usize, interim: bool) -> impl Strategy<Value = Index> {
    let refinements = prop::collection::vec(0_u8..=2, 1..4);
    let gaussians = prop_oneof![1..300_usize, Just(1), Just(MOST)];
    let bound = -1e6..1e6_f32;
    let chunk = (any::<u8>(), gaussians, any::<u64>(), prop::array::uniform6(bound), any::<u32>());
    (refinements, prop::collection::vec(chunk, 0..6), any::<u64>()).prop_map(
        move |(refinements, chunks, seed)| {
            let mut index =
                Index { layers: layer_forms(&refinements, sh_parts, interim), ..Index::default() };
            for (layer, gaussians, cell, [a, b, c, d, e, f], number) in chunks {
                let layer = usize::from(layer) % refinements.len();
                let count = index.layer(layer).ranges();
                let range = |k: u32| {
                    let length = if k == 0 { (3 * gaussians as u32).div_ceil(8) } else { number % 100 };
                    Range { start: 0, length, checksum: number.wrapping_mul(k), integers: number ^ k }
                };
                let ranges = (0..count as u32).map(range).collect();
                let bounds = [[a, b, c], [d, e, f]];
                index.chunks.push(Chunk { layer, first: 0, gaussians, cell, bounds, ranges });
            }
            index.chunks.sort_by_key(|chunk| (chunk.layer, chunk.cell));
            let all = index.chunks.iter().zip(0_u32..);
            let ids = |(chunk, number): (&Chunk, u32)| {
                (0..chunk.ranges.len() as u8).map(move |kind| RangeId { chunk: number, kind })
            };
            index.order = all.flat_map(ids).collect();
            // Any order is allowed in which bases come first.
            index.order.sort_by_key(|p| {
                (p.kind > 0, u64::from(p.chunk * 8 + u32::from(p.kind)).wrapping_mul(seed | 1))
            });
            index.lay_out().unwrap();
            index
        },
    )
}

fn written(index: &Index) -> Vec<u8> {
    let mut out = Vec::new();
    index.write(&mut out);
    out
}

/// Reads the index that `bytes` are. `None` if bytes are left over.
fn read(bytes: &[u8], sh_parts: usize, interim: bool) -> Option<Index> {
    let mut from = Fields(ByteReader(bytes));
    Index::read(&mut from, sh_parts, interim).ok().filter(|_| from.0.0.is_empty())
}

proptest! {
    #[test]
    fn indexes_come_back(
        (sh_parts, interim, index) in (0_usize..=3, any::<bool>())
            .prop_flat_map(|(sh_parts, interim)| (Just(sh_parts), Just(interim), indexes(sh_parts, interim))),
    ) {
        let bytes = written(&index);
        prop_assert!(read(&bytes, sh_parts, interim).as_ref() == Some(&index));
        for length in 0..bytes.len() {
            prop_assert!(read(&bytes[..length], sh_parts, interim).is_none(), "{length} of {}", bytes.len());
        }
        let gaussians: usize = index.chunks.iter().map(|chunk| chunk.gaussians).sum();
        prop_assert_eq!(index.gaussians(), gaussians);
        // Ranges lie one after the other in the data.
        let mut end = 0;
        for id in &index.order {
            let range = index.chunks[id.chunk as usize].ranges[usize::from(id.kind)];
            prop_assert_eq!(range.start, end);
            end += u64::from(range.length);
        }
        prop_assert_eq!(index.data_bytes(), end);
        let firsts = index.chunks.iter().scan(0, |first, chunk| {
            *first += chunk.gaussians;
            Some(*first - chunk.gaussians)
        });
        prop_assert!(index.chunks.iter().map(|chunk| chunk.first).eq(firsts));
    }

    /// An index that is accepted comes back when it is written again, so nothing in the bytes is ignored.
    #[test]
    fn changed_indexes_are_others_or_refused(index in indexes(2, true), at in any::<prop::sample::Index>(), bits in 1..=u8::MAX) {
        let mut bytes = written(&index);
        let at = at.index(bytes.len());
        bytes[at] ^= bits;
        if let Some(other) = read(&bytes, 2, true) {
            // Where there are no ranges, the mark that they are sorted says nothing.
            prop_assert!(other != index || (index.order.is_empty() && (at, bits) == (0, 0x80)));
            // Ids of sorted ranges may be listed too, and are not written.
            prop_assert!(written(&other) == bytes || bytes[0] < 0x80);
            prop_assert!(read(&written(&other), 2, true) == Some(other));
        }
    }
}

/// Returns an index with chunks of two layers.
fn two_layers() -> Index {
    let chunk = |layer: usize, gaussians: usize, kinds: usize| {
        let range = Range { length: (3 * gaussians as u32).div_ceil(8), ..Range::default() };
        Chunk { layer, gaussians, ranges: vec![range; kinds], ..Chunk::default() }
    };
    let chunks = vec![chunk(0, 20, 6), chunk(0, 9, 6), chunk(1, 1000, 4)];
    let ids = |chunk: u32, kinds: u8| (0..kinds).map(move |kind| RangeId { chunk, kind });
    let order = ids(0, 6).chain(ids(2, 4)).chain(ids(1, 6)).collect();
    let mut index = Index { layers: layer_forms(&[2, 1], 2, true), chunks, order };
    index.lay_out().unwrap();
    index
}

#[test]
fn indexes_that_cannot_be_are_refused() {
    assert_eq!(read(&written(&two_layers()), 2, true), Some(two_layers()));
    for (sh_parts, interim) in [(1, true), (3, true), (2, false)] {
        assert!(read(&written(&two_layers()), sh_parts, interim).is_none(), "{sh_parts} {interim}");
    }
    let changes: [fn(&mut Index); 11] = [
        |i| i.layers[0].refinements = 3,
        |i| i.layers.extend([LayerForm::default(); 7]),
        |i| i.layers.truncate(1),
        |i| i.chunks[0].gaussians = 0,
        |i| i.chunks[2].gaussians = MOST + 1,
        |i| i.chunks[0].layer = 1,
        |i| i.chunks[1].ranges[0].length = 3,
        |i| i.order.swap(0, 1),
        |i| i.order[1] = i.order[2],
        |i| i.order[1].kind = 6,
        |i| i.order[1].chunk = 3,
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut index = two_layers();
        change(&mut index);
        assert!(read(&written(&index), 2, true).is_none(), "{number}");
    }
}

/// Returns a head for rows of `dim` coefficients, with `points` points of view.
fn head(dim: usize, points: usize, index: Index) -> Head {
    let mut p = Parameters {
        origin: [1.0, -2.0, 3.5],
        cell: 0.25,
        base: ColourAndShape { colour: 0.01, shape: 0.002 },
        factors: [1.5, 2.5, 0.5, 1.0, 1.1, 1.2],
        dc_mean: [0.1, 0.2, 0.3],
        dc_axes: rounded_axes(&[[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.0, -0.8, 0.6]]),
        means: [-4.0, -5.0, -6.0, -0.5, 0.1, 0.2, -0.3],
        ..Parameters::default()
    };
    p.predictors.iter_mut().enumerate().for_each(|(k, row)| row[1] = 0.1 * (k + 1) as f32);
    let rest = RestForm {
        dim,
        atoms: if dim == 0 { 0 } else { 300 },
        least: if dim == 0 { vec![] } else { vec![6, 1] },
    };
    let points: Vec<[f32; 3]> = (0..points).map(|k| [k as f32, 1.5, -0.25 * k as f32]).collect();
    let degree = (0..=4).filter_map(|l| ShDegree::new(l).ok()).find(|degree| degree.rest() == dim).unwrap();
    let atoms = WholeAtoms::new(degree, &vec![0.5; 300 * dim], 4, false);
    let mut head = Head::new(&p, 77.0, rest, &atoms, PointsOfView::new(&points));
    if !index.chunks.is_empty() && dim > 0 {
        head = head.with_interim([0.4, 0.5, 0.6]);
    }
    head.tables = vec![3, 1, 4, 1, 5, 9, 2, 6];
    head.dictionary = if dim == 0 { vec![] } else { vec![2, 7, 1, 8] };
    head.index = index;
    head
}

/// Returns heads of every kind.
fn heads() -> Vec<Head> {
    let mut promised = head(45, 3, two_layers());
    promised.promised = 0.125;
    let read = Head::read(&promised.write(), 45);
    vec![head(0, 0, Index::default()), head(45, 0, two_layers()), head(9, 8, two_layers()), read.unwrap()]
}

#[test]
fn heads_come_back() {
    for head in heads() {
        let (bytes, dim) = (head.write(), head.rest.dim);
        assert_eq!(Head::read(&bytes, dim).as_ref(), Ok(&head), "{dim}");
        for length in 0..bytes.len() {
            assert!(Head::read(&bytes[..length], dim).is_err(), "{length} of {}", bytes.len());
        }
        assert!(Head::read(&[bytes.as_slice(), &[0]].concat(), dim).is_err());
        // The length of rows decides whether there must be atoms.
        assert!(Head::read(&bytes, if dim == 0 { 9 } else { 0 }).is_err());
    }
}

/// A head that is accepted is written again with the same bytes, so nothing in the bytes is ignored but the mark of sorted
/// ranges where no range is.
#[test]
fn changed_heads_are_others_or_refused() {
    for head in heads() {
        let (mut bytes, dim) = (head.write(), head.rest.dim);
        let mut taken = 0;
        for at in 0..bytes.len() {
            for value in [0, 1, 0x7f, 0x80, 0xff, bytes[at] ^ 1, bytes[at] ^ 0x80] {
                let old = std::mem::replace(&mut bytes[at], value);
                if let Ok(other) = Head::read(&bytes, dim) {
                    let ignored = head.index.chunks.is_empty() && at + 2 == bytes.len();
                    assert!(other.write() == bytes || ignored, "byte {at} is {value}");
                    assert!(other == head || old != value, "byte {at} is {value}");
                    taken += 1;
                }
                bytes[at] = old;
            }
        }
        assert!(taken > bytes.len(), "{taken} taken");
    }
}

#[test]
fn heads_with_numbers_no_decoder_takes_are_refused() {
    let changes: [fn(&mut Head); 17] = [
        |h| h.dc_exponent = 101,
        |h| h.rest.atoms = 0,
        |h| h.rest.atoms = 1025,
        |h| h.rest.least = vec![],
        |h| h.rest.least = vec![6, 6, 1],
        |h| h.rest.least = vec![9, 6, 3, 1],
        |h| h.frame.cell = 0.0,
        |h| h.frame.origin[1] = f32::NAN,
        |h| h.value_step = 0.0,
        |h| h.points_of_view.softening = 0.0,
        |h| h.points_of_view.softening = 1e-19,
        |h| h.points_of_view.softening = 1e19,
        |h| h.dc_turn = [0; 4],
        |h| h.points_of_view.points = vec![[0.0; 3]; 16],
        |h| h.points_of_view.points[7] = [1.0, f32::INFINITY, 0.0],
        |h| h.interim = Some([1, 0, 1]),
        |h| h.interim = Some([1, 1, 1 << 27]),
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut head = head(9, 8, two_layers());
        change(&mut head);
        assert!(Head::read(&head.write(), 9).is_err(), "{number}");
    }
}
