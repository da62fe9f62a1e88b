//! Codes and exact rows come back, also unusual ones.

use proptest::prelude::*;

use super::*;
use crate::packed::bitstream::parameters::ColourAndShape;
use crate::packed::entropy::rans_decoder::SymbolDecoder;
use crate::packed::entropy::rans_encoder::SymbolRecorder;
use crate::packed::entropy::script::tables_of;
use crate::packed::entropy::tables::{Lookup, Tables};

/// The Gaussians of each lane. No lane has more than the first.
type LaneLists = Lanes<Vec<CodedGaussian>>;

fn forms() -> impl Strategy<Value = RestForm> {
    let least = prop_oneof![Just(vec![1]), Just(vec![6, 1]), Just(vec![12, 6, 1])];
    let atoms = prop_oneof![Just(1_usize), 2..256_usize, Just(256), Just(257), Just(1024)];
    (prop_oneof![Just(9_usize), Just(24), Just(72)], atoms, least).prop_map(|(dim, atoms, least)| RestForm {
        dim,
        atoms,
        least,
    })
}

/// A target with a code of up to `dim` nonzeros, or with an exact row.
fn target(form: &RestForm) -> impl Strategy<Value = CodedGaussian> + use<> {
    let size = prop_oneof![6 => 1..20_u32, 1 => 1..MAX_SIZE, 1 => Just(MAX_SIZE - 1)];
    let value = (size, any::<bool>())
        .prop_map(|(size, negative)| if negative { -size.cast_signed() } else { size.cast_signed() });
    let (dim, last) = (form.dim, u16::try_from(form.atoms - 1).unwrap());
    let count = prop_oneof![4 => 0..4_usize, 1 => 0..=dim, 1 => Just(dim)];
    let pairs = prop::collection::vec((0..=last, value), dim);
    let finite = prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO;
    let exact = prop::option::weighted(0.1, prop::collection::vec(finite, dim));
    let fields = (count, pairs, exact, 0_u8..16);
    fields.prop_map(|(count, mut code, exact, colour)| {
        code.truncate(if exact.is_some() { 0 } else { count });
        let classes = ColourAndShape { colour, shape: 0 };
        CodedGaussian { classes, code, exact: exact.unwrap_or_default(), ..CodedGaussian::default() }
    })
}

fn lane_lists() -> impl Strategy<Value = (RestForm, LaneLists)> {
    let lists = |form: RestForm| {
        let lane = prop::collection::vec(target(&form), 0..10);
        (Just(form), prop::collection::vec(lane, LANES))
    };
    forms().prop_flat_map(lists).prop_map(|(form, mut lanes)| {
        lanes.sort_by_key(|lane| std::cmp::Reverse(lane.len()));
        (form, std::array::from_fn(|l| std::mem::take(&mut lanes[l])))
    })
}

/// Returns the set of lanes that have Gaussian `i`.
fn set(lists: &LaneLists, i: usize) -> u32 {
    lists.iter().enumerate().fold(0, |set, (l, lane)| set | u32::from(i < lane.len()) << l)
}

/// Number of Gaussians of a block in these tests, which is small so that several blocks are coded.
const FEW: usize = 4;

/// Codes the lists block by block, or decodes as many Gaussians and hands each of them to `see`.
fn code<S: Symbols>(
    coders: &mut [S],
    form: &RestForm,
    lists: &LaneLists,
    encoder: bool,
    mut see: impl FnMut(&Rest, usize),
) -> Option<()> {
    let mut rest = Rest::default();
    let count = lists[0].len();
    for first in (0..count).step_by(FEW) {
        rest.clear();
        let block = first..count.min(first + FEW);
        for i in block.clone() {
            let colours = each(|l| lists[l].get(i).map_or(0, |target| target.classes.colour.into()));
            rest.push(set(lists, i), colours);
        }
        let of = |l: usize| lists[l].iter().skip(first).take(block.len()).collect();
        let wanted: Lanes<Vec<&CodedGaussian>> = std::array::from_fn(of);
        for (part, s) in coders.iter_mut().enumerate() {
            rest.sh_part(s, encoder.then_some(&wanted), form, part).ok()?;
        }
        see(&rest, first);
    }
    Some(())
}

/// Returns the ranges of all coders, and their tables.
fn recorded(form: &RestForm, lists: &LaneLists) -> (Vec<Vec<u8>>, Tables) {
    let mut coders = vec![SymbolRecorder::default(); form.least.len()];
    code(&mut coders, form, lists, true, |_, _| ()).unwrap();
    let all = coders.iter().fold(SymbolRecorder::default(), |all, part| {
        let lanes = all.entries().iter().zip(part.entries());
        SymbolRecorder::restore(lanes.map(|(a, b)| [a.as_slice(), b].concat()).collect())
    });
    let (_, tables) = tables_of(&all).unwrap();
    (coders.iter().map(|part| part.finish(&tables, LANES)).collect(), tables)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn codes_and_rows_come_back((form, lists) in lane_lists()) {
        let (ranges, tables) = recorded(&form, &lists);
        let lookup = Lookup::new(&tables);
        // A part that is missing has no nonzeros, and changes nothing in the coders before it.
        for there in 1..=form.least.len() {
            let decoder = |k: usize| SymbolDecoder::new(&lookup, &ranges[k], LANES, false).unwrap();
            let mut decoders: Vec<SymbolDecoder<'_>> = (0..there).map(decoder).collect();
            let mut seen = 0;
            code(&mut decoders, &form, &lists, false, |rest, first| {
                for (l, lane) in lists.iter().enumerate() {
                    let mut cursor = Cursor::default();
                    for (i, target) in lane.iter().skip(first).take(rest.len()).enumerate() {
                        seen += 1;
                        for part in 0..form.least.len() {
                            let most = if part == 0 { MAX_SIZE } else { form.least[part - 1] };
                            let sizes = form.least[part]..most;
                            let own = target.code.iter().filter(|(_, v)| sizes.contains(&v.unsigned_abs()));
                            let expected: Vec<(u16, i32)> = if part < there { own.copied().collect() } else { vec![] };
                            match rest.coded(&form, part, i, l, &mut cursor) {
                                Coded::Exact(row) => {
                                    assert!(part == 0 && !target.exact.is_empty());
                                    let bits = |row: &[f32]| row.iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
                                    assert_eq!(bits(row), bits(&target.exact));
                                }
                                Coded::Code { first, count } => {
                                    assert!(part > 0 || target.exact.is_empty());
                                    let found: Vec<(u16, i32)> =
                                        rest.nonzeros(part, first, count, l).collect();
                                    assert_eq!(found, expected, "part {part} of {there}");
                                }
                            }
                        }
                    }
                }
            })
            .unwrap();
            prop_assert_eq!(seen, lists.iter().map(Vec::len).sum::<usize>());
            prop_assert!(decoders.iter().all(|decoder| decoder.check_end().is_ok()));
        }
    }

    /// A decoder with fewer atoms or shorter rows refuses codes that it cannot have.
    #[test]
    fn what_cannot_be_is_refused((form, lists) in lane_lists()) {
        let atoms = lists.iter().flatten().flat_map(|t| &t.code).map(|c| usize::from(c.0)).max();
        let longest = lists.iter().flatten().map(|t| t.code.len()).max().unwrap_or(0);
        let (ranges, tables) = recorded(&form, &lists);
        let lookup = Lookup::new(&tables);
        let play = |form: &RestForm| {
            let mut decoders: Vec<SymbolDecoder<'_>> =
                ranges.iter().map(|range| SymbolDecoder::new(&lookup, range, LANES, false).unwrap()).collect();
            code(&mut decoders, form, &lists, false, |_, _| ())
        };
        prop_assert!(play(&form).is_some());
        if let Some(largest) = atoms.filter(|&a| a > 0 && (form.atoms <= 256 || a > 256)) {
            let fewer = RestForm { atoms: largest, ..form.clone() };
            prop_assert!(play(&fewer).is_none());
        }
        if form.least.len() == 1 && longest > 2 {
            let shorter = RestForm { dim: longest - 2, ..form };
            prop_assert!(play(&shorter).is_none());
        }
    }
}

#[test]
fn rows_that_are_not_finite_are_refused() {
    let form = RestForm { dim: 9, atoms: 4, least: vec![6, 1] };
    for wild in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut lists = LaneLists::default();
        let mut exact = vec![1.0; 9];
        exact[8] = wild;
        lists[0].push(CodedGaussian { exact, ..CodedGaussian::default() });
        let mut coders = vec![SymbolRecorder::default(); 2];
        assert!(code(&mut coders, &form, &lists, true, |_, _| ()).is_none(), "{wild}");
    }
}
